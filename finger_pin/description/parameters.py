"""The finger as data: links, joints, tendon routing, friction, limiters. SI units throughout.

Every description is frozen and validated; nothing here computes physics.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from finger_pin.description.actuators import Actuator, check_actuators
from finger_pin.description.effects import OF_FINGER, refuse_idle
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.tree import Tree
from finger_pin.description.validation import (
    IN_RADIANS,
    MOST_ANGLE,
    Description,
    Name,
    Numbers,
    check_size,
    choice,
    problem,
    quantity,
    real,
    reals,
    vector,
)

if TYPE_CHECKING:
    from finger_pin.description.hand import HandSettings

_MILLIMETRES = " m (is it in millimetres?)"
_MOST_TENSION = 1e6


class Link(Description):
    """A link that runs along its x axis, from its own joint to the next one (Table I)."""

    length: Annotated[float, real(0.0, 2.0, above=True, hint=_MILLIMETRES)] = quantity(
        ..., unit="m", source="Table I", doc="a, distance from this joint's axis to the next along x."
    )
    twist: Annotated[float, real(-math.pi, math.pi, hint=IN_RADIANS)] = quantity(
        0.0, unit="rad", source="Table I", doc="alpha, rotation about x from this joint's axis to the next."
    )
    offset: Annotated[float, real(-2.0, 2.0, hint=_MILLIMETRES)] = quantity(
        0.0, unit="m", source="Table I", doc="d, distance along this joint's axis at which the link runs along x."
    )
    section: Annotated[Literal["round", "square"], choice("round", "square")] = quantity(
        "round", unit="1", source="design", doc="Cross-section: a cylinder or a square box."
    )
    width: Annotated[float, real(0.0, 1.0, above=True, hint=_MILLIMETRES)] = quantity(
        ..., unit="m", source="design", doc="Diameter, or side of the square."
    )
    mass: Annotated[float, real(0.0, 100.0, above=True, hint=" kg (is it in grams?)")] = quantity(
        ..., unit="kg", source="design", doc="Mass of the link."
    )
    centre_of_mass: Annotated[float, real(-2.0, 2.0)] | None = quantity(
        None, unit="m", source="half length", doc="Mass centre along x from the joint axis."
    )
    transverse_inertia: Annotated[float, real(0.0, 100.0, above=True)] | None = quantity(
        None, unit="kg m2", source="solid of this section", doc="About the mass centre, across x."
    )
    axial_inertia: Annotated[float, real(0.0, 100.0, above=True)] | None = quantity(
        None, unit="kg m2", source="solid of this section", doc="About the x axis."
    )

    @model_validator(mode="after")
    def _fill(self) -> Self:
        square = self.section == "square"
        axial = self.mass * self.width**2 / (6.0 if square else 8.0)
        lateral = self.mass * (self.width**2 / (12.0 if square else 16.0) + self.length**2 / 12.0)
        defaults = {"centre_of_mass": self.length / 2, "transverse_inertia": lateral, "axial_inertia": axial}
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        if self.inertia[0] > 2.0 * self.inertia[1]:
            raise problem(
                "axial_inertia", "must be at most twice the transverse inertia (no body has more)", self.inertia[0]
            )
        return self

    @property
    def inertia(self) -> tuple[float, float]:
        """Axial and transverse inertia about the mass centre, kg m2."""
        assert self.axial_inertia is not None and self.transverse_inertia is not None
        return self.axial_inertia, self.transverse_inertia

    @property
    def mass_centre(self) -> float:
        """Mass centre along x, m."""
        assert self.centre_of_mass is not None
        return self.centre_of_mass


class Spring(Description):
    """A torsion spring between a joint's two sides."""

    stiffness: Annotated[float, real(0.0, 1e7)] = quantity(..., unit="N m/rad", source="design", doc="k.")
    rest: Annotated[float, real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)] = quantity(
        0.0, unit="rad", source="design", doc="theta_0, where it is relaxed; it may lie outside the range."
    )
    damping: Annotated[float, real(0.0, 1e6)] = quantity(0.0, unit="N m s/rad", source="design", doc="c.")
    hysteresis: Annotated[float, real(0.0, 0.9)] = quantity(
        0.0, unit="1", source="the paper has none", doc="h, part of its torque that it holds against its motion."
    )


class Joint(Description):
    """A joint, its range (2) and, for a finger that is built here, the link that it carries."""

    range: Annotated[tuple[float, float], vector(2, -MOST_ANGLE, MOST_ANGLE, IN_RADIANS)] = quantity(
        ..., unit="rad", source="(2)", doc="Lower and upper limit that the stroke limiter guards."
    )
    limited: bool = Field(
        True,
        strict=True,
        description="Whether the stroke limiter guards the range; else only searches and pictures go through it.",
    )
    spring: Spring | None = Field(None, description="A return spring; none in the paper.")
    link: Link | None = Field(None, description="The link that this joint moves; none on a foreign model.")

    @field_validator("range")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise problem("", "the lower limit must be below the upper one", list(value))
        return value


