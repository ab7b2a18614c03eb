"""Kinematics of a rigid body: tips, directions of links, energies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from finger_pin.description.routing import Array


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Positions and velocities of the rigid body; leading dimensions such as time are kept.

    Attributes:
        tip: p, fingertip position, shape (..., 3), m; of several shape (..., t, 3).
        tip_velocity: p', m/s, of the same shape.
        jacobian: J of (6), shape (..., 3, n); of several (..., t, 3, n).
        directions: e_j, unit vectors along the link proximal to each joint, base frame, shape (..., n, 3).
        kinetic_energy: Shape (...,), J.
        potential_energy: Of gravity, shape (...,), J.
    """

    tip: Array
    tip_velocity: Array
    jacobian: Array
    directions: Array
    kinetic_energy: Array
    potential_energy: Array


class Motion(NamedTuple):
    """Place of the fingertip and energies of the rigid body; leading dimensions are kept.

    Attributes:
        tip: p, shape (..., 3), m; of several shape (..., t, 3).
        kinetic_energy: Shape (...,), J.
        potential_energy: Of gravity, shape (...,), J.
        objects: Both energies of free objects around it; None without surroundings.
    """

    tip: Array
    kinetic_energy: Array
    potential_energy: Array
    objects: tuple[Array, Array] | None = None
