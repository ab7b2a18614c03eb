"""Actuators of a tree: affine forces, and muscles as MuJoCo's, whose law is `finger_pin.laws.muscle`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from finger_pin.description.parameters import Joint
from finger_pin.description.primitives import Triple
from finger_pin.description.tree_parts import TreeJoint
from finger_pin.description.validation import Description, Name, choice, problem, quantity, real, vector
from finger_pin.description.waypoints import BODY_POINT

Pair = tuple[float, float]
_MUJOCO = "MuJoCo's default"
_LARGE = 1e9


class Muscle(Description):
    """A muscle; lengths without a unit are in optimal lengths L_0, at which its active force is largest.

    L_0 is that with which ``length_range`` (of the tendon or joint, times gear) is ``range``.
    """

    force: Annotated[float, real(0.0, 1e7, above=True)] = quantity(
        ..., unit="N", source="design", doc="F, most active force at rest."
    )
    length_range: Annotated[Pair, vector(2, -1e3, 1e3)] = quantity(
        ..., unit="m", source="design", doc="Lengths of what it drives at which it is as long as range says."
    )
    range: Annotated[Pair, vector(2, 0.0, 100.0)] = quantity(
        (0.75, 1.05), unit="1", source=_MUJOCO, doc="Its own least and largest length."
    )
    lmin: Annotated[float, real(0.0, 1.0)] = quantity(
        0.5, unit="1", source=_MUJOCO, doc="Length below which it exerts no active force."
    )
    lmax: Annotated[float, real(1.0, 100.0, above=True)] = quantity(
        1.6, unit="1", source=_MUJOCO, doc="Length above which it exerts no active force."
    )
    vmax: Annotated[float, real(0.0, 1e4, above=True)] = quantity(
        1.5, unit="1/s", source=_MUJOCO, doc="Speed of shortening at which it exerts no active force."
    )
    fpmax: Annotated[float, real(0.0, 1e3)] = quantity(
        1.3, unit="1", source=_MUJOCO, doc="Passive force at lmax over F."
    )
    fvmax: Annotated[float, real(1.0, 1e3)] = quantity(
        1.2, unit="1", source=_MUJOCO, doc="Active force while it is lengthened fast, over that at rest."
    )
    time_constants: Annotated[Pair, vector(2, 1e-6, 1e3)] = quantity(
        (0.01, 0.04), unit="s", source=_MUJOCO, doc="Of activation and of deactivation."
    )
    smoothing: Annotated[float, real(0.0, 1.0)] = quantity(
        0.0, unit="1", source=_MUJOCO, doc="Width, in activation, over which one time constant passes into the other."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for entry in ("length_range", "range"):
            low, high = getattr(self, entry)
            if low >= high:
                raise problem(entry, "the least length must be below the largest", [low, high])
        if self.lmin >= 1.0:
            raise problem("lmin", "must be below 1, the optimal length", self.lmin)
        return self

    @property
    def optimal_length(self) -> float:
        """L_0, m, of the driven joint or tendon."""
        return (self.length_range[1] - self.length_range[0]) / (self.range[1] - self.range[0])


class Wrench(Description):
    """Force and torque on a body at a point, per force of the actuator: a thruster, or a hand that pulls a tip."""

    body: Name = Field(description="The body that it pushes.")
    position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point in that body's frame."
    )
    force: Annotated[Triple, vector(3, -1e6, 1e6)] = quantity(
        (0.0, 0.0, 0.0), unit="1", source="design", doc="Force per force of the actuator."
    )
    torque: Annotated[Triple, vector(3, -1e6, 1e6)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Torque per force of the actuator."
    )
    axes: Annotated[Literal["body", "other"], choice("body", "other")] = quantity(
        "body",
        unit="1",
        source="design",
        doc="Whose axes force and torque have: the body's, pushed from outside, or those of other, which bears them. A "
        "force along these has a length, from other_position to position.",
    )
    other: Name | None = Field(None, description="The body that bears the reaction; the base if left out.")
    other_position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="In the frame of other: where its length counts from."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not any((*self.force, *self.torque)):
            raise problem("force", "is missing: give force, torque or both")
        for entry in ("other", "other_position"):
            if self.axes == "body" and getattr(self, entry) != type(self).model_fields[entry].default:
                raise problem(entry, 'is for axes = "other"', getattr(self, entry))
        return self


class TreeActuator(Description):
    """The drive of a joint, tendon or wrench: gain u + offset + by_length l + by_speed l'; l is gear times its length.

    With ``time_constant`` its input comes late, T a' = u - a, and a takes the place of u; with ``integrates`` its input
    is a rate, a' = u. With ``integral`` the force grows with the sum of the error e, e' = u - l: by integral e.

    With a table ``muscle`` it is a muscle instead: its input is the excitation, and its force is against l.
    """

    joint: Name | None = Field(None, description="The joint that it drives.")
    tendon: Name | None = Field(None, description="The tendon that it drives.")
    wrench: Wrench | None = Field(None, description="Force and torque at a point of a body, in their place.")
    gear: Annotated[float, real(-1e6, 1e6)] = quantity(
        1.0, unit="1", source="design", doc="Its length, and the arm of its force, over those of what it drives."
    )
    gain: Annotated[float, real(-_LARGE, _LARGE)] = quantity(
        1.0, unit="N per input", source="design", doc="Force per input."
    )
    offset: Annotated[float, real(-_LARGE, _LARGE)] = quantity(
        0.0, unit="N", source="design", doc="b_0, force without input at length zero."
    )
    by_length: Annotated[float, real(-_LARGE, _LARGE)] = quantity(
        0.0, unit="N/m", source="design", doc="b_1, force per length l."
    )
    by_speed: Annotated[float, real(-_LARGE, _LARGE)] = quantity(
        0.0, unit="N s/m", source="design", doc="b_2, force per speed l'."
    )
    input_range: Annotated[Pair, vector(2, -_LARGE, _LARGE)] | None = quantity(
        None, unit="1", source="design", doc="Between which u is held."
    )
    force_range: Annotated[Pair, vector(2, -_LARGE, _LARGE)] | None = quantity(
        None, unit="N", source="design", doc="Between which the force is held."
    )
    time_constant: Annotated[float, real(0.0, 1e3)] = quantity(
        0.0, unit="s", source="design", doc="T, with which the force follows the input; 0: at once."
    )
    integrates: bool = Field(False, strict=True, description="Whether the input is the rate of what it holds.")
    integral: Annotated[float, real(0.0, _LARGE)] = quantity(
        0.0, unit="N per input and s", source="design", doc="Gain of the sum of the error, of a servo."
    )
    state_range: Annotated[Pair, vector(2, -_LARGE, _LARGE)] | None = quantity(
        None, unit="1", source="design", doc="Between which a, or the sum of the error, is held."
    )

    slew: Annotated[float, real(0.0, _LARGE, above=True)] | None = quantity(
        None,
        unit="1/s",
        source="design",
        doc="Largest rate of a, which follows u; without time_constant within 0.1 ms.",
    )
    delay: Annotated[float, real(0.0, 10.0)] = quantity(
        0.0,
        unit="s",
        source="design",
        doc="After which a command acts. With a clock that starts at 0, u is 0 before the first command arrives; a run "
        "that starts later (`start_time`, or one that goes on) reads its signal before the start.",
    )

    muscle: Muscle | None = Field(None, description="A muscle in place of an affine force.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if sum(each is not None for each in (self.joint, self.tendon, self.wrench)) != 1:
            raise problem("", "drives one of joint, tendon and wrench")
        if not self.has_length:
            for entry in ("by_length", "integral"):
                if getattr(self, entry):
                    allowed = 'needs a length, which a wrench has by a force with axes = "other" alone'
                    raise problem(entry, allowed, getattr(self, entry))
        if self.muscle is not None:
            if self.drives[0] == "wrench":
                raise problem("muscle", "drives a joint or a tendon, no wrench")
            for entry in sorted(self.model_fields_set - {"joint", "tendon", "gear", "input_range", "delay", "muscle"}):
                if getattr(self, entry) != type(self).model_fields[entry].default:
                    raise problem(entry, "has no effect beside muscle; leave it out", getattr(self, entry))
            low, high = self.excitations
            if not 0.0 <= low < high <= 1.0:
                raise problem("input_range", "must lie within 0 and 1, those of a muscle's excitation", [low, high])
        if (self.time_constant > 0.0) + self.integrates + (self.integral > 0.0) > 1:
            raise problem("", "has one of time_constant, integrates and integral")
        if self.slew is not None and (self.integrates or self.integral > 0.0):
            raise problem("slew", "is beside neither integrates nor integral", self.slew)
        if self.state_range is not None and not self.has_state:
            raise problem("state_range", "is for time_constant, slew, integrates or integral", list(self.state_range))
        for entry in ("input_range", "force_range", "state_range"):
            limits = getattr(self, entry)
            if limits is not None and limits[0] > limits[1]:
                raise problem(entry, "the lower limit must not be above the upper one", list(limits))
        return self

    @property
    def drives(self) -> tuple[str, str]:
        """Kind and name of what it drives: a ``joint``, a ``tendon``, or the body that a ``wrench`` pushes."""
        if self.wrench is not None:
            return "wrench", self.wrench.body
        return ("joint", self.joint) if self.joint is not None else ("tendon", str(self.tendon))

    @property
    def has_length(self) -> bool:
        """Whether what it drives has a length; of wrenches a force along the axes of another body has one."""
        return self.wrench is None or (self.wrench.axes == "other" and not any(self.wrench.torque))

    def units(self, joints: Mapping[str, TreeJoint]) -> tuple[str, str]:
        """Return the units of its length and of its force, by the joints of its tree."""
        kind, name = self.drives
        return ("rad", "N m") if kind == "joint" and joints[name].kind == "hinge" else ("m", "N")

    def reach(self, joints: Mapping[str, Joint]) -> Pair | None:
        """Return the least and largest input: its range, or the goals at the ends of its joint's range; or None."""
        if self.muscle is not None:
            return self.excitations
        if self.input_range is not None:
            return self.input_range
        kind, name = self.drives
        if kind != "joint" or not self.by_length * self.gain < 0.0 or self.integrates:
            return None
        ends = [-self.by_length / self.gain * self.gear * each - self.offset / self.gain for each in joints[name].range]
        return min(ends), max(ends)

    @property
    def has_state(self) -> bool:
        """Whether its force depends on more than input and motion of the moment."""
        follows = self.time_constant > 0.0 or self.slew is not None
        return follows or self.integrates or self.integral > 0.0 or self.muscle is not None

    @property
    def excitations(self) -> Pair:
        """The least and the largest input of a muscle."""
        return self.input_range or (0.0, 1.0)

    @property
    def only_pulls(self) -> bool:
        """Whether the actuator only pulls, at any input and motion."""
        if self.muscle is not None:
            return self.gear > 0.0
        bounds = [each * self.gear for each in self.force_range or ()]
        if not (self.by_length or self.by_speed or self.has_state) and self.input_range is not None:
            bounds = bounds or [(self.gain * each + self.offset) * self.gear for each in self.input_range]
        return bool(bounds) and max(bounds) <= 0.0


def drivers(actuators: Mapping[str, TreeActuator], kind: str, name: str) -> dict[str, TreeActuator]:
    """Return those of a tree's actuators that drive a joint or a tendon, by name."""
    return {key: each for key, each in actuators.items() if each.drives == (kind, name)}
