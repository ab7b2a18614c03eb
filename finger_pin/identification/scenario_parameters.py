"""Parameters that are keys of a scenario: those that all recordings share, and those of one recording alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.recordings.bench import OF_RECORDINGS, RecordingSettings
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import split
from finger_pin.exceptions import InputError
from finger_pin.typing import Array

#: What may be found of a column itself, besides the scenario's numbers.
OF_COLUMNS = ("offset", "scale", "delay")


@dataclass(frozen=True)
class NuisanceParameter:
    """Nuisance parameter of one recording, such as its initial angle."""

    key: str
    low: float
    high: float
    start: float


@dataclass(frozen=True, eq=False)
class ScenarioPart:
    """Scenarios of one recording, by the parameters that act on it.

    Attributes:
        family: The scenarios.
        places: Which of the parameters that are keys of a scenario, shape (k,).
    """

    family: ParametrisedScenario
    places: NDArray[np.intp]

    def at(self, values: Array) -> Scenario:
        """Return the scenario at values of all parameters that are keys of a scenario.

        Raises:
            InputError: Naming the entry that is wrong.
        """
        return self.family.with_values(values[self.places].tolist())

    @classmethod
    def from_keys(cls, scenario: Scenario, recording: str, keys: Sequence[str]) -> ScenarioPart:
        """Return the scenarios of a recording, by the keys that are shared or of this recording.

        Raises:
            InputError: If the scenario has no such key.
        """
        places = [k for k, key in enumerate(keys) if acts_on(key, recording)]
        for key in (keys[k] for k in places if owner(keys[k])):
            try:
                ParametrisedScenario(scenario, (bare(key),))
            except InputError as error:
                named = "" if error.entry == bare(key) else f"{error.entry}: "
                raise InputError(entry_of(key), f"{named}{error.allowed}") from None
        return cls(ParametrisedScenario(scenario, [bare(keys[k]) for k in places]), np.array(places, dtype=np.intp))


def nuisance_value(
    nuisance: Mapping[str, float], recording: str, output: str, what: str, default: float = 0.0
) -> float:
    """Return the offset, scale or delay of an input or output that is being found."""
    return nuisance.get(f"recordings.{recording}.{output}.{what}", default)


def owner(key: str) -> str | None:
    """Return the recording that a parameter is of, or the pattern of several; None if all share it."""
    return key.split(".")[1] if key.startswith(OF_RECORDINGS) else None


def acts_on(key: str, recording: str) -> bool:
    """Return whether a parameter is shared, of a recording, or of several of which this is one."""
    pattern = owner(key)
    return pattern is None or fnmatchcase(recording, pattern)


def key_in(key: str, recording: str) -> str:
    """Return the key of a parameter of several recordings in one of them; any other key as it is."""
    return f"{OF_RECORDINGS}{recording}.{bare(key)}" if owner(key) and acts_on(key, recording) else key


def check_single(keys: Sequence[str], recordings: Iterable[str]) -> None:
    """Refuse two parameters that are one number of a recording.

    Raises:
        InputError: Naming one of them.
    """
    for recording in recordings:
        known: dict[str, str] = {}
        for key in keys:
            one = key_in(key, recording)
            if one in known:
                raise InputError(entry_of(key), f"is found for {recording} as {known[one]} too; leave out one of them")
            known[one] = key


def bare(key: str) -> str:
    """Return the key of a parameter in its recording's scenario."""
    return key.split(".", 2)[2] if key.startswith(OF_RECORDINGS) else key


def entry_of(key: str) -> str:
    """Return the entry of a bench that a parameter stands at."""
    recording = owner(key)
    shared = recording is None or {*"*?["} & {*recording}
    return f"identify.parameters.{key}" if shared else f"identify.recordings.{recording}.parameters.{bare(key)}"


def column_of(key: str, columns: Iterable[str]) -> str | None:
    """Return the first column, with its recording, whose offset, scale or delay a parameter is; None if it is none."""
    name, _, what = bare(key).rpartition(".")
    parts = ((each, *each.split(".", 1)) for each in columns)
    known = (each for each, recording, column in parts if column == name and acts_on(key, recording))
    return next(known, None) if owner(key) and what in OF_COLUMNS else None


def is_of_scenario(key: str, columns: Iterable[str]) -> bool:
    """Return whether a parameter is a key of a scenario, not an offset, scale or delay of a column.

    Args:
        key: Dotted key.
        columns: Names of all inputs and outputs, with their recordings.

    Raises:
        InputError: If it is neither.
    """
    known = sorted(columns)
    if owner(key) is None or column_of(key, known):
        return owner(key) is None
    there = any(acts_on(key, each.partition(".")[0]) for each in known)
    if there and bare(key).partition(".")[0] in Scenario.model_fields:
        return True
    allowed = f"must be a key of the scenario, or variable.label and .{', '.join(OF_COLUMNS)}; there are"
    raise InputError(entry_of(key), f"{allowed} {', '.join(known)}")


def check_apart(recording: str, settings: RecordingSettings, keys: Sequence[str]) -> None:
    """Refuse an entry of one recording that would hide, or be hidden by, a parameter that all recordings share.

    Raises:
        InputError: Naming the recording's entry.
    """
    shared = [key for key in keys if owner(key) is None]
    recording_keys = [bare(key) for key in keys if owner(key) and acts_on(key, recording)]
    for group, names in (("values", settings.values), ("parameters", recording_keys)):
        for key in names:
            hidden = next((each for each in shared if _overlap(key, each)), None)
            if hidden is not None:
                allowed = f"is found or held for all recordings as {hidden}; leave out one of them"
                raise InputError(f"identify.recordings.{recording}.{group}.{key}", allowed)


def with_recorded_values(scenario: Scenario, recording: str, settings: RecordingSettings) -> Scenario:
    """Return the scenario of a recording, with the parameters that belong to it alone.

    Raises:
        InputError: Naming the recording's entry.
    """
    for key, value in settings.values.items():
        try:
            scenario = ParametrisedScenario(scenario, (key,)).with_values([value])
        except InputError as error:
            named = "" if error.entry == key else f"{error.entry}: "
            raise InputError(
                f"identify.recordings.{recording}.values.{key}", f"{named}{error.allowed}", value
            ) from None
    return scenario


def _overlap(one: str, other: str) -> bool:
    """Return whether two keys, with stars or indices, are of the same entry, or one of a table that has the other."""
    (a, first), (b, second) = split(one), split(other)
    same = all(x == y or "*" in (x, y) for x, y in zip(a.split("."), b.split("."), strict=False))
    return same and (first is None or second is None or first == second)
