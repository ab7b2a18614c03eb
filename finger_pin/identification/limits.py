"""Limits that parameters set each other within bounds, such as stiction not below Coulomb's."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.loading import ParametrisedScenario
from finger_pin.exceptions import InputError
from finger_pin.identification.scenario_parameters import ScenarioPart, bare, entry_of
from finger_pin.typing import Array

# How near to the edge, over the way to a corner; of how many numbers all corners are tried.
_NEAR_EDGE, _FEW = 1e-9, 8


@dataclass(frozen=True, eq=False)
class Limits:
    """Bounds of numbers, and the scenarios that they make.

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
        """Return the limits of parts; refuse bounds outside a range, or without any allowed values.

        Raises:
            InputError: Naming the key, its bound and what is wrong with it.
        """
        self = cls(parts, [bare(key) for key in parameters], low, high)
        keys, middle = self.keys, 0.5 * (self.low + self.high)
        anywhere = any(self.refusal(each) is None for each in self._corners(middle, np.ones(len(keys), dtype=bool)))
        for k, key in enumerate(keys):
            part = next(each for each in parts if k in each.places)
            alone = ParametrisedScenario(part.family.scenario, (key,))
            for bound in (self.low[k], self.high[k]):
                try:
                    alone.with_values([float(bound)])
                except InputError as error:
                    at, free = middle.copy(), np.arange(len(keys)) != k
                    at[k] = bound
                    refusals = {self.refusal(each) for each in (at, *self._corners(at, free))}
                    # What is wrong with it alone is the same beside any others.
                    others = (each[0] in keys and each[0] != key for each in refusals if each)
                    between = None in refusals or len(refusals) > 1 or any(others)
                    if not (between and anywhere):
                        allowed = error.allowed if error.entry == key else f"with it {error.entry} {error.allowed}"
                        raise InputError(entry_of(parameters[k]), allowed, float(bound)) from None
        return self

    def refusal(self, values: Array) -> tuple[str, str] | None:
        """Return the entry that does not go with the others, and its allowed values; None if all are allowed."""
        try:
            for part in self.parts:
                part.at(values)
        except InputError as error:
            return error.entry, error.allowed
        return None

    def nearest(self, values: Array, free: NDArray[np.bool_] | None = None) -> Array:
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
        out, into = 0.0, 1.0
        while into - out > _NEAR_EDGE:
            middle = 0.5 * (out + into)
            allowed = self.refusal(values + middle * (corner - values)) is None
            out, into = (out, middle) if allowed else (middle, into)
        return values + into * (corner - values)

    def _corners(self, values: Array, free: NDArray[np.bool_]) -> Iterator[Array]:
        """Yield values with one number at a bound, the nearest first, then those of a few with all of them there."""
        places = np.flatnonzero(free)
        ends = [(k, end) for k in places for end in (self.low[k], self.high[k])]
        ends.sort(key=lambda bound: abs(bound[1] - values[bound[0]]) / (self.high[bound[0]] - self.low[bound[0]]))
        for k, end in ends:
            corner = values.copy()
            corner[k] = end
            yield corner
        for both in itertools.product((False, True), repeat=len(places)) if len(places) <= _FEW else ():
            corner = values.copy()
            corner[places] = np.where(both, self.high[places], self.low[places])
            yield corner
