"""Scenarios at values of parameters, and the limits that these set each other, such as stiction not below Coulomb's."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.keys import acts_on, entry_of, recording_pattern, scenario_key, tied_entries
from finger_pin.typing import Array

# Tolerance of the edge, part of the line to a corner; greatest number of parameters of which all corners are tried.
_EDGE_TOLERANCE, _MAX_CORNER_PARAMETERS = 1e-9, 8


@dataclass(frozen=True, eq=False)
class ScenarioPart:
    """Scenarios of one recording, by the parameters that act on it.

    Attributes:
        family: The scenarios, by every entry that one of the parameters sets.
        indices: Which of the parameters that are keys of a scenario sets each entry, shape (k,).
        factors: Each entry over its parameter, shape (k,).
    """

    family: ParametrisedScenario
    indices: NDArray[np.intp]
    factors: Array

    def scenario_at(self, values: Array) -> Scenario:
        """Return the scenario at values of all parameters that are keys of a scenario."""
        return _with_values(self, tuple((self.factors * values[self.indices]).tolist()))

    @classmethod
    def from_keys(cls, scenario: Scenario, recording: str | None, keys: Sequence[str]) -> ScenarioPart:
        """Return the scenarios of a recording, by the keys that are shared or of this recording."""
        acting = [k for k, key in enumerate(keys) if recording is None or acts_on(key, recording)]
        # The first entry of a key comes last: a search starts from its value.
        entries = [(k, *entry) for k in acting for entry in reversed(tied_entries(keys[k]))]
        for k, entry, _ in entries:
            if recording_pattern(keys[k]):
                with _naming(entry_of(keys[k]), entry):
                    ParametrisedScenario(scenario, (entry,))
        family = ParametrisedScenario(scenario, [entry for _, entry, _ in entries])
        factors = np.array([factor for *_, factor in entries], dtype=float)
        return cls(family, np.array([k for k, *_ in entries], dtype=np.intp), factors)


@lru_cache(maxsize=32)
def _with_values(part: ScenarioPart, values: tuple[float, ...]) -> Scenario:
    """Return the scenario with other values; the limits of a place, and its recordings, ask for the same in turn."""
    return part.family.with_values(values)


def with_parameters(scenario: Scenario, values: Mapping[str, float]) -> Scenario:
    """Return a scenario with values of parameters that all recordings share, by key."""
    for key in filter(recording_pattern, values):
        raise InputError(key, "is of recordings, and this is a number of the scenario for all of them")
    return ScenarioPart.from_keys(scenario, None, tuple(values)).scenario_at(np.array([*values.values()], dtype=float))


def with_recorded_values(scenario: Scenario, recording: str, settings: RecordingSettings) -> Scenario:
    """Return the scenario of a recording, with the parameters that belong to it alone."""
    for key, value in settings.values.items():
        with _naming(f"identify.recordings.{recording}.values.{key}", key, value):
            scenario = ParametrisedScenario(scenario, (key,)).with_values([value])
    return scenario


@contextmanager
def _naming(entry: str, key: str, *value: object) -> Iterator[None]:
    """Let errors name the entry of a bench in place of the key of a scenario that it sets."""
    try:
        yield
    except InputError as error:
        named = "" if error.entry == key else f"{error.entry}: "
        raise InputError(entry, f"{named}{error.allowed}", *value) from None


class Limits:
    """Bounds of parameters, and the scenarios that limit them within."""

    def __init__(self, parts: Sequence[ScenarioPart], parameters: Sequence[str], low: Array, high: Array) -> None:
        """Refuse bounds outside a range, or without any allowed values.

        Args:
            parts: The scenarios, of one recording each.
            parameters: Keys of a scenario.
            low: Least values, shape (p,).
            high: Greatest values, shape (p,).
        """
        self._parts, self._low, self._high = parts, low, high
        keys, middle = [scenario_key(key) for key in parameters], 0.5 * (low + high)
        any_feasible = any(
            self._refusal(each) is None for each in self._corners(middle, np.ones(len(keys), dtype=bool))
        )
        for k, key in enumerate(keys):
            part = next(each for each in parts if k in each.indices)
            for bound in (low[k], high[k]):
                try:
                    with_parameters(part.family.scenario, {key: float(bound)})
                except InputError as error:
                    point, free = middle.copy(), np.arange(len(keys)) != k
                    point[k] = bound
                    refusals = {self._refusal(each) for each in (point, *self._corners(point, free))}
                    # A bound that is wrong by itself is refused alike whatever the other values.
                    other_key_refused = (each[0] in keys and each[0] != key for each in refusals if each)
                    feasible_between = None in refusals or len(refusals) > 1 or any(other_key_refused)
                    if not (feasible_between and any_feasible):
                        allowed = error.allowed if error.entry == key else f"with it {error.entry} {error.allowed}"
                        raise InputError(entry_of(parameters[k]), allowed, float(bound)) from None

    def _refusal(self, values: Array) -> tuple[str, str] | None:
        """Return the refused entry and its allowed values; None if all values are allowed together."""
        try:
            for part in self._parts:
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
        if self._refusal(values) is None:
            return values
        corners = self._corners(values, np.ones(len(values), dtype=bool) if free is None else free)
        corner = next((each for each in corners if self._refusal(each) is None), None)
        if corner is None:
            return values
        refused, accepted = 0.0, 1.0
        while accepted - refused > _EDGE_TOLERANCE:
            middle = 0.5 * (refused + accepted)
            allowed = self._refusal(values + middle * (corner - values)) is None
            refused, accepted = (refused, middle) if allowed else (middle, accepted)
        return values + accepted * (corner - values)

    def _corners(self, values: Array, free: NDArray[np.bool_]) -> Iterator[Array]:
        """Yield points with one parameter at a bound, nearest first, then corners with all free ones at bounds."""
        indices = np.flatnonzero(free)
        bounds = [(k, limit) for k in indices for limit in (self._low[k], self._high[k])]
        bounds.sort(key=lambda bound: abs(bound[1] - values[bound[0]]) / (self._high[bound[0]] - self._low[bound[0]]))
        for k, limit in bounds:
            corner = values.copy()
            corner[k] = limit
            yield corner
        if len(indices) <= _MAX_CORNER_PARAMETERS:
            for at_upper in itertools.product((False, True), repeat=len(indices)):
                corner = values.copy()
                corner[indices] = np.where(at_upper, self._high[indices], self._low[indices])
                yield corner
