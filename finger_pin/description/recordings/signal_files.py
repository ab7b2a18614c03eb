"""CSV files of signals in the tables of a scenario, and times that signals share."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from finger_pin.description.commands import COMMANDS, command_place
from finger_pin.description.fields import without
from finger_pin.description.recordings.columns import read_signals
from finger_pin.description.tables import PACKED_PREFIX, merge
from finger_pin.description.validation import Table, as_table
from finger_pin.exceptions import InputError
from finger_pin.files import expand

# Sections that may name a CSV file, the key that does, where its columns go, and the unit of each.
_SIGNAL_FILES = (
    ("reference", "file", "joints", lambda _: "rad"),
    ("environment", "fingertip_force_file", "fingertip_force_signal", lambda _: "N"),
)


def with_signals(table: Table, folder: Path) -> Table:
    """Return a table with signals sampled in the columns of CSV files, and the times that neighbours share.

    The file of commands is read by `with_commands`, when the finger is known; its path, and those of a bench's
    recordings, are from the root.
    """
    for section, key, target, unit_of in _SIGNAL_FILES:
        settings = table.get(section)
        if isinstance(settings, dict) and key in settings:
            samples = read_signals(f"{section}.{key}", settings[key], folder, unit_of)
            joined = {**_signals(settings, section, key, target), **samples}
            table = table | {section: without(settings, key) | {target: joined}}
    commands = table.get("controller")
    file = commands.get("file") if isinstance(commands, dict) else None
    path = file.get("path") if isinstance(file, dict) else file
    if isinstance(path, str):
        absolute = str((folder / expand(path)).absolute())
        table = merge(table, {"controller": {"file": {"path": absolute} if isinstance(file, dict) else absolute}})
    # A scenario that extends this one finds the recordings of its bench, too.
    recordings = as_table(as_table(table.get("identify")).get("recordings"))
    files = {name: file for name, each in recordings.items() if isinstance(file := as_table(each).get("file"), str)}
    if files:
        paths = {name: {"file": str((folder / expand(file)).absolute())} for name, file in files.items()}
        table = merge(table, {"identify": {"recordings": paths}})
    try:
        return _with_shared_times(table)
    except RecursionError:
        # No signal lies so deep: validation names the entry that does.
        return table


def with_commands(table: Table) -> Table:
    """Return a table with the samples of the controller's CSV file in its tables, for those without an entry there."""
    settings = table.get("controller")
    if not isinstance(settings, dict) or "file" not in settings:
        return table
    fingers = {f"{name}.": as_table(placed).get("finger") for name, placed in placed_fingers(table).items()}
    inputs = [
        prefix + name
        for prefix, finger in (fingers or {"": table.get("finger")}).items()
        for name in as_table(as_table(as_table(finger).get("tree")).get("actuators"))
    ]
    entry, places = "controller.file", partial(command_place, inputs=inputs)
    samples = read_signals(entry, settings["file"], Path(), lambda name: COMMANDS[places(name)[0]])
    settings = without(settings, "file")
    for name, signal in samples.items():
        group, inner = places(name)
        settings = settings | {group: {inner: signal, **_signals(settings, "controller", "file", group)}}
    return table | {"controller": settings}


def _signals(settings: Table, section: str, key: str, group: str) -> Table:
    """Return the signals beside those of a file."""
    if not isinstance(settings.get(group, {}), dict):
        raise InputError(f"{section}.{group}", f"must be a table beside {section}.{key}", settings[group])
    return as_table(settings.get(group))


def placed_fingers(table: Table) -> Table:
    """Return the placed fingers of a scenario's hand, by name; none without a hand."""
    return as_table(as_table(table.get("hand")).get("fingers"))


def _with_shared_times(table: Table, place: str = "") -> Table:
    """Return a table with the times of a neighbour in place of its name in a signal's times."""
    shared = table
    for name, entry in table.items():
        if not isinstance(entry, dict):
            continue
        inner = _with_shared_times(entry, f"{place}{name}.")
        times = inner.get("times")
        if isinstance(times, str) and not times.startswith(PACKED_PREFIX):
            found = as_table(shared.get(times)).get("times")
            if not found or (isinstance(found, str) and not found.startswith(PACKED_PREFIX)):
                allowed = "must be a list of numbers, or the name of another signal here that has one"
                raise InputError(f"{place}{name}.times", allowed, times)
            inner = inner | {"times": found}
        if inner is not entry:
            shared = shared | {name: inner}
    return shared