class Crossing(Description):
    """The crossing of a tendon over a joint: winding radius (3) and the bending of its path (15)."""

    radius: Annotated[float, real(-0.5, 0.5, hint=_MILLIMETRES)] = quantity(
        ..., unit="m", source="(3)", doc="r, signed: positive where tension turns the joint positively."
    )
    bends: bool = Field(False, strict=True, description="Whether the joint's rotation bends the path (15), which rubs.")


class Tendon(Description):
    """A tendon: the joints that it crosses, in order from its actuator or proximal anchor."""

    kind: Annotated[Literal["actuated", "passive"], choice("actuated", "passive")] = quantity(
        "actuated", unit="1", source="Sec. III", doc="Pulled by an actuator, or anchored at both ends."
    )
    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="phi_off, curvature of the path at theta = 0."
    )
    crossings: dict[Name, Crossing] = Field({}, description="By joint, in order along the tendon.")
    along: Name | None = Field(None, description="In place of crossings: the tendon of the tree whose path it takes.")
    maximum_tension: Annotated[float, real(0.0, _MOST_TENSION, above=True)] | None = quantity(
        None, unit="N", source="design", doc="The most that its ideal source pulls with; without end if left out."
    )
    mass_after: int | None = Field(
        None,
        ge=0,
        strict=True,
        description="Passive only: crossings between the proximal anchor and the lumped mass; default half of them.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.kind == "passive" and self.maximum_tension is not None:
            raise problem("maximum_tension", "is for actuated tendons only", self.maximum_tension)
        if self.kind == "actuated" and self.mass_after is not None:
            raise problem("mass_after", "is for passive tendons only", self.mass_after)
        if self.mass_after is not None and self.mass_after > len(self.crossings):
            raise problem("mass_after", f"must be at most the {len(self.crossings)} crossings", self.mass_after)
        if self.along is not None:
            if self.crossings:
                raise problem("along", "has no place beside crossings", self.along)
            if self.kind == "passive":
                raise problem("along", "is for actuated tendons only", self.along)
            return self
        if not self.crossings:
            raise problem("crossings", "must have at least one entry")
        if all(crossing.radius == 0.0 for crossing in self.crossings.values()):
            raise problem("crossings", "at least one radius must differ from zero")
        return self

    @property
    def proximal_crossings(self) -> int:
        """Number of crossings between the proximal anchor and the lumped mass of a passive tendon."""
        return len(self.crossings) // 2 if self.mass_after is None else self.mass_after


class PassiveTendon(Description):
    """Passive tendons (12), (13): one number for all, or one per passive tendon."""

    stiffness: Annotated[Numbers, reals(0.0, 1e10, above=True)] = quantity(
        5e4, unit="N/m", source="estimate", doc="K_t, stiffness of the whole tendon; each half has 2 K_t."
    )
    mass: Annotated[Numbers, reals(0.0, 1.0, above=True, hint=" kg (is it in grams?)")] = quantity(
        8.8e-6, unit="kg", source="estimate", doc="m_5, lumped mass."
    )
    hysteresis: Annotated[Numbers, reals(0.0, 0.9)] = quantity(
        0.0, unit="1", source="the paper has none", doc="h, part of its tension that a half holds against its stretch."
    )


class StrokeLimiterSettings(Description):
    """Hunt-Crossley stroke limiter (2): one number for all, or one per joint."""

    stiffness: Annotated[Numbers, reals(0.0, 1e7)] = quantity(50.0, unit="N m/rad", source="estimate", doc="k.")
    damping: Annotated[Numbers, reals(0.0, 1e5)] = quantity(0.5, unit="s/rad", source="estimate", doc="c.")


class FingerDescription(Description):
    """A finger of links, all fingers of a hand together, or a tree of bodies. Actuated tendons come first.

    Lists of numbers follow the order of the joints, of all tendons, or of the passive tendons.
    """

    file_keys = ("base",)

    def __repr__(self) -> str:
        """Return its name and size in a line; `to_toml` writes all of it."""
        return f"<{type(self).__name__} {self.name}: {len(self.joints)} joints, {len(self.tendons)} tendons>"

    __str__ = __repr__

    name: Name = Field(description="Name of the finger, and of the robot in the URDF.")
    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    gravity: Annotated[tuple[float, float, float], vector(3, -1e3, 1e3)] = quantity(
        (0.0, 0.0, -9.81), unit="m/s2", source="flexion lifts the finger", doc="Base frame; in a hand `hand.gravity`."
    )
    joints: dict[Name, Joint] = Field(min_length=1, description="Joints by name, from the base to the tip.")
    tendons: dict[Name, Tendon] = Field(description="Tendons by name; at least one, unless there is a tree.")
    tendon_friction: TendonFrictionSettings = TendonFrictionSettings()
    joint_friction: JointFrictionSettings = JointFrictionSettings()
    passive_tendon: PassiveTendon = PassiveTendon()
    stroke_limiter: StrokeLimiterSettings = StrokeLimiterSettings()
    actuators: dict[Name, Actuator] = Field({}, description="By name; a tendon without one has an ideal source.")
    touches_itself: bool = Field(
        False,
        strict=True,
        description="Whether links that are not neighbours touch each other, where there are contacts.",
    )
    _hand: Any = PrivateAttr(None)
    tree: Tree | None = Field(None, description="Bodies in place of links, with joints, tendons and actuators.")

    @field_validator("tendons")
    @classmethod
    def _actuated_first(cls, value: dict[str, Tendon]) -> dict[str, Tendon]:
        return dict(sorted(value.items(), key=lambda item: item[1].kind))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        joints, tendons = tuple(self.joints), tuple(self.tendons)
        if not self.tendons and self.tree is None:
            raise problem("tendons", "must have at least one entry")
        if self.tree is not None and tuple(self.tree.joints) != joints:
            raise problem("tree.joints", f"must be those of the finger, in order: {', '.join(joints)}")
        for name, tendon in self.tendons.items():
            paths = tuple(self.tree.tendons) if self.tree else ()
            if tendon.along is not None and tendon.along not in paths:
                allowed = f"no such tendon of the tree; there are {', '.join(paths) or 'none'}"
                raise problem(f"tendons.{name}.along", allowed, tendon.along)
            for joint in tendon.crossings:
                if joint not in self.joints:
                    allowed = f"no such joint; the joints are {', '.join(joints)}"
                    raise problem(f"tendons.{name}.crossings.{joint}", allowed)
        driven = (*self.actuated_names, *self.tree.actuators) if self.tree is not None else ()
        for key, keyframe in (self.tree.keyframes if self.tree is not None else {}).items():
            for name in keyframe.inputs:
                if name not in driven:
                    allowed = f"no such actuator or tendon; there are {', '.join(driven)}"
                    raise problem(f"tree.keyframes.{key}.inputs.{name}", allowed)
        check_actuators(self.actuators, self.actuated_names, self.passive_names)
        for key, each in self.actuators.items():
            for name in each.tendons:
                if self.tendons[name].maximum_tension is not None:
                    allowed = f"is for ideal sources: actuators.{key} pulls it"
                    raise problem(f"tendons.{name}.maximum_tension", allowed, self.tendons[name].maximum_tension)
        for group, names, what in (
            ("tendon_friction", (*tendons, *self.canals), "tendon"),
            ("joint_friction", joints, "joint"),
            ("passive_tendon", self.passive_names, "passive tendon"),
            ("stroke_limiter", joints, "joint"),
        ):
            for field, value in getattr(self, group):
                check_size(value, names, f"{group}.{field}", what)
        refuse_idle(self, OF_FINGER)
        return self

    @property
    def outline(self) -> str:
        """Name, joints and tendons, in a line."""
        if self.hand is not None:
            sizes = f"{len(self.joints)} joints, {len(self.tendons)} tendons"
            return f"{self.name}: fingers {', '.join(self.hand.fingers)}; {sizes}"
        if self.tree is not None:
            tree, pulled = self.tree, len(self.tendons)
            sizes = f"{len(tree.joints)} joints, {len(tree.tendons)} tendons ({pulled} pulled)"
            return f"{self.name}: a tree of {sizes}, {len(tree.actuators)} actuators"
        tendons = ", ".join(f"{name} ({tendon.kind})" for name, tendon in self.tendons.items())
        return f"{self.name}: joints {', '.join(self.joints)}; tendons {tendons}"

    @property
    def hand(self) -> HandSettings | None:
        """The palm and the fingers on it, if it is a hand of such."""
        hand: HandSettings | None = self._hand
        return hand

    @property
    def canals(self) -> tuple[str, ...]:
        """Names of the tree's tendons that something else than ideal sources pulls: they rub as all tendons do."""
        return self.tree.rubbing if self.tree is not None else ()

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Names of the passive tendons."""
        return tuple(name for name, tendon in self.tendons.items() if tendon.kind == "passive")

    @property
    def actuated_names(self) -> tuple[str, ...]:
        """Names of the actuated tendons."""
        return tuple(name for name, tendon in self.tendons.items() if tendon.kind == "actuated")
