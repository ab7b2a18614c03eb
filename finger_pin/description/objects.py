"""Objects that a finger may touch, fixed, free or moved, and the surfaces with which they touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, field_serializer, field_validator, model_validator

from finger_pin.description.placement import PathSignal
from finger_pin.description.primitives import KINDS
from finger_pin.description.signals import ForceSignal, check_axes
from finger_pin.description.surface import Shaped
from finger_pin.description.tables import dump_set_fields
from finger_pin.description.validation import (
    MILLIMETRES,
    Description,
    FullName,
    Name,
    choice,
    problem,
    quantity,
    real,
    vector,
)
from finger_pin.typing import Array

#: The coordinates of an object's path.
PATH = ("x", "y", "z")


def inertia_matrix(moments: Sequence[float]) -> Array:
    """Return the matrix of moments xx, yy, zz, xy, xz, yz, shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def check_moments(value: tuple[float, ...]) -> tuple[float, ...]:
    """Return moments of inertia xx, yy, zz, xy, xz, yz; refuse negative principal ones."""
    principal = np.linalg.eigvalsh(inertia_matrix(value))
    if principal[0] < -1e-12 * principal[-1]:
        raise problem("", "must have principal moments that are not negative", list(value))
    return value


class ObjectState(Description):
    """Pose of an object, and of one with a mass its speed, at the start."""

    position: Annotated[tuple[float, float, float], vector(3, -100.0, 100.0, MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its origin, base frame; of a free object at t = 0."
    )
    orientation: Annotated[tuple[float, float, float, float], vector(4, -1e3, 1e3)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="Quaternion x, y, z, w of any length; likewise."
    )
    velocity: Annotated[tuple[float, float, float], vector(3, -1e3, 1e3)] = quantity(
        (0.0, 0.0, 0.0), unit="m/s", source="chosen", doc="Of a free object at t = 0, base frame."
    )
    angular_velocity: Annotated[tuple[float, float, float], vector(3, -1e4, 1e4)] = quantity(
        (0.0, 0.0, 0.0), unit="rad/s", source="chosen", doc="Of a free object at t = 0, its own frame."
    )

    @model_validator(mode="after")
    def _turned(self) -> Self:
        if math.hypot(*self.orientation) < 1e-6:
            raise problem("orientation", "must be a quaternion x, y, z, w that is not zero", self.orientation)
        return self

    def check_at_rest(self, entry: str = "") -> None:
        """Refuse speeds, below an entry."""
        for name in ("velocity", "angular_velocity"):
            if any(getattr(self, name)):
                allowed = "is for objects with a mass, which are free to move"
                raise problem(entry + name, allowed, getattr(self, name))


class Object(ObjectState, Shaped):
    """A rigid body of the environment: fixed, free if it has a mass, or moved along a path."""

    frame: Annotated[Literal["palm", "world"], choice("palm", "world")] = quantity(
        "palm", unit="1", source="chosen", doc="Where a fixed object stands, also while the palm moves: palm or world."
    )
    mass: Annotated[float, real(0.0, 100.0, above=True, hint=" kg (is it in grams?)")] | None = quantity(
        None, unit="kg", source="design", doc="Of a solid that is free to move; fixed without one."
    )
    centre: Annotated[tuple[float, float, float], vector(3, -2.0, 2.0, MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Mass centre of a free object, in its frame."
    )
    inertia: Annotated[tuple[float, ...], vector(6, -1e4, 1e4)] | None = quantity(
        None,
        unit="kg m2",
        source="design",
        doc="About the mass centre, along the object's axes: xx, yy, zz, xy, xz, yz; of even density without.",
    )
    damping: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="N s/m", source="fit", doc="d of a free object: -d v on its origin, whose velocity is v, base frame."
    )
    angular_damping: Annotated[float, real(0.0, 1e6)] = quantity(
        0.0, unit="N m s/rad", source="fit", doc="Torque against its turning over the angular velocity, likewise."
    )
    path: dict[Name, PathSignal] | None = Field(
        None, description="Path along which it is moved: growth of x, y and z of its position over time, base frame."
    )
    apart: tuple[FullName, ...] = Field((), description="Links, shapes and other objects that it never touches.")

    @field_validator("shape", mode="before")
    @classmethod
    def _no_mesh(cls, value: object) -> object:
        if value == "mesh":
            raise problem("", f"meshes are not supported; put the body together of {', '.join(KINDS)}", value)
        return value

    @field_validator("inertia")
    @classmethod
    def _positive(cls, value: tuple[float, ...] | None) -> tuple[float, ...] | None:
        return None if value is None else check_moments(value)

    @field_validator("path")
    @classmethod
    def _along(cls, value: dict[str, PathSignal] | None) -> dict[str, PathSignal] | None:
        for name in value or {}:
            if name not in PATH:
                raise problem(name, f"no such coordinate; there are {', '.join(PATH)}")
        return value

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.shape == "half_space" and self.mass is not None:
            raise problem("mass", "a half-space is fixed; leave it out", self.mass)
        if self.frame == "world" and (self.mass is not None or self.path):
            raise problem("frame", "is for fixed objects: leave out mass and path", self.frame)
        if self.path is not None and self.mass is not None:
            raise problem("path", "is for objects without a mass: one with a mass is free, and goes where it is pushed")
        if self.mass is None:
            self.check_at_rest()
            for entry in ("centre", "inertia", "damping", "angular_damping"):
                if np.any(getattr(self, entry) or 0.0):
                    raise problem(entry, "is for objects with a mass", getattr(self, entry))
        return self

    @property
    def moves(self) -> bool:
        """Whether it is free or moved."""
        return self.mass is not None or bool(self.path)

    @property
    def quaternion(self) -> Array:
        """The orientation as a unit quaternion, shape (4,)."""
        quaternion = np.array(self.orientation)
        return np.asarray(quaternion / np.linalg.norm(quaternion))

    @property
    def pose(self) -> Array:
        """The pose at the start: x, y, z, m, and the quaternion, shape (7,)."""
        return np.append(self.position, self.quaternion)

    @property
    def moments(self) -> tuple[float, ...]:
        """Inertia about the mass centre as `inertia` has it, kg m2; zero for a fixed one."""
        return self.inertia or (*self.even_moments, 0.0, 0.0, 0.0)

    @property
    def even_moments(self) -> tuple[float, float, float]:
        """Moments of inertia of a solid of even density about x, y and z of its frame, kg m2; zero for a fixed one."""
        x, y, z = KINDS[self.shape].moments(self.sizes)
        mass = self.mass or 0.0
        return mass * x, mass * y, mass * z


class EnvironmentSettings(Description):
    """Forces and objects outside the finger; of a hand for every finger, unless ``fingers`` says otherwise.

    In a file, ``fingertip_force_file`` names a CSV file: its columns are ``time`` and some of ``x``, ``y``, ``z``, and
    become samples of ``fingertip_force_signal``.
    """

    file_keys = ("fingertip_force_file",)

    fingertip_force: Annotated[tuple[float, float, float], vector(3, -1e6, 1e6)] = quantity(
        (0.0, 0.0, 0.0), unit="N", source="(6)", doc="F, constant, base frame."
    )
    fingertip_force_signal: Annotated[dict[Name, ForceSignal] | None, AfterValidator(check_axes)] = Field(
        None, description="Varying part of F, added to the constant, by axis x, y, z of the base frame."
    )
    fingers: dict[Name, EnvironmentSettings] | None = Field(None, description="By finger, entries that differ there.")

    _sparse = field_serializer("fingers")(dump_set_fields)

    objects: dict[Name, Object] | None = Field(None, description="Objects that the finger may touch, by name.")
