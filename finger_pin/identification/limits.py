"""Limits that parameters set each other within bounds, such as stiction not below Coulomb's."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.exceptions import InputError
from finger_pin.identification.scenario_parameters import ScenarioPart, entry_of, scenario_key, with_parameters
from finger_pin.typing import Array

# Tolerance of the edge, part of the line to a corner; greatest number of parameters of which all corners are tried.
_EDGE_TOLERANCE, _MAX_CORNER_PARAMETERS = 1e-9, 8


@dataclass(frozen=True, eq=False)
class Limits:
    """Bounds of parameters, and the scenarios that limit them within.

    Attributes:
        parts: The scenarios, of one recording each.
        keys: Of the numbers, in the scenarios.
        low: Least values, shape (p,).
        high: Greatest values, shape (p,).
    """

    parts: Sequence[ScenarioPart]
    keys: Sequence[str]
    low: Array
    high: Array

    @classmethod
    def from_parts(cls, parts: Sequence[ScenarioPart], parameters: Sequence[str], low: Array, high: Array) -> Limits:
        """Return the limits of parts; refuse bounds outside a range, or without any allowed values."""
        limits = cls(parts, [scenario_key(key) for key in parameters], low, high)
        keys, middle = limits.keys, 0.5 * (limits.low + limits.high)
        corners = limits._corners(middle, np.ones(len(keys), dtype=bool))
        any_feasible = any(limits.refusal(each) is None for each in corners)
        for k, key in enumerate(keys):
            part = next(each for each in parts if k in each.indices)
            for bound in (limits.low[k], limits.high[k]):
                try:
                    with_parameters(part.family.scenario, {key: float(bound)})
                except InputError as error:
                    point, free = middle.copy(), np.arange(len(keys)) != k
                    point[k] = bound
                    refusals = {limits.refusal(each) for each in (point, *limits._corners(point, free))}
                    # A bound that is wrong by itself is refused alike whatever the other values.
                    other_key_refused = (each[0] in keys and each[0] != key for each in refusals if each)
                    feasible_between = None in refusals or len(refusals) > 1 or any(other_key_refused)
                    if not (feasible_between and any_feasible):
                        allowed = error.allowed if error.entry == key else f"with it {error.entry} {error.allowed}"
                        raise InputError(entry_of(parameters[k]), allowed, float(bound)) from None
        return limits

    def refusal(self, values: Array) -> tuple[str, str] | None:
        """Return the refused entry and its allowed values; None if all values are allowed together."""
        try:
            for part in self.parts:
                part.scenario_at(values)
        except InputError as error:
            return error.entry, error.allowed
        return None

    def nearest_allowed(self, values: Array, free: NDArray[np.bool_] | None = None) -> Array:
        """Return the nearest allowed values on lines to corners of the bounds; the same values if there are none.

        Args:
            values: Shape (p,).
            free: Which of them may change; all by default.
        """
        if self.refusal(values) is None:
            return values
        corners = self._corners(values, np.ones(len(values), dtype=bool) if free is None else free)
        corner = next((each for each in corners if self.refusal(each) is None), None)
        if corner is None:
            return values
        refused, accepted = 0.0, 1.0
        while accepted - refused > _EDGE_TOLERANCE:
            middle = 0.5 * (refused + accepted)
            allowed = self.refusal(values + middle * (corner - values)) is None
            refused, accepted = (refused, middle) if allowed else (middle, accepted)
        return values + accepted * (corner - values)

    def _corners(self, values: Array, free: NDArray[np.bool_]) -> Iterator[Array]:
        """Yield points with one parameter at a bound, nearest first, then corners with all free ones at bounds."""
        indices = np.flatnonzero(free)
        bounds = [(k, limit) for k in indices for limit in (self.low[k], self.high[k])]
        bounds.sort(key=lambda bound: abs(bound[1] - values[bound[0]]) / (self.high[bound[0]] - self.low[bound[0]]))
        for k, limit in bounds:
            corner = values.copy()
            corner[k] = limit
            yield corner
        if len(indices) <= _MAX_CORNER_PARAMETERS:
            for at_upper in itertools.product((False, True), repeat=len(indices)):
                corner = values.copy()
                corner[indices] = np.where(at_upper, self.high[indices], self.low[indices])
                yield corner
