"""What an observer says after a period: quantities with bands, touch, and how far the model and the sensors carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.typing import Array

#: Signals of which bands follow from the rest of the estimate.
TENSIONS = ("tendon_tension", "spool_tension")
#: What has a band.
QUANTITIES = ("joint_position", *TENSIONS, "fingertip_force")


class Band(NamedTuple):
    """A quantity and its band; arrays in SI."""

    value: Array
    low: Array
    high: Array

    @classmethod
    def around(cls, value: Array, half: Array, least: float = -np.inf) -> Band:
        """Return a band of some half width, which ends at the least value that is possible."""
        return cls(value, np.maximum(value - half, least), value + half)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What is known at the end of a period, with bands at the observer's level.

    Attributes:
        time: s, from the start.
        joint_position: theta, shape (n,), rad.
        tendon_tension: Tension that arrives behind all friction, shape (t,), N.
        spool_tension: Tension at the canal's entrance, shape (t,), N; None where no motor or winch pulls.
        fingertip_force: F at the tips of `Observer`'s ``forces``, shape (f, 3), N, base frame.
        touched: Whether a force presses on each of these, shape (f,).
        since: When it began to, shape (f,), s; NaN where none does.
        consistency: Mean square of innovations over what bands say: about 1, or less; 3 and more: the model does not
            fit, something touches elsewhere than at the tips, or sensors err by more than was said.
        observable: By quantity, the part of its variance that readings could take away: 0 where no sensor has narrowed
            a band, such as a force's direction that no tendon feels, or behind gears that stand still.
        skipped: Readings that were missing, or too far off to be one.
        failure: In words, if the integration failed and went on from the last estimate; else empty.
    """

    time: float
    joint_position: Band
    tendon_tension: Band
    spool_tension: Band | None
    fingertip_force: Band
    touched: NDArray[np.bool_]
    since: Array
    consistency: float
    observable: dict[str, Array]
    skipped: tuple[str, ...]
    failure: str

    def variables(self) -> dict[str, Array]:
        """Return quantities with the ends of their bands, touch and consistency, by the names of a result."""
        values = {"touched": self.touched.astype(float), "consistency": np.array([self.consistency])}
        for name in QUANTITIES:
            if (band := getattr(self, name)) is not None:
                values |= {f"{name}{suffix}": end for suffix, end in zip(("", "_low", "_high"), band, strict=True)}
        return values
