"""The parts of a finger as data: links, joints, springs, tendons and their crossings, limiters. SI units throughout.

Every description is frozen and validated; nothing here computes physics.
"""

from __future__ import annotations

import math
import sys
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from finger_pin.description.caching import memoised
from finger_pin.description.validation import (
    IN_RADIANS,
    MILLIMETRES,
    MOST_ANGLE,
    Description,
    Name,
    Numbers,
    choice,
    expand,
    problem,
    quantity,
    real,
    reals,
    vector,
)
from finger_pin.typing import Array

# Osmium, kg/m3 (CRC Handbook of Chemistry and Physics); least mass, kg, that is asked about: in grams links have more.
_LARGEST_DENSITY, _LEAST_DENSITY = 22590.0, 1.0
_MOST_TENSION = 1e6


def check_density(mass: float, inertia: float) -> None:
    """Refuse a mass that is too large for its moments of inertia: denser than any material.

    Of all bodies that are nowhere denser than a material the ball of it has the least sum of moments of inertia.

    Args:
        mass: kg.
        inertia: Sum of the three principal moments about the mass centre, kg m2.
    """
    if inertia < sys.float_info.min:
        raise problem("mass", "is too small: its moments of inertia are below 2.2e-308 kg m2", mass)
    radius = (3.0 * mass / (4.0 * math.pi * _LARGEST_DENSITY)) ** (1.0 / 3.0)
    if mass >= _LEAST_DENSITY and inertia < 3.0 * 0.4 * mass * radius**2:
        raise problem("mass", "makes it denser than osmium, 22590 kg/m3: masses are in kg (is it in grams?)", mass)


class Link(Description):
    """A link that runs along its x axis, from its own joint to the next one (Table I)."""

    length: Annotated[float, real(0.0, 2.0, above=True, hint=MILLIMETRES)] = quantity(
        ..., unit="m", source="Table I", doc="a, distance from this joint's axis to the next along x."
    )
    twist: Annotated[float, real(-math.pi, math.pi, hint=IN_RADIANS)] = quantity(
        0.0, unit="rad", source="Table I", doc="alpha, rotation about x from this joint's axis to the next."
    )
    offset: Annotated[float, real(-2.0, 2.0, hint=MILLIMETRES)] = quantity(
        0.0, unit="m", source="Table I", doc="d, distance along this joint's axis at which the link runs along x."
    )
    section: Annotated[Literal["round", "square"], choice("round", "square")] = quantity(
        "round", unit="1", source="design", doc="Cross-section: a cylinder or a square box."
    )
    width: Annotated[float, real(0.0, 1.0, above=True, hint=MILLIMETRES)] = quantity(
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
        solid = axial + 2.0 * lateral
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        check_density(self.mass, max(solid, self.inertia[0] + 2.0 * self.inertia[1]))
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

    stiffness: Annotated[float, real(0.0, 1e7)] = quantity(
        ..., unit="N m/rad", source="design", doc="k, torque of the spring per angle from where it is relaxed."
    )
    rest: Annotated[float, real(-MOST_ANGLE, MOST_ANGLE, hint=IN_RADIANS)] = quantity(
        0.0, unit="rad", source="design", doc="theta_0, where it is relaxed; it may lie outside the range."
    )
    damping: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="N m s/rad", source="design", doc="c, viscous torque of the spring per joint velocity."
    )
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


def _one_if_true(value: object) -> object:
    return float(value) if isinstance(value, bool) else value


class Crossing(Description):
    """The crossing of a tendon over a joint: winding radius (3) and the bending of its path (15)."""

    radius: Annotated[float, real(-0.5, 0.5, hint=MILLIMETRES)] = quantity(
        ..., unit="m", source="(3)", doc="r, signed: positive where tension turns the joint positively."
    )
    bends: Annotated[float, real(0.0, 10.0), BeforeValidator(_one_if_true)] = quantity(
        0.0, unit="1", source="(15)", doc="Turn of the path, which rubs, over the joint's rotation; true for 1."
    )
    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="Curvature of the path here at theta = 0, beside the tendon's."
    )


