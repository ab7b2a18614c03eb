"""A hand as a tree of bodies, with tendons, couplings and actuators, such as a MuJoCo model.

It stands beside the joints and tendons of a `FingerDescription`, which keep the joints' ranges and springs. Units are
SI: of a joint that slides, angles are lengths in m and torques are forces in N. Frames and signs are MuJoCo's: a body's
frame is where its placement says while its joints are at their references, and the length of a tendon grows where its
joints' coefficients are positive. Quaternions are x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from finger_pin.description.meshes import Mesh
from finger_pin.description.objects import Object
from finger_pin.description.surface import BodyShape
from finger_pin.description.validation import (
    MOST_ANGLE,
    Description,
    Name,
    Numbers,
    choice,
    problem,
    quantity,
    real,
    reals,
    suggestion,
    vector,
)
from finger_pin.description.waypoints import PLACE, Triple, Waypoint, check_path

_MILLIMETRES = " m (is it in millimetres?)"
_LARGE = 1e9
# What is more is no radius that a cord winds at, as `Crossing` has it, m.
_LARGEST_RADIUS = 0.5
#: The highest power of a coupling.
MOST_POWER = 7
Pair = tuple[float, float]


class TreeSolid(Description):
    """A solid of a body, for pictures."""

    kind: Annotated[
        Literal["sphere", "capsule", "cylinder", "box", "mesh"], choice("sphere", "capsule", "cylinder", "box", "mesh")
    ] = quantity(..., unit="1", source="design", doc="sphere, capsule, cylinder, box or mesh.")
    mesh: Name | None = Field(None, description="Of a mesh, which one of the tree's.")
    radius: Annotated[float, real(0.0, 10.0, hint=_MILLIMETRES)] = quantity(
        0.0, unit="m", source="design", doc="Of all but a box and a mesh."
    )
    length: Annotated[float, real(0.0, 10.0, hint=_MILLIMETRES)] = quantity(
        0.0, unit="m", source="design", doc="Of a cylinder, or of a capsule without its round ends, along z."
    )
    sides: Annotated[Triple, vector(3, 0.0, 10.0, _MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of a box."
    )
    position: Annotated[Triple, PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its centre, or a mesh's origin, in the body's frame."
    )
    orientation: Annotated[tuple[float, float, float, float], vector(4, -1.0, 1.0)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="In the body's frame: quaternion x, y, z, w."
    )

    @model_validator(mode="after")
    def _which(self) -> Self:
        if self.kind == "mesh" and self.mesh is None:
            raise problem("mesh", 'is missing: kind = "mesh" needs the name of one')
        return self


class Body(Description):
    """A rigid body, placed on another one or on the base."""

    parent: Name | None = Field(None, description="The body that carries it; the base if left out.")
    position: Annotated[Triple, PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its frame, in the parent's."
    )
    orientation: Annotated[tuple[float, float, float, float], vector(4, -1.0, 1.0)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="Of its frame in the parent's: quaternion x, y, z, w."
    )
    mass: Annotated[float, real(0.0, 1e4)] = quantity(0.0, unit="kg", source="design", doc="Mass.")
    centre: Annotated[Triple, PLACE] = quantity((0.0, 0.0, 0.0), unit="m", source="design", doc="Mass centre.")
    inertia: Annotated[tuple[float, ...], vector(6, -1e4, 1e4)] = quantity(
        (0.0,) * 6, unit="kg m2", source="design", doc="About the mass centre, body's axes: xx, yy, zz, xy, xz, yz."
    )
    gravity_compensation: Annotated[float, real(-100.0, 100.0)] = quantity(
        0.0, unit="1", source="design", doc="Part of its weight that something holds up, at its mass centre."
    )
    solids: dict[Name, TreeSolid] = Field({}, description="Solids that are drawn of it, by name.")
    shapes: dict[Name, BodyShape] = Field({}, description="Shapes with which it touches, by name, unique in a tree.")

    @field_validator("orientation")
    @classmethod
    def _unit(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        norm = sum(each * each for each in value) ** 0.5
        if abs(norm - 1.0) > 1e-6:
            raise problem("", "must be a quaternion x, y, z, w of length 1", list(value))
        return value


class TreeJoint(Description):
    """A joint of a body on its parent; a body with several joints has them one after the other."""

    body: Name = Field(description="The body that moves.")
    kind: Annotated[Literal["hinge", "slide"], choice("hinge", "slide")] = quantity(
        "hinge", unit="1", source="design", doc="It turns about its axis, or slides along it."
    )
    axis: Annotated[Triple, vector(3, -1.0, 1.0)] = quantity(
        (0.0, 0.0, 1.0), unit="1", source="design", doc="Unit vector in the body's frame."
    )
    anchor: Annotated[Triple, PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="A point of the axis, in the body's frame."
    )
    reference: Annotated[float, real(-MOST_ANGLE, MOST_ANGLE)] = quantity(
        0.0, unit="rad", source="design", doc="Position at which the body is where its placement says."
    )
    armature: Annotated[float, real(0.0, 1e4)] = quantity(
        0.0, unit="kg m2", source="design", doc="Inertia that turns with the joint alone, such as a rotor's."
    )
    bearing: bool = Field(
        True, strict=True, description="Whether it is a pin or a guide that rubs; the joints of a free body are none."
    )

    @field_validator("axis")
    @classmethod
    def _unit(cls, value: Triple) -> Triple:
        if abs(sum(each * each for each in value) ** 0.5 - 1.0) > 1e-6:
            raise problem("", "must be a unit vector", list(value))
        return value


class TreeTendon(Description):
    """A tendon: a sum of joint positions, or a path through space, with spring, damper and friction along it."""

    joints: dict[Name, Annotated[float, real(-1e3, 1e3)]] | None = quantity(
        None, unit="m/rad", source="design", doc="Length gained per joint position."
    )
    path: dict[Name, Waypoint] | None = Field(None, description="By name, in order.")
    stiffness: Annotated[float, real(0.0, _LARGE)] = quantity(0.0, unit="N/m", source="design", doc="Of its spring.")
    rest: Annotated[Pair, vector(2, -1e3, 1e3)] = quantity(
        (0.0, 0.0), unit="m", source="design", doc="Lengths between which its spring is relaxed."
    )
    damping: Annotated[float, real(0.0, _LARGE)] = quantity(0.0, unit="N s/m", source="design", doc="Damping.")
    range: Annotated[Pair, vector(2, -1e3, 1e3)] | None = quantity(
        None, unit="m", source="design", doc="Least and largest length, guarded as (2) guards a joint."
    )
    limit_stiffness: Annotated[float, real(0.0, 1e12)] = quantity(
        1e5, unit="N/m", source="estimate", doc="Of the stroke limiter of the range."
    )
    limit_damping: Annotated[float, real(0.0, 1e6)] = quantity(
        0.5, unit="s/m", source="estimate", doc="Of the stroke limiter of the range, as c of (2)."
    )
    friction: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="N", source="design", doc="Coulomb friction that does not depend on load."
    )
    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="Bend of its path that points and wraps do not show, where something pulls."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.joints is None) == (self.path is None):
            raise problem("", "needs joints or a path, and not both")
        if self.range is not None and self.range[0] >= self.range[1]:
            raise problem("range", "the least length must be below the largest", list(self.range))
        if self.rest[0] > self.rest[1]:
            raise problem("rest", "the first length must not be above the second", list(self.rest))
        check_path(self.path or {})
        return self


class Coupling(Description):
    """A joint that follows another: q = offset + ratio q_other + powers[0] q_other^2 + ..., held by a stiff spring."""

    joint: Name = Field(description="The joint that follows.")
    other: Name | None = Field(None, description="The joint that it follows; none: it is held.")
    ratio: Annotated[float, real(-1e3, 1e3)] = quantity(0.0, unit="1", source="design", doc="ratio.")
    offset: Annotated[float, real(-1e3, 1e3)] = quantity(0.0, unit="rad", source="design", doc="offset.")
    powers: Annotated[Numbers, reals(-1e6, 1e6)] = quantity(
        0.0, unit="1", source="design", doc="Coefficients of the square of q_other and of higher powers, at most six."
    )
    stiffness: Annotated[float, real(0.0, _LARGE)] = quantity(100.0, unit="N m/rad", source="estimate", doc="k.")
    damping: Annotated[float, real(0.0, _LARGE)] = quantity(0.1, unit="N m s/rad", source="estimate", doc="c.")

    @property
    def higher(self) -> tuple[float, ...]:
        """Coefficients of the square and of higher powers."""
        return self.powers if isinstance(self.powers, tuple) else (self.powers,)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(self.higher) > MOST_POWER - 1:
            raise problem("powers", f"must be at most {MOST_POWER - 1} numbers", list(self.higher))
        if self.other is None and (self.ratio or any(self.higher)):
            raise problem("other", "is missing: ratio and powers are those of another joint")
        return self


class Loop(Description):
    """Two points of two bodies that stay together, held by stiff springs: a pin that closes a loop."""

    body: Name = Field(description="The first body.")
    other: Name | None = Field(None, description="The second; the base if left out.")
    position: Annotated[Triple, PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point in the first body's frame."
    )
    other_position: Annotated[Triple, PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point in the second body's frame."
    )
    stiffness: Annotated[float, real(0.0, _LARGE)] = quantity(1e4, unit="N/m", source="estimate", doc="k.")
    damping: Annotated[float, real(0.0, _LARGE)] = quantity(10.0, unit="N s/m", source="estimate", doc="c.")


class TreeActuator(Description):
    """The drive of a joint or a tendon: gain u + offset + by_length l + by_speed l'; l is gear times its length.

    With ``time_constant`` its input comes late, T a' = u - a, and a takes the place of u; with ``integrates`` its input
    is a rate, a' = u. With ``integral`` the force grows with the sum of the error e, e' = u - l: by integral e.
    """

    joint: Name | None = Field(None, description="The joint that it drives.")
    tendon: Name | None = Field(None, description="The tendon that it drives.")
    gear: Annotated[float, real(-1e6, 1e6)] = quantity(1.0, unit="1", source="design", doc="gear.")
    gain: Annotated[float, real(-_LARGE, _LARGE)] = quantity(1.0, unit="N per input", source="design", doc="gain.")
    offset: Annotated[float, real(-_LARGE, _LARGE)] = quantity(0.0, unit="N", source="design", doc="b_0.")
    by_length: Annotated[float, real(-_LARGE, _LARGE)] = quantity(0.0, unit="N/m", source="design", doc="b_1.")
    by_speed: Annotated[float, real(-_LARGE, _LARGE)] = quantity(0.0, unit="N s/m", source="design", doc="b_2.")
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

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.joint is None) == (self.tendon is None):
            raise problem("", "drives a joint or a tendon, and not both")
        if (self.time_constant > 0.0) + self.integrates + (self.integral > 0.0) > 1:
            raise problem("", "has one of time_constant, integrates and integral")
        if self.state_range is not None and not self.has_state:
            raise problem("state_range", "is for time_constant, integrates or integral", list(self.state_range))
        for entry in ("input_range", "force_range", "state_range"):
            given = getattr(self, entry)
            if given is not None and given[0] > given[1]:
                raise problem(entry, "the lower limit must not be above the upper one", list(given))
        return self

    def reach(self, joint: Pair | None) -> Pair | None:
        """Return the least and the largest input: its range, or what holds a joint at the ends of its own; or None."""
        if self.input_range is not None:
            return self.input_range
        if joint is None or not self.by_length * self.gain < 0.0 or self.integrates:
            return None
        ends = [-self.by_length / self.gain * self.gear * each - self.offset / self.gain for each in joint]
        return min(ends), max(ends)

    @property
    def has_state(self) -> bool:
        """Whether its force depends on more than input and motion of the moment."""
        return self.time_constant > 0.0 or self.integrates or self.integral > 0.0

    @property
    def only_pulls(self) -> bool:
        """Whether it never pushes what it drives, whatever its input and motion."""
        bounds = [each * self.gear for each in self.force_range or ()]
        if not (self.by_length or self.by_speed or self.has_state) and self.input_range is not None:
            bounds = bounds or [(self.gain * each + self.offset) * self.gear for each in self.input_range]
        return bool(bounds) and max(bounds) <= 0.0


class Tip(Description):
    """The point of the recorded motion and of the fingertip force."""

    body: Name | None = Field(None, description="Body that carries it; the base if left out.")
    position: Annotated[Triple, PLACE] = quantity((0.0, 0.0, 0.0), unit="m", source="design", doc="In its frame.")


class Keyframe(Description):
    """A posture to start from."""

    position: dict[Name, Annotated[float, real(-1e6, 1e6)]] = quantity(
        {}, unit="rad", source="design", doc="By joint; others are at their references."
    )
    inputs: dict[Name, Annotated[float, real(-_LARGE, _LARGE)]] = quantity(
        {}, unit="1", source="design", doc="Inputs of actuators, by name, that go with it."
    )


class Tree(Description):
    """Bodies with their joints, tendons and actuators. Parents precede children; joints are in the bodies' order."""

    bodies: dict[Name, Body] = Field(min_length=1, description="Bodies by name, parents first.")
    joints: dict[Name, TreeJoint] = Field(min_length=1, description="Joints by name, those of parents first.")
    tendons: dict[Name, TreeTendon] = Field({}, description="By name.")
    couplings: dict[Name, Coupling] = Field({}, description="By name.")
    loops: dict[Name, Loop] = Field({}, description="By name.")
    actuators: dict[Name, TreeActuator] = Field({}, description="By name.")
    keyframes: dict[Name, Keyframe] = Field({}, description="By name; runs start from the first, unless told else.")
    objects: dict[Name, Object] = Field({}, description="By name: what stands or lies around it in every run.")
    tip: Tip = Tip()
    touching: tuple[tuple[Name, Name], ...] = Field((), description="Pairs of its own shapes that touch each other.")
    meshes: dict[Name, Mesh] = Field({}, description="Surfaces of solids, by name.")
    left_out: tuple[str, ...] = Field((), description="Elements of the model that were not carried over.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        known: list[str] = []
        for name, body in self.bodies.items():
            _check(f"bodies.{name}.parent", body.parent, known, "body before it")
            known.append(name)
            for key, solid in body.solids.items():
                _check(f"bodies.{name}.solids.{key}.mesh", solid.mesh, self.meshes, "mesh")
        for name, joint in self.joints.items():
            _check(f"joints.{name}.body", joint.body, self.bodies, "body")
        order = [known.index(joint.body) for joint in self.joints.values()]
        if order != sorted(order):
            raise problem("joints", "must follow the order of their bodies", list(self.joints))
        for name, tendon in self.tendons.items():
            for joint_name in tendon.joints or {}:
                _check(f"tendons.{name}.joints.{joint_name}", joint_name, self.joints, "joint")
            for point, place in (tendon.path or {}).items():
                _check(f"tendons.{name}.path.{point}.body", place.body, self.bodies, "body")
                side = place.side_point.body if place.side_point else None
                _check(f"tendons.{name}.path.{point}.side_point.body", side, self.bodies, "body")
        for name, coupling in self.couplings.items():
            _check(f"couplings.{name}.joint", coupling.joint, self.joints, "joint")
            _check(f"couplings.{name}.other", coupling.other, self.joints, "joint")
        for name, loop in self.loops.items():
            _check(f"loops.{name}.body", loop.body, self.bodies, "body")
            _check(f"loops.{name}.other", loop.other, self.bodies, "body")
        for name, keyframe in self.keyframes.items():
            for joint_name in keyframe.position:
                _check(f"keyframes.{name}.position.{joint_name}", joint_name, self.joints, "joint")
        for name, actuator in self.actuators.items():
            _check(f"actuators.{name}.joint", actuator.joint, self.joints, "joint")
            _check(f"actuators.{name}.tendon", actuator.tendon, self.tendons, "tendon")
        _check("tip.body", self.tip.body, self.bodies, "body")
        self._check_shapes()
        return self

    def _check_shapes(self) -> None:
        owner: dict[str, str] = {}
        for name, body in self.bodies.items():
            for shape in body.shapes:
                if shape in owner:
                    raise problem(f"bodies.{name}.shapes.{shape}", f"{owner[shape]} has a shape of this name")
                owner[shape] = name
        for pair in self.touching:
            for shape in pair:
                _check("touching", shape, owner, "shape")
            if owner[pair[0]] == owner[pair[1]]:
                raise problem("touching", "shapes of one body do not touch each other", list(pair))

    def crossed(self, tendon: str) -> list[tuple[float, frozenset[str]]]:
        """Return the joints that each part of a tendon crosses: those that move one piece of its path and not the next.

        The first part is what comes before its first pulley; each with the divisor of its tension.
        """
        described = self.tendons[tendon]
        if described.path is None:
            return [(1.0, frozenset(name for name, coefficient in (described.joints or {}).items() if coefficient))]
        found: list[tuple[float, set[str]]] = [(1.0, set())]
        before: set[str] | None = None
        for each in described.path.values():
            if each.kind == "pulley":
                before = None
                found.append((each.divisor, set()))
                continue
            movers = self._movers(each.body)
            found[-1][1].update(movers ^ before if before is not None else set())
            before = movers
        return [(divisor, frozenset(joints)) for divisor, joints in found]

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the tendons that rub as they are pulled by springs, ranges, actuators or what drives their joint.

        A sum of joint positions is a cord where it winds about hinges at radii; else it is a transmission.
        """
        return tuple(name for name in self.tendons if self._is_cord(name) and (self._pulled(name) or self.linked(name)))

    def _is_cord(self, name: str) -> bool:
        around = self.tendons[name].joints
        return around is None or all(
            self.joints[joint].kind == "hinge" and abs(radius) <= _LARGEST_RADIUS for joint, radius in around.items()
        )

    def _pulled(self, name: str) -> bool:
        tendon = self.tendons[name]
        driven = any(each.tendon == name for each in self.actuators.values())
        return driven or tendon.stiffness > 0.0 or tendon.range is not None

    def linked(self, name: str) -> dict[str, float]:
        """Return the shares of actuators' forces that pull a cord about the one joint that they drive, by actuator.

        A model whose actuators turn joints says nothing of the cords that do it: those about a joint that pull the same
        way share its torque. Empty for cords that have a spring or an actuator of their own.
        """
        around = {joint: radius for joint, radius in (self.tendons[name].joints or {}).items() if radius}
        driven = any(each.tendon == name for each in self.actuators.values())
        if len(around) != 1 or driven or self.tendons[name].stiffness > 0.0:
            return {}
        ((joint, radius),) = around.items()
        alike = sum(other * radius > 0.0 for other in self._radii_about(joint))
        drives = {key: each.gear for key, each in self.actuators.items() if each.joint == joint}
        return {key: -gear / (radius * alike) for key, gear in drives.items()}

    def opposed(self, name: str) -> bool:
        """Return whether another cord pulls the other way about the only joint of a cord."""
        ((joint, radius),) = ((key, each) for key, each in (self.tendons[name].joints or {}).items() if each)
        return any(other * radius < 0.0 for other in self._radii_about(joint))

    def _radii_about(self, joint: str) -> list[float]:
        """Return the radii of the cords that wind about one joint alone."""
        tables = [{key: r for key, r in (each.joints or {}).items() if r} for each in self.tendons.values()]
        return [table[joint] for table in tables if list(table) == [joint]]

    def _movers(self, body: str | None) -> set[str]:
        """Return the joints that move a body."""
        found = set[str]()
        while body is not None:
            found |= {name for name, joint in self.joints.items() if joint.body == body}
            body = self.bodies[body].parent
        return found


def _check(entry: str, name: str | None, names: Iterable[str], what: str) -> None:
    known = list(names)
    if name is not None and name not in known:
        hint = suggestion(name, known)
        raise problem(entry, f"no such {what}; there are {', '.join(known) or 'none'}{hint}", name)
