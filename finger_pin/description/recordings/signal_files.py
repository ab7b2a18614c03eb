"""CSV files of signals in the tables of a scenario, and times that signals share."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from finger_pin.description.commands import COMMANDS, command_place
from finger_pin.description.recordings.columns import read_signals
from finger_pin.description.tables import PACKED_PREFIX
from finger_pin.description.validation import Table, as_table
from finger_pin.exceptions import InputError
from finger_pin.files import expand

# Sections that may name a CSV file, the key that does, where its columns go, and their unit.
_SIGNAL_FILES = (
    ("reference", "file", "joints", "rad"),
    ("environment", "fingertip_force_file", "fingertip_force_signal", "N"),
)


def resolve_signals(table: Table, folder: Path) -> None:
    """Replace CSV files by signals sampled in their columns; that of commands is read when the finger is known."""
    for section, key, target, unit in _SIGNAL_FILES:
        settings = table.get(section)
        if isinstance(settings, dict) and key in settings:
            samples = read_signals(f"{section}.{key}", settings.pop(key), folder, partial(_unit, unit))
            settings[target] = {**_signals(settings, section, key, target), **samples}
    commands = table.get("controller")
    if isinstance(commands, dict) and "file" in commands:
        file = commands["file"]
        path = file.get("path") if isinstance(file, dict) else file
        if isinstance(path, str):
            absolute = str((folder / expand(path)).absolute())
            commands["file"] = {**file, "path": absolute} if isinstance(file, dict) else absolute
    _share_times(table)


def _unit(unit: str, _: str) -> str:
    return unit


def resolve_commands(table: Table) -> None:
    """Replace the CSV file of a controller by samples in its tables, for those without an entry there."""
    settings = table.get("controller")
    if not isinstance(settings, dict) or "file" not in settings:
        return
    fingers = {f"{name}.": as_table(placed).get("finger") for name, placed in placed_fingers(table).items()}
    inputs = [
        prefix + name
        for prefix, finger in (fingers or {"": table.get("finger")}).items()
        for name in as_table(as_table(as_table(finger).get("tree")).get("actuators"))
    ]
    entry, places = "controller.file", partial(command_place, inputs=inputs)
    samples = read_signals(entry, settings.pop("file"), Path(), lambda name: COMMANDS[places(name)[0]])
    for name, signal in samples.items():
        group, names = places(name)
        settings[group] = {names: signal, **_signals(settings, "controller", "file", group)}


def _signals(settings: Table, section: str, key: str, group: str) -> Table:
    """Return the signals beside those of a file."""
    if not isinstance(settings.get(group, {}), dict):
        raise InputError(f"{section}.{group}", f"must be a table beside {section}.{key}", settings[group])
    return as_table(settings.get(group))


def placed_fingers(table: Table) -> Table:
    """Return the placed fingers of a scenario's hand, by name; none without a hand."""
    return as_table(as_table(table.get("hand")).get("fingers"))


def _share_times(table: Table) -> None:
    """Replace the name of a neighbour in a signal's times by that one's times."""
    inner = [("", table)]
    # Tables may be nested more deeply than calls.
    while inner:
        place, around = inner.pop()
        for name, entry in around.items():
            if not isinstance(entry, dict):
                continue
            inner.append((f"{place}{name}.", entry))
            times = entry.get("times")
            if isinstance(times, str) and not times.startswith(PACKED_PREFIX):
                shared = as_table(around.get(times)).get("times")
                if not shared or (isinstance(shared, str) and not shared.startswith(PACKED_PREFIX)):
                    allowed = "must be a list of numbers, or the name of another signal here that has one"
                    raise InputError(f"{place}{name}.times", allowed, times)
                entry["times"] = shared
