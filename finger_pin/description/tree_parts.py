"""Parts of a tree of bodies: bodies, joints, tendons, couplings, loops, actuators, postures."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from finger_pin.description.objects import ObjectState, check_moments
from finger_pin.description.placement import PathSignal
from finger_pin.description.primitives import SOLIDS, Sized, Triple
from finger_pin.description.surface import BodyShape
from finger_pin.description.validation import (
    MILLIMETRES,
    MOST_ANGLE,
    Description,
    Name,
    choice,
    direction,
    problem,
    quantity,
    real,
    vector,
)
from finger_pin.description.waypoints import BODY_POINT, Waypoint, check_path

_LARGE = 1e9
#: Red, green, blue and opacity of what solids are made of, 0 to 1.
MATERIALS: dict[str, tuple[float, float, float, float]] = {
    "shell": (0.80, 0.81, 0.82, 1.0),
    "pulley": (0.16, 0.17, 0.20, 1.0),
    "axle": (0.72, 0.56, 0.28, 1.0),
    "pad": (0.90, 0.38, 0.18, 1.0),
    "palm": (0.30, 0.34, 0.40, 1.0),
}
Pair = tuple[float, float]


class TreeSolid(Sized):
    """A solid of a body, for pictures."""

    kind_entry: ClassVar[str] = "kind"

    kind: Annotated[str, choice(*SOLIDS, "mesh")] = quantity(
        ..., unit="1", source="design", doc=f"{', '.join(SOLIDS)} or mesh."
    )
    mesh: Name | None = Field(None, description="Of a mesh, which one of the tree's.")
    position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its centre, or a mesh's origin, in the body's frame."
    )
    orientation: Annotated[tuple[float, float, float, float], direction(4)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="In the body's frame: quaternion x, y, z, w."
    )

    _material: str = PrivateAttr("shell")

    @property
    def material(self) -> str:
        """Key of `MATERIALS`."""
        return self._material

    @field_validator("radius", "length", "sides", "semi_axes", mode="before")
    @classmethod
    def _given(cls, value: object) -> object:
        # Results of earlier versions have zeros where a solid has no such size.
        return None if value in (0.0, [0.0] * 3, (0.0,) * 3) else value

    @model_validator(mode="after")
    def _which(self) -> Self:
        if self.kind == "mesh" and self.mesh is None:
            raise problem("mesh", 'is missing: kind = "mesh" needs the name of one')
        return self


class Body(Description):
    """A rigid body, placed on another one or on the base."""

    parent: Name | None = Field(None, description="The body that carries it; the base if left out.")
    position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its frame, in the parent's."
    )
    orientation: Annotated[tuple[float, float, float, float], direction(4)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="Of its frame in the parent's: quaternion x, y, z, w."
    )
    mass: Annotated[float, real(0.0, 1e4)] = quantity(0.0, unit="kg", source="design", doc="Mass of the body.")
    centre: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Mass centre in the body's frame."
    )
    inertia: Annotated[tuple[float, ...], vector(6, -1e4, 1e4)] = quantity(
        (0.0,) * 6, unit="kg m2", source="design", doc="About the mass centre, body's axes: xx, yy, zz, xy, xz, yz."
    )
    gravity_compensation: Annotated[float, real(-100.0, 100.0)] = quantity(
        0.0, unit="1", source="design", doc="Part of its weight that something holds up, at its mass centre."
    )
    solids: dict[Name, TreeSolid] = Field({}, description="Solids that are drawn of it, by name.")
    shapes: dict[Name, BodyShape] = Field({}, description="Shapes with which it touches, by name, unique in a tree.")

    @field_validator("inertia")
    @classmethod
    def _positive(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        return check_moments(value)


class TreeJoint(Description):
    """A joint of a body on its parent; a body with several joints has them one after the other."""

    body: Name = Field(description="The body that moves.")
    kind: Annotated[Literal["hinge", "slide"], choice("hinge", "slide")] = quantity(
        "hinge", unit="1", source="design", doc="It turns about its axis, or slides along it."
    )
    axis: Annotated[Triple, direction(3)] = quantity(
        (0.0, 0.0, 1.0), unit="1", source="design", doc="Unit vector in the body's frame."
    )
    anchor: Annotated[Triple, BODY_POINT] = quantity(
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
    path: PathSignal | None = Field(
        None, description="Along which it is moved, whatever that takes: growth of its position from the start on."
    )


class TreeTendon(Description):
    """A tendon: a sum of joint positions, a path through space, or both, with spring, damper and friction along it."""

    joints: dict[Name, Annotated[float, real(-1e3, 1e3)]] | None = quantity(
        None, unit="m/rad", source="design", doc="Length gained per joint position; beside a path, besides its own."
    )
    path: dict[Name, Waypoint] | None = Field(None, description="By name, in order.")
    stiffness: Annotated[float, real(0.0, _LARGE)] = quantity(0.0, unit="N/m", source="design", doc="Of its spring.")
    rest: Annotated[Pair, vector(2, -1e3, 1e3)] = quantity(
        (0.0, 0.0), unit="m", source="design", doc="Lengths between which its spring is relaxed."
    )
    slack: Annotated[float, real(-1.0, 1.0, hint=MILLIMETRES)] | None = quantity(
        None,
        unit="m",
        source="design",
        doc="In place of rest: a cord, which only pulls, this much longer than its way at the joints' references.",
    )
    damping: Annotated[float, real(0.0, _LARGE)] = quantity(
        0.0, unit="N s/m", source="design", doc="Force per speed at which its length grows."
    )
    range: Annotated[Pair, vector(2, -1e3, 1e3)] | None = quantity(
        None, unit="m", source="design", doc="Least and largest length, guarded as (2) guards a joint."
    )
    limit_stiffness: Annotated[float, real(0.0, 1e12)] = quantity(
        1e5, unit="N/m", source="estimate", doc="Of the stroke limiter of the range."
    )
    limit_damping: Annotated[float, real(0.0, 1e6)] = quantity(
        0.5, unit="s/m", source="estimate", doc="Of the stroke limiter of the range, as c of (2)."
    )
    limit_viscous: Annotated[float, real(0.0, 1e12)] = quantity(
        0.0, unit="N s/m", source="chosen", doc="Of a damper beside it, while it pushes."
    )
    friction: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="N", source="design", doc="Coulomb friction that does not depend on load."
    )
    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="Bend of its path that points and wraps do not show, where something pulls."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.joints is None and self.path is None:
            raise problem("", "needs joints or a path")
        if self.range is not None and self.range[0] >= self.range[1]:
            raise problem("range", "the least length must be below the largest", list(self.range))
        if self.rest[0] > self.rest[1]:
            raise problem("rest", "the first length must not be above the second", list(self.rest))
        if self.slack is not None and self.rest != (0.0, 0.0):
            raise problem("slack", "has no place beside rest", self.slack)
        if self.slack is not None and "stiffness" not in self.model_fields_set:
            raise problem("slack", "has no effect without stiffness; leave it out", self.slack)
        check_path(self.path or {})
        return self

    @property
    def limiter(self) -> tuple[float, ...]:
        """Numbers of the stroke limiter of its range."""
        return (*(self.range or ()), self.limit_stiffness, self.limit_damping, self.limit_viscous)

    @property
    def wound(self) -> dict[str, float]:
        """Radii about the joints that it winds about, m, by joint; none with a path, which shows where it bends."""
        return {joint: gain for joint, gain in (self.joints or {}).items() if gain and self.path is None}


class Loop(Description):
    """Two points of two bodies that stay together, held by stiff springs: a pin that closes a loop."""

    body: Name = Field(description="The first body.")
    other: Name | None = Field(None, description="The second; the base if left out.")
    position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point in the first body's frame."
    )
    other_position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point in the second body's frame."
    )
    stiffness: Annotated[float, real(0.0, _LARGE)] = quantity(
        1e4, unit="N/m", source="estimate", doc="k, of the springs that hold the points together."
    )
    damping: Annotated[float, real(0.0, _LARGE)] = quantity(
        10.0, unit="N s/m", source="estimate", doc="c, damping of these springs."
    )


class Tip(Description):
    """A point whose motion is recorded, and at which a fingertip force acts."""

    body: Name | None = Field(None, description="Body that carries it; the base if left out.")
    position: Annotated[Triple, BODY_POINT] = quantity((0.0, 0.0, 0.0), unit="m", source="design", doc="In its frame.")


class Keyframe(Description):
    """A posture to start from."""

    position: dict[Name, Annotated[float, real(-1e6, 1e6)]] = quantity(
        {}, unit="rad", source="design", doc="By joint; others are at their references."
    )
    velocity: dict[Name, Annotated[float, real(-1e4, 1e4)]] = quantity(
        {}, unit="rad/s", source="design", doc="By joint; others are at rest."
    )
    inputs: dict[Name, Annotated[float, real(-_LARGE, _LARGE)]] = quantity(
        {}, unit="1", source="design", doc="Inputs of actuators, by name, that go with it."
    )
    objects: dict[Name, ObjectState] = Field({}, description="Other states of the tree's objects, whole, by name.")
