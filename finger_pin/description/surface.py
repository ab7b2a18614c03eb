"""Surfaces with which bodies touch, and the shapes with which those of a tree do."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from finger_pin.description.primitives import KINDS, SOLIDS, Sized
from finger_pin.description.validation import (
    MILLIMETRES,
    Description,
    choice,
    direction,
    problem,
    quantity,
    real,
    vector,
)


class Surface(Description):
    """Contact of a surface: Hunt-Crossley along the normal, bristles with Coulomb friction along the tangents.

    Where two objects meet that both have one, the smaller of their numbers count.
    """

    stiffness: Annotated[float, real(0.0, 1e12, above=True)] = quantity(
        1e4,
        unit="N/m^exponent",
        source="a soft fingertip",
        doc="k of f_n = k d^p (1 + c d'), stiffness of the contact.",
    )
    damping: Annotated[float, real(0.0, 1e4)] = quantity(
        2.0, unit="s/m", source="estimate", doc="c; slow impacts come back with 1 - 2 c v / 3 of their speed v."
    )
    exponent: Annotated[float, real(1.0, 1.5)] = quantity(
        1.0, unit="1", source="Hunt and Crossley 1975", doc="p: 1, or 1.5 for a sphere of linear material (Hertz)."
    )
    friction: Annotated[float, real(0.0, 10.0)] = quantity(
        0.7, unit="1", source="rubber on plastic", doc="mu_k, the coefficient of sliding friction."
    )
    torsion: Annotated[float, real(0.0, 1.0)] = quantity(
        0.0,
        unit="m",
        source="no resistance; of a pressed pad of radius a 0.59 mu_k a (Hertz)",
        doc="Friction moment about the normal per normal force; with slip the ellipsoid of both.",
    )
    stiction_ratio: Annotated[float, real(1.0, 100.0)] = quantity(
        1.0, unit="1", source="chosen", doc="mu_s / mu_k: sliding begins at mu_s f_n."
    )
    tangential_stiffness: Annotated[float, real(0.0, 1e12, above=True)] = quantity(
        7e3, unit="N/m", source="two thirds of k (Mindlin 1949, incompressible)", doc="k_t of the bristles."
    )
    lag: Annotated[float, real(0.0, 1.0, above=True)] = quantity(
        1e-3, unit="s", source="estimate", doc="T; k_t T is the bristles' damping, T how fast they forget."
    )
    stribeck_velocity: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        0.01, unit="m/s", source="estimate", doc="omega, at which mu has fallen by 63 % from mu_s to mu_k."
    )
    floor: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        1e-4, unit="N", source="keeps slopes finite at f_n = 0", doc="Friction below which sticking is gradual."
    )

    @model_validator(mode="after")
    def _turns_with_friction(self) -> Self:
        if self.torsion and not self.friction:
            raise problem("torsion", "must be 0 where friction is 0: both make up one limit", self.torsion)
        return self


class Shaped(Sized):
    """A convex solid, or a half-space, with a surface."""

    shape: Annotated[str, choice(*KINDS)] = quantity(..., unit="1", source="design", doc=f"One of {', '.join(KINDS)}.")
    surface: Surface | None = Field(None, description="Its contact; by default that of the other surface.")


class BodyShape(Shaped):
    """A shape with which a body of a tree touches.

    Attributes:
        continues: Whether it is a capsule whose near end lies in another one, which stands for it on a plane.
    """

    continues: ClassVar[bool] = False

    shape: Annotated[str, choice(*SOLIDS)] = quantity(
        ..., unit="1", source="design", doc=f"One of {', '.join(SOLIDS)}."
    )
    position: Annotated[tuple[float, float, float], vector(3, -100.0, 100.0, MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its centre, in the body's frame."
    )
    orientation: Annotated[tuple[float, float, float, float], direction(4)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="In the body's frame: quaternion x, y, z, w."
    )
