"""From files to tables: shipped data, a user's TOML and CSV files, and tables on top of others."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from finger_pin.description.effects import without_unread
from finger_pin.description.recordings.signal_files import resolve_signals
from finger_pin.description.validation import Description, Table, as_table, suggestion
from finger_pin.exceptions import InputError
from finger_pin.files import expand, read_text

#: In place of an inherited table or value: takes it away, as if the base had left it out.
NONE = "none"
# Kinds whose entries mean nothing to another kind: a table of one replaces, rather than completes, one of another.
_KINDS_APART = {"step", "ramp", "points", "cosine", "samples", "tensions"}


def shipped(kind: str) -> dict[str, str]:
    """Return the names of a kind that ship, such as fingers, with a line about each."""
    return {name: str(tomllib.loads(text).get("title", "")) for name, text in _shipped_texts(kind).items()}


@cache
def _shipped_texts(kind: str) -> dict[str, str]:
    """Return the TOML texts of a kind that ship, by name."""
    entries = resources.files("finger_pin.description").joinpath(kind).iterdir()
    texts = {entry.name: entry.read_text("utf-8") for entry in entries if entry.name.endswith(".toml")}
    return {name.removesuffix(".toml"): texts[name] for name in sorted(texts)}


@cache
def _shipped_table(kind: str, name: str) -> Table:
    return tomllib.loads(_shipped_texts(kind)[name])


def _read(kind: str, name: str, folder: Path, entry: str = "") -> tuple[Table, Path]:
    """Return the table of a shipped item or of a file relative to a folder, and the path that it was read from."""
    if not is_path(name):
        names = _shipped_texts(f"{kind}s")
        if name not in names:
            near = suggestion(name, [*names, *(_shipped_texts("benches") if kind == "scenario" else ())])
            allowed = f"no such {kind}; there are {', '.join(names)}, or the path of a .toml file{near}"
            raise InputError(entry or kind, allowed, name)
        return copy.deepcopy(_shipped_table(f"{kind}s", name)), Path(name)
    what, path = f"{kind} file {name}", folder / expand(name)
    text = read_text(what, path)
    try:
        return tomllib.loads(text), path
    except RecursionError:
        raise InputError(what, "is nested too deeply") from None
    except ValueError as error:
        raise InputError(what, f"is not valid TOML: {error}") from None


def is_path(name: str) -> bool:
    """Return whether a name is the path of a file rather than something that ships."""
    return name.endswith(".toml") or "/" in name or "\\" in name


def kind_of(name: str, folder: Path = Path()) -> str:
    """Return the kind of a name, or of a file relative to a folder: ``finger``, ``hand``, or else ``scenario``."""
    if not is_path(name):
        return next((kind for kind in ("finger", "hand") if name in _shipped_texts(f"{kind}s")), "scenario")
    try:
        table, path = _read("finger", name, folder)
        if "base" in table and "fingers" not in table:
            return kind_of(str(table["base"]), path.parent)
    except (InputError, RecursionError):
        return "scenario"
    return "hand" if "fingers" in table else "finger" if {"joints", "tendons"} & table.keys() else "scenario"


def bench_file(name: str) -> str:
    """Return the path of the file of a bench that ships, or a name as it is."""
    shipping = not is_path(name) and name in _shipped_texts("benches")
    return str(resources.files("finger_pin.description").joinpath(f"benches/{name}.toml")) if shipping else name


def read_scenario_file(name: str, folder: Path, opened: tuple[Path, ...] = ()) -> tuple[Table, Path]:
    """Return the table of a scenario on top of the ones that it extends, and the folder that it lies in.

    A bench is a scenario too; where a scenario has the same name, that one is meant.
    """
    if name not in _shipped_texts("scenarios"):
        name = bench_file(name)
    table, path = _read("scenario", name, folder)
    identity = path.resolve()
    if identity in opened:
        raise InputError("extends", "a scenario cannot start from itself", name)
    folder = path.parent
    resolve_signals(table, folder)
    _resolve_recordings(table, folder)
    if "extends" not in table:
        return table, folder
    base = table.pop("extends")
    if not isinstance(base, str):
        raise InputError("extends", "must be the name or path of another scenario", base)
    parent, parent_folder = read_scenario_file(base, folder, (*opened, identity))
    parent.pop("name", None)
    if "finger" in parent:
        parent["finger"] = resolve_finger(parent["finger"], parent_folder)
    if "hand" in parent:
        parent["hand"] = resolve_hand(parent["hand"], parent_folder)
    whole = isinstance(table.get("finger"), str) or "base" in as_table(table.get("finger"))
    if "hand" in table or whole:
        parent.pop("finger", None)
    if "finger" in table or isinstance(table.get("hand"), str) or "base" in as_table(table.get("hand")):
        parent.pop("hand", None)
    if "hand" in parent and "hand" in table:
        table["hand"] = _on_top(parent.pop("hand"), table["hand"], folder)
    return merge(parent, table), folder


def _opened(kind: str, name: str, folder: Path, opened: tuple[Path, ...]) -> tuple[Table, Path, tuple[Path, ...]]:
    """Return the table of a named finger or hand, the folder that its paths start from, and the files seen so far."""
    table, path = _read(kind, name, folder)
    identity = path.resolve()
    if identity in opened:
        raise InputError(f"{kind}.base", f"a {kind} cannot start from itself", name)
    table.setdefault("name", as_name(Path(name).stem))
    return table, path.parent, (*opened, identity)


def resolve_finger(finger: Any, folder: Path, opened: tuple[Path, ...] = ()) -> Any:
    """Return the table of a finger given by name, by path, or as a table that may start from a base."""
    if isinstance(finger, str):
        return resolve_finger(*_opened("finger", finger, folder, opened))
    if isinstance(finger, Description):
        return finger
    if isinstance(finger, dict) and "base" in finger:
        rest = dict(finger)
        base = rest.pop("base")
        if not isinstance(base, str):
            raise InputError("finger.base", "must be the name or path of a finger", base)
        return with_motors(merge(resolve_finger(base, folder, opened), rest), folder)
    if not isinstance(finger, dict):
        raise InputError("finger", "must be the name of a finger, the path of a .toml file, or a table", finger)
    return with_motors(finger, folder)


def with_motors(finger: Table, folder: Path) -> Table:
    """Replace names and paths of motors in a finger by their tables; return the finger."""
    for name, actuator in as_table(finger.get("actuators")).items():
        if isinstance(actuator, dict) and "motor" in actuator:
            actuator["motor"] = _resolve_motor(actuator["motor"], folder, f"finger.actuators.{name}.motor")
    return finger


def _resolve_motor(motor: Any, folder: Path, entry: str, opened: tuple[Path, ...] = ()) -> Any:
    """Return the table of a motor given by name, by path, or as a table that may start from a base."""
    if isinstance(motor, str):
        table, path = _read("motor", motor, folder, entry)
        identity = path.resolve()
        if identity in opened:
            raise InputError(entry, "a motor cannot start from itself", motor)
        return _resolve_motor(table, path.parent, entry, (*opened, identity))
    if isinstance(motor, dict) and "base" in motor:
        rest = dict(motor)
        return merge(as_table(_resolve_motor(rest.pop("base"), folder, entry, opened)), rest)
    return motor


def resolve_hand(hand: Any, folder: Path, opened: tuple[Path, ...] = ()) -> Any:
    """Return the table of a hand given by name, by path, or as a table that may start from a base."""
    if isinstance(hand, str):
        return resolve_hand(*_opened("hand", hand, folder, opened))
    if isinstance(hand, Description):
        return hand
    if not isinstance(hand, dict):
        raise InputError("hand", "must be the name of a hand, the path of a .toml file, or a table", hand)
    rest = dict(hand)
    base = rest.pop("base", {})
    if not isinstance(base, str | dict):
        raise InputError("hand.base", "must be the name or path of a hand", base)
    return _on_top(resolve_hand(base, folder, opened) if base else {}, rest, folder)


def _on_top(base: Table, hand: Table, folder: Path) -> Table:
    """Return the table of a hand merged with another on top.

    What is the name or path of a finger, and no table, is that finger where its place is the base's.
    """
    fingers = as_table(as_table(hand).get("fingers"))
    for name, placed in fingers.items():
        if isinstance(placed, str) and placed != NONE:
            placed = fingers[name] = {"finger": placed}
        finger = as_table(placed).get("finger")
        if isinstance(finger, str) or "base" in as_table(finger):
            with _named(f"hand.fingers.{name}."):
                placed["finger"] = resolve_finger(finger, folder)
            as_table(as_table(base.get("fingers")).get(name)).pop("finger", None)
    return merge(base, hand)


@contextmanager
def _named(owner: str) -> Iterator[None]:
    """Put the owner of a finger before the entries that errors name."""
    try:
        yield
    except InputError as error:
        raise InputError(owner + error.entry, error.allowed, error.value) from None


def _resolve_recordings(table: Table, folder: Path) -> None:
    """Make the paths of recordings absolute, so that a scenario that extends this one finds them."""
    for recording in as_table(as_table(table.get("identify")).get("recordings")).values():
        name = as_table(recording).get("file")
        if isinstance(name, str):
            recording["file"] = str((folder / expand(name)).absolute())


def is_other_kind(base: Table, top: Table) -> bool:
    """Return whether a signal or controller is of another kind than the one that it is put on."""
    kinds = {base.get("kind"), top["kind"]} if "kind" in top else set()
    return len(kinds) == 2 and not _KINDS_APART.isdisjoint(kinds)


def merge(base: Table, top: Table) -> Table:
    """Return a table with the entries of another on top; the value "none" removes an entry."""
    merged = without_unread(base, top)
    for key, value in top.items():
        if key in merged and isinstance(value, str) and value == NONE:
            del merged[key]
            continue
        both = isinstance(value, dict) and isinstance(merged.get(key), dict) and not is_other_kind(merged[key], value)
        # A table that names its base starts from that one.
        merged[key] = merge(merged[key], value) if both and "base" not in value else value
    return merged


def as_name(stem: str) -> str:
    """Return a valid name made of that of a file."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]
    return name if re.match(r"[A-Za-z]", name) else f"scenario_{name}"
