"""Keys of parameters: of a scenario or of a recording's column, shared by all recordings or of some of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from finger_pin.description.recordings.bench import OF_RECORDINGS, RecordingSettings
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import split
from finger_pin.exceptions import InputError
from finger_pin.typing import Array


def tied_entries(key: str) -> list[tuple[str, float]]:
    """Return the entries of a scenario that a parameter sets, ``A & 0.5 * B`` both, and the factor of each on it."""
    entries: dict[str, float] = {}
    for number, part in enumerate(scenario_key(key).split("&")):
        factor, star, entry = part.strip().partition(" * ")
        try:
            value = float(factor) if star else 1.0
        except ValueError:
            value = 0.0
        name = (entry if star else factor).strip()
        if not (0.0 < abs(value) < np.inf) or (star and not number) or name in entries or not name:
            allowed = "must be one key, or several with a factor from the second on: A & B & 0.5 * C, each once"
            raise InputError(entry_of(key), allowed)
        entries[name] = value
    return [*entries.items()]


class Corrections(NamedTuple):
    """Scale, offset and delay, s, of a column that are being found: its quantity is scale times the column plus offset.

    What is written at a column means the same, so that what is found may be written there.
    """

    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0

    def quantity(self, column: Array) -> Array:
        """Return the quantity whose column is given, in SI."""
        return self.scale * column + self.offset

    def column(self, quantity: Array) -> Array:
        """Return the column of a quantity in SI: outputs are compared as they were read, with the noise they have."""
        return (quantity - self.offset) / self.scale


def corrections(recording: str, column: str, nuisance: Mapping[str, float]) -> Corrections:
    """Return the corrections of a column of a recording."""
    neutral = Corrections()._asdict().items()
    return Corrections(*(nuisance.get(f"recordings.{recording}.{column}.{name}", each) for name, each in neutral))


def recording_pattern(key: str) -> str | None:
    """Return the recording of a parameter, or the pattern of several; None if all share it."""
    return key.split(".")[1] if key.startswith(OF_RECORDINGS) else None


def acts_on(key: str, recording: str) -> bool:
    """Return whether a parameter acts on a recording: shared, its own, or of a matching pattern."""
    pattern = recording_pattern(key)
    return pattern is None or fnmatchcase(recording, pattern)


def key_in(key: str, recording: str) -> str:
    """Return the key of a parameter of several recordings in one of them; any other key as it is."""
    is_of_recording = recording_pattern(key) and acts_on(key, recording)
    return f"{OF_RECORDINGS}{recording}.{scenario_key(key)}" if is_of_recording else key


def check_duplicates(keys: Sequence[str], recordings: Iterable[str]) -> None:
    """Refuse two parameters of the same entry of a recording."""
    for recording in recordings:
        keys_by_target: dict[str, str] = {}
        for key in keys:
            named = key_in(key, recording)
            prefix = named.removesuffix(scenario_key(named))
            for entry, _ in tied_entries(key):
                first = keys_by_target.setdefault(prefix + entry, key)
                if first != key:
                    raise InputError(entry_of(key), f"is found for {recording} as {first} too; leave out one of them")


def scenario_key(key: str) -> str:
    """Return the key of a parameter in its recording's scenario."""
    return key.split(".", 2)[2] if key.startswith(OF_RECORDINGS) else key


def entry_of(key: str) -> str:
    """Return the entry of a parameter in a bench."""
    recording = recording_pattern(key)
    shared = recording is None or {*"*?["} & {*recording}
    return f"identify.parameters.{key}" if shared else f"identify.recordings.{recording}.parameters.{scenario_key(key)}"


def corrected_column(key: str, columns: Iterable[str]) -> str | None:
    """Return the first column, with its recording, that a parameter corrects; None if it corrects none."""
    name, _, correction = scenario_key(key).rpartition(".")
    parts = ((each, *each.split(".", 1)) for each in columns)
    matching = (each for each, recording, column in parts if column == name and acts_on(key, recording))
    return next(matching, None) if recording_pattern(key) and correction in Corrections._fields else None


def is_scenario_key(key: str, columns: Iterable[str]) -> bool:
    """Return whether a parameter is a key of a scenario, not an offset, scale or delay of a column.

    Args:
        key: Dotted key.
        columns: Names of all inputs and outputs, with their recordings.
    """
    names = sorted(columns)
    if recording_pattern(key) is None or corrected_column(key, names):
        return recording_pattern(key) is None
    if "&" in scenario_key(key) and any(entry.endswith(tuple(Corrections._fields)) for entry, _ in tied_entries(key)):
        raise InputError(entry_of(key), "ties corrections of columns: only keys of the scenario can be one number")
    acts_somewhere = any(acts_on(key, each.partition(".")[0]) for each in names)
    if acts_somewhere and scenario_key(key).partition(".")[0] in Scenario.model_fields:
        return True
    allowed = f"must be a key of the scenario, or variable.label and .{', '.join(Corrections._fields)}; there are"
    raise InputError(entry_of(key), f"{allowed} {', '.join(names)}")


def check_shadowing(recording: str, settings: RecordingSettings, keys: Sequence[str]) -> None:
    """Refuse an entry of one recording that would hide, or be hidden by, a parameter that all recordings share."""
    shared = [key for key in keys if recording_pattern(key) is None]
    recording_keys = [scenario_key(key) for key in keys if recording_pattern(key) and acts_on(key, recording)]
    for group, names in (("values", settings.values), ("parameters", recording_keys)):
        for key in names:
            entries = [entry for entry, _ in tied_entries(key)] if group == "parameters" else [key]
            pairs = ((one, other, each) for each in shared for other, _ in tied_entries(each) for one in entries)
            hidden = next((each for one, other, each in pairs if _overlap(one, other)), None)
            if hidden is not None:
                allowed = f"is found or held for all recordings as {hidden}; leave out one of them"
                raise InputError(f"identify.recordings.{recording}.{group}.{key}", allowed)


def _overlap(first_key: str, second_key: str) -> bool:
    """Return whether two keys, with stars or indices, are of the same entry, or one of a table that has the other."""
    (a, first), (b, second) = split(first_key), split(second_key)
    same_entry = all(x == y or "*" in (x, y) for x, y in zip(a.split("."), b.split("."), strict=False))
    return same_entry and (first is None or second is None or first == second)
