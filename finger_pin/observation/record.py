"""The record of an observer: estimates over time in memory that does not grow without end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.observation.estimate import QUANTITIES, Band, Estimate
from finger_pin.typing import Array

#: From this consistency on a model does not fit its readings.
CONSISTENCY_LIMIT = 3.0
# Rows that are kept at most; then every second one goes, and from there on every second estimate is kept.
_MOST_ROWS = 100_000
_QUANTITIES = {
    "joint_position": ("rad", "joint angle"),
    "tendon_tension": ("N", "tension behind all friction"),
    "spool_tension": ("N", "tension at the canal's entrance"),
    "fingertip_force": ("N", "force at the tip"),
}


class Record:
    """Estimates and how long their steps took, a row each, at equal distances."""

    def __init__(self, finger: Finger, tips: Sequence[str]) -> None:
        """Start empty.

        Args:
            finger: Whose joints and tendons they have.
            tips: Names of the tips at which forces are estimated.
        """
        routing = finger.routing
        self._coordinates = {"joint": list(routing.joints), "tendon": list(routing.tendons), "axis": [*"xyz"]}
        self._bands = [name for name in QUANTITIES if name != "spool_tension" or name in finger.signal_table]
        self._dims: dict[str, tuple[str, ...]] = {
            "joint_position": ("joint",),
            "tendon_tension": ("tendon",),
            "spool_tension": ("tendon",),
            "fingertip_force": ("fingertip", "axis"),
        }
        if len(tips) == 1 and not tips[0]:
            # A finger's only tip needs no dimension, as in results of runs.
            self._dims["fingertip_force"] = ("axis",)
        else:
            self._coordinates["fingertip"] = list(tips)
        self._rows, self._count, self._stride, self._seen = np.empty((256, 0)), 0, 1, 0
        self.skipped, self.failures = Counter[str](), Counter[str]()

    def add(self, estimate: Estimate, duration: float) -> None:
        """Add an estimate, and how long its step took, s."""
        self.skipped.update(estimate.skipped)
        if estimate.failure:
            self.failures[estimate.failure] += 1
        self._seen += 1
        if (self._seen - 1) % self._stride:
            return
        bands = [part.ravel() for name in self._bands for part in getattr(estimate, name)]
        further = [estimate.touched, *(each.ravel() for each in estimate.observable.values())]
        row = np.concatenate([(estimate.time, estimate.consistency, duration), *bands, *further])
        if not self._count:
            self._rows = np.empty((256, len(row)))
        if self._count == _MOST_ROWS:
            self._rows[: (self._count + 1) // 2] = self._rows[: self._count : 2].copy()
            self._count, self._stride = (self._count + 1) // 2, 2 * self._stride
        elif self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])[:_MOST_ROWS]
        self._rows[self._count] = row
        self._count += 1

    def dataset(self, attributes: Mapping[str, Any]) -> xr.Dataset:
        """Return the record as a Dataset with further attributes.

        Raises:
            InputError: If it is empty.
        """
        if not self._count:
            raise InputError("result", "there is none before the first step")
        rows = self._rows[: self._count]
        sizes = {name: len(values) for name, values in self._coordinates.items()}
        variables: dict[str, Any] = {
            "consistency": (
                "time",
                rows[:, 1],
                {"units": "1", "long_name": "mean square of innovations over expected"},
            ),
            "step_time": ("time", rows[:, 2], {"units": "s", "long_name": "wall time of a step"}),
        }
        place = 3

        def taken(dims: tuple[str, ...]) -> Array:
            nonlocal place
            shape = [sizes[name] for name in dims]
            begin, place = place, place + int(np.prod(shape))
            return rows[:, begin:place].reshape(len(rows), *shape)

        for name in self._bands:
            dims, (units, text) = self._dims[name], _QUANTITIES[name]
            for end, words in zip(
                Band._fields, ("", ", lower end of its band", ", upper end of its band"), strict=True
            ):
                suffix = "" if end == "value" else f"_{end}"
                metadata = {"units": units, "long_name": text + words}
                variables[name + suffix] = (("time", *dims), taken(dims), metadata)
        of_tips = self._dims["fingertip_force"][:-1]
        touched = taken(of_tips) > 0.5
        variables["touched"] = (("time", *of_tips), touched, {"long_name": "whether a force presses on the tip"})
        for name in ("joint_position", "fingertip_force"):
            dims, text = self._dims[name], "part of the variance that readings could take away"
            variables[f"{name}_observable"] = (("time", *dims), taken(dims), {"units": "1", "long_name": text})
        told = {
            "stride": self._stride,
            "skipped": [f"{name}: {count}" for name, count in self.skipped.items()],
            "failures": [f"{text}: {count}" for text, count in self.failures.items()],
        }
        times = {"time": ("time", rows[:, 0], {"units": "s"})}
        return xr.Dataset(variables, times | self._coordinates, {**attributes, **told})
