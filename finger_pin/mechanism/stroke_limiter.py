"""Stroke limiters (2): Hunt-Crossley contacts at both ends of a joint's range, which never pull."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.description.validation import expand
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.mechanism.energies import Energy
from finger_pin.mechanism.rows import Rows

_ENERGY = Energy("limiter", "stroke limiters")
# Farther than any joint gets, rad or m.
_NEVER = 1e9


@dataclass(frozen=True, eq=False)
class StrokeLimiter:
    """Stroke limiters of all joints.

    Attributes:
        lower: Shape (n,), rad.
        upper: Shape (n,), rad.
        stiffness: k, shape (n,), N m/rad.
        damping: c, shape (n,), s/rad.
        limited: Whether each joint has limits, shape (n,).
    """

    lower: Array
    upper: Array
    stiffness: Array
    damping: Array
    limited: NDArray[np.bool_]

    @classmethod
    def from_description(cls, description: FingerDescription) -> StrokeLimiter:
        """Read the ranges and the contact's stiffness and damping."""
        ranges = np.array([joint.range for joint in description.joints.values()])
        settings = description.stroke_limiter
        size = len(ranges)
        stiffness, damping = expand(settings.stiffness, size), expand(settings.damping, size)
        limited = np.array([joint.limited for joint in description.joints.values()])
        return cls(ranges[:, 0], ranges[:, 1], stiffness, damping, limited)

    def rows(self, names: tuple[str, ...], width: int) -> Rows:
        """Return the table of the limiters."""
        lower, upper = np.where(self.limited, self.lower, -_NEVER), np.where(self.limited, self.upper, _NEVER)
        return Rows(
            group="limiter",
            law=STROKE_LIMITER,
            names=names,
            parameters=np.array([lower, upper, self.stiffness, self.damping]),
            arm=np.eye(len(names), width),
            stored=_ENERGY,
            powers=(_ENERGY,),
        )