class Winch(Description):
    """An ideal winch: it winds the cord in by w, whatever that takes, T = max(0, K (w - l) - D l')."""

    stiffness: Annotated[float, real(0.0, 1e9, above=True)] = quantity(
        2e4, unit="N/m", source="a braid of E A = 6000 N over 0.3 m", doc="K, of the cord from the winch to the finger."
    )
    damping: Annotated[float, real(0.0, 1e6)] = quantity(
        10.0, unit="N s/m", source="estimate: that of elastic tendons", doc="D, on the speed of the cord in its canal."
    )
    pieces: int = Field(0, ge=0, le=64, strict=True, description="Pieces of it that stretch in its sheath; 0 for none.")


class Tendon(Description):
    """A tendon: the joints that it crosses, in order from its actuator or proximal anchor."""

    kind: Annotated[Literal["actuated", "passive"], choice("actuated", "passive")] = quantity(
        "actuated", unit="1", source="Sec. III", doc="Pulled by an actuator, or anchored at both ends."
    )
    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="phi_off, curvature of the path at theta = 0, beside its crossings'."
    )
    crossings: dict[Name, Crossing] = Field({}, description="By joint, in order along the tendon.")
    along: Name | None = Field(None, description="In place of crossings: the tendon of the tree whose path it takes.")
    maximum_tension: Annotated[float, real(0.0, _MOST_TENSION, above=True)] | None = quantity(
        None, unit="N", source="design", doc="The most that its ideal source or winch pulls with; no end if left out."
    )
    winch: Winch | None = Field(None, description="An ideal winch, which `controller.tendon_winding` turns.")
    mass_after: int | None = Field(
        None,
        ge=0,
        strict=True,
        description="Passive only: crossings between the proximal anchor and the lumped mass; default half of them.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name in ("maximum_tension", "winch"):
            if self.kind == "passive" and getattr(self, name) is not None:
                raise problem(name, "is for actuated tendons only", self.maximum_tension)
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
        8.8e-6, unit="kg", source="estimate", doc="m_5, lumped mass of the tendon between its halves."
    )
    hysteresis: Annotated[Numbers, reals(0.0, 0.9)] = quantity(
        0.0, unit="1", source="the paper has none", doc="h, part of its tension that a half holds against its stretch."
    )
    pretension: Annotated[Numbers, reals(0.0, _MOST_TENSION)] = quantity(
        0.0, unit="N", source="design", doc="T_0, tension with all joints at zero, in place of slack = -T_0 / K_t."
    )
    slack: Annotated[Numbers, reals(-1.0, 1.0, hint=MILLIMETRES)] = quantity(
        0.0, unit="m", source="design", doc="l_0, its relaxed length beyond its way with all joints at zero."
    )

    @model_validator(mode="after")
    def _slack_once(self) -> Self:
        if self.pretension != 0.0 and self.slack != 0.0:
            raise problem("pretension", "has no place beside slack", self.pretension)
        return self


class StrokeLimiterSettings(Description):
    """Hunt-Crossley stroke limiter (2): one number for all, or one per joint."""

    stiffness: Annotated[Numbers, reals(0.0, 1e7)] = quantity(
        50.0, unit="N m/rad", source="estimate", doc="k of tau^r = k d (1 + c d'), torque per depth d beyond the range."
    )
    damping: Annotated[Numbers, reals(0.0, 1e5)] = quantity(
        0.5, unit="s/rad", source="estimate", doc="c of tau^r = k d (1 + c d'), which takes energy from an impact."
    )
    viscous: Annotated[Numbers, reals(0.0, 1e7)] = quantity(
        0.0, unit="N m s/rad", source="chosen", doc="b of a damper beside it, k d (1 + c d') + b d', while that pushes."
    )


class PerItem(dict[str, dict[str, Array]]):
    """Tables of one number for all or one per item, as arrays of one per item, by table and entry.

    They follow from the description that has them, so that they make no two differ.
    """

    def __eq__(self, other: object) -> bool:
        """Return whether another is one, too."""
        return isinstance(other, PerItem)

    __hash__ = None


def _are_names(value: object) -> bool:
    return isinstance(value, tuple) and any(isinstance(item, str) for item in value)


# Found again where they are in several fingers: beside another number, at another scale, or on a hand.
@memoised(lambda table, size: (table, size), most=256)
def per_item(table: Description, size: int) -> dict[str, Array]:
    """Return the numbers of a table by entry, read-only, shape (size,); NaN where a hand's finger has none."""
    numbers = {
        entry: expand(value, size)
        for entry, value in table
        if isinstance(value, int | float | tuple) and not _are_names(value)
    }
    for array in numbers.values():
        array.flags.writeable = False
    return numbers
