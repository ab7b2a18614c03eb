"""A quantity of a result: its dimensions, unit, name and equation, and its function of a motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from finger_pin.mechanism.rows import Energy
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.typing import Array

#: Frames of variables with components; the base's, a palm's if there is one, is that of all but the palm's own.
BASE_FRAME, WORLD_FRAME = "base", "world"


class Quantity(NamedTuple):
    """A variable of a result.

    Attributes:
        dims: Names of its dimensions, time first.
        value: Returns its values from what is known of a motion.
        units: SI.
        long_name: In words.
        equation: Number of its equation in the paper; empty for none.
        frame: Whose axes its components are along, `BASE_FRAME` or `WORLD_FRAME`; empty for what has none.
        booked: Its part in the energy account, if any.
    """

    dims: tuple[str, ...]
    value: Callable[[SampledTrajectory], Array]
    units: str
    long_name: str
    equation: str = ""
    frame: str = ""
    booked: Energy | None = None

    @property
    def attributes(self) -> dict[str, str]:
        """Unit, name, frame and equation, and its part in the account."""
        found = {"units": self.units, "long_name": self.long_name} | ({"frame": self.frame} if self.frame else {})
        if self.booked is not None:
            found |= {"account": self.booked.kind, "label": self.booked.label}
        return found | {"equation": f"({self.equation})"} if self.equation else found
