"""From files, names and overrides to one complete table, by steps that change none of the tables they are given."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, TypeAlias, get_origin

from finger_pin.description.effects import without_unread
from finger_pin.description.fields import find_field, without
from finger_pin.description.recordings.signal_files import placed_fingers, with_signals
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import (
    INHERIT_NOTHING,
    as_name,
    is_other_kind,
    is_path,
    match_paths,
    merge,
    shipped_table,
    shipped_texts,
)
from finger_pin.description.validation import Description, Table, as_table, nearest, suggestion
from finger_pin.exceptions import InputError
from finger_pin.files import expand, read_text

_Opened: TypeAlias = tuple[Path, ...]
# Keys that put another finger or hand in place of what there is.
_OTHER_FINGER = re.compile(r"(hand|finger|hand\.fingers\.[^.]+\.finger)(\.base)?")
_PLACE = re.compile(r"hand\.fingers\.[^.]+")
# What a scenario has instead of each.
_OTHER_KIND = {"hand": "finger", "finger": "hand"}
# Tables by joint or tendon, and which of the two.
_BY_NAME = {
    ("reference", "joints"): "joint",
    ("controller", "tensions"): "tendon",
    ("simulation", "initial", "position"): "joint",
    ("simulation", "initial", "velocity"): "joint",
}


def _read(kind: str, name: str, folder: Path, entry: str = "") -> tuple[Table, Path]:
    """Return the table of a shipped item or of a file relative to a folder, and the path that it was read from."""
    if not is_path(name):
        names = shipped_texts(f"{kind}s")
        if name not in names:
            hint = suggestion(name, [*names, *(shipped_texts("benches") if kind == "scenario" else ())])
            allowed = f"no such {kind}; there are {', '.join(names)}, or the path of a .toml file{hint}"
            raise InputError(entry or kind, allowed, name)
        return shipped_table(f"{kind}s", name), Path(name)
    label, path = f"{kind} file {name}", folder / expand(name)
    text = read_text(label, path)
    try:
        return tomllib.loads(text), path
    except RecursionError:
        raise InputError(label, "is nested too deeply") from None
    except ValueError as error:
        raise InputError(label, f"is not valid TOML: {error}") from None


def kind_of(name: str, folder: Path = Path()) -> str:
    """Return the kind of a name, or of a file relative to a folder: ``finger``, ``hand``, or else ``scenario``."""
    if not is_path(name):
        return next((kind for kind in ("finger", "hand") if name in shipped_texts(f"{kind}s")), "scenario")
    try:
        table, path = _read("finger", name, folder)
        if "base" in table and "fingers" not in table:
            return kind_of(str(table["base"]), path.parent)
    except (InputError, RecursionError):
        return "scenario"
    return "hand" if "fingers" in table else "finger" if {"joints", "tendons"} & table.keys() else "scenario"


def read_scenario_file(name: str, folder: Path, opened: _Opened = (), bench: bool = False) -> tuple[Table, Path]:
    """Return the table of a scenario on top of the ones that it extends, and the folder that it lies in.

    A bench is a scenario too; where a scenario has the same name, that one is meant, unless ``bench`` says otherwise.
    """
    if (bench or name not in shipped_texts("scenarios")) and name in shipped_texts("benches"):
        name = str(resources.files("finger_pin.description").joinpath(f"benches/{name}.toml"))
    table, folder, opened = _open("scenario", name, folder, opened)
    table = with_signals(table, folder)
    if "extends" not in table:
        return table, folder
    base, table = table["extends"], without(table, "extends")
    if not isinstance(base, str):
        raise InputError("extends", "must be the name or path of another scenario", base)
    parent, parent_folder = read_scenario_file(base, folder, opened)
    parent = without(parent, "name")
    for kind, other in _OTHER_KIND.items():
        if kind in parent:
            parent = parent | {kind: resolve(kind, parent[kind], parent_folder)}
        if other in table or _replaces(table.get(kind)):
            parent = without(parent, kind)
    merged = merge(parent, table)
    if "hand" in parent and isinstance(table.get("hand"), dict):
        merged = merged | {"hand": _merge_hand(parent["hand"], table["hand"], folder)}
    return merged, folder


def _open(kind: str, name: str, folder: Path, opened: _Opened, entry: str = "") -> tuple[Table, Path, _Opened]:
    """Return the table of a name or path, the folder that its paths start from, and the files opened so far."""
    table, path = _read(kind, name, folder, entry)
    identity = path.resolve()
    if identity in opened:
        entry = entry or ("extends" if kind == "scenario" else f"{kind}.base")
        raise InputError(entry, f"a {kind} cannot start from itself", name)
    if kind != "motor":
        table = {"name": as_name(Path(name).stem)} | table
    return table, path.parent, (*opened, identity)


def resolve(kind: str, value: Any, folder: Path, opened: _Opened = (), entry: str = "") -> Any:
    """Return the table of a finger, hand or motor given by name, by path, or as a table that may start from a base."""
    if isinstance(value, str):
        value, folder, opened = _open(kind, value, folder, opened, entry)
    if isinstance(value, Description) or (kind == "motor" and not isinstance(value, dict)):
        return value
    if not isinstance(value, dict):
        raise InputError(kind, f"must be the name of a {kind}, the path of a .toml file, or a table", value)
    top, base = without(value, "base"), {}
    if "base" in value:
        base = value["base"]
        if kind != "motor" and not isinstance(base, str if kind == "finger" else str | dict):
            raise InputError(f"{kind}.base", f"must be the name or path of a {kind}", base)
        base = as_table(resolve(kind, base, folder, opened, entry))
    if kind == "hand":
        return _merge_hand(base, top, folder)
    merged = merge(base, top)
    if kind == "finger" and "actuators" in merged:
        return merged | {"actuators": _with_motors(merged["actuators"], folder)}
    return merged


def _replaces(finger: Any) -> bool:
    """Return whether a finger or hand stands for itself, rather than for changes of the one that it is put on."""
    return isinstance(finger, str) or "base" in as_table(finger)


def _with_motors(actuators: Any, folder: Path) -> Any:
    """Return the actuators of a finger with the tables of their motors in place of names and paths."""
    motors = {
        name: {**each, "motor": resolve("motor", each["motor"], folder, entry=f"finger.actuators.{name}.motor")}
        for name, each in as_table(actuators).items()
        if isinstance(each, dict) and "motor" in each
    }
    return actuators | motors if motors else actuators


def _merge_hand(base: Table, hand: Table, folder: Path) -> Table:
    """Return the table of a hand merged with another on top.

    What is the name or path of a finger, and no table, is that finger where its place is the base's.
    """
    inherited, fingers = as_table(base.get("fingers")), as_table(hand.get("fingers"))
    for name, placed in fingers.items():
        if isinstance(placed, str) and placed != INHERIT_NOTHING:
            placed = {"finger": placed}
        finger = as_table(placed).get("finger")
        if not isinstance(finger, str | dict):
            continue
        try:
            fingers = fingers | {name: {**placed, "finger": resolve("finger", finger, folder)}}
        except InputError as error:
            raise InputError(f"hand.fingers.{name}.{error.entry}", error.allowed, error.value) from None
        if _replaces(finger) and name in inherited:
            inherited = inherited | {name: without(as_table(inherited[name]), "finger")}
    return merge(base | {"fingers": inherited} if inherited else base, hand | {"fingers": fingers} if fingers else hand)


def overridden(
    table: Table, overrides: Mapping[str, Any] | None, folder: Path = Path(), sections: Iterable[str] = ()
) -> Table:
    """Return a table with its finger or hand resolved, and overrides: other fingers before entries on top of them."""
    overrides = _normalised(overrides or {}, sections or Scenario.model_fields)
    whole = {key: value for key, value in overrides.items() if _OTHER_FINGER.fullmatch(key)}
    for kind, other in _OTHER_KIND.items():
        chosen = {key: whole[key] for key in (kind, f"{kind}.base") if key in whole}
        if chosen:
            table, whole = _applied(chosen, without(table, other)), without(whole, *chosen)
    entries = {key: value for key, value in overrides.items() if not _OTHER_FINGER.fullmatch(key)}
    for key in (*whole, *entries):
        refuse_other(key, hand="hand" in table, finger="finger" in table)
    kind = "hand" if "hand" in table else "finger"
    if kind not in table:
        raise InputError("finger", 'is missing; name a finger, such as finger = "ub", or describe one')
    table = table | {kind: resolve(kind, table[kind], folder)}
    if whole:
        table = _applied(_expand_wildcards(whole, table), table)
        table = table | {kind: resolve(kind, table[kind], folder)}
    entries = _expand_wildcards(entries, table)
    # A choice comes before what belongs to it, and a motor before its entries.
    first = (".kind", ".motor", ".law", ".drive")
    return _applied({key: entries[key] for key in sorted(entries, key=lambda key: not key.endswith(first))}, table)


def _expand_wildcards(overrides: Table, table: Table) -> Table:
    return {".".join(path): value for key, value in overrides.items() for path in match_paths(key.split("."), table)}


def refuse_other(key: str, *, hand: bool, finger: bool) -> None:
    """Refuse a key of a finger in a hand's scenario, and a key of a hand in a finger's."""
    if key.startswith("finger.") and hand:
        raise InputError(key, "there is a hand; keys of its fingers begin with hand.fingers.NAME.finger")
    if key.startswith("hand.") and finger:
        raise InputError(key, 'there is one finger; hand = "ub_hand" puts a hand in its place')


def _applied(overrides: Mapping[str, Any], table: Table) -> Table:
    """Return a table with values at dotted keys."""
    for key, value in overrides.items():
        table = _with_entry(table, tuple(key.split(".")), 0, value, table)
    return table


def _with_entry(whole: Table, key: tuple[str, ...], depth: int, value: Any, table: Table) -> Table:
    """Return the table at a depth of a key, with the value at its end; of a description on the way a table."""
    part, place, end = key[depth], key[: depth + 1], depth + 1 == len(key)
    below = table.get(part)
    if end and part == "kind" and isinstance(value, str) and is_other_kind(table, {"kind": value}):
        table = {}
    _refuse_new(place, table, whole)
    if not end:
        if isinstance(below, str) and part in ("finger", "hand"):
            below = {"base": below}
        if not isinstance(below, dict | Description | None):
            raise InputError(".".join(key), f"{'.'.join(place)} has no entries of its own", value)
        value = _with_entry(whole, key, depth + 1, value, as_table(below))
    elif isinstance(value, str) and value == INHERIT_NOTHING and part in table:
        return without(table, part)
    if place[-2:] == ("finger", "actuators"):
        value = _with_motors(value, Path())
    return without_unread(table, {part: value}) | {part: value}


def _refuse_new(path: tuple[str, ...], siblings: Table, table: Table) -> None:
    """Refuse an override that would bring a joint, a tendon or the like into being: only a file does."""
    owner, name = path[:-1], path[-1]
    if name in siblings:
        return
    finger = as_table(table.get("finger"))
    hand = {key: as_table(each).get("finger") for key, each in placed_fingers(table).items()}
    # A signal for a joint or a tendon that is there may have no entry of its own yet.
    present: dict[tuple[str, ...], tuple[str, Iterable[str]]] = {}
    for place, kind in _BY_NAME.items():
        present[place] = ("finger", hand) if hand else (kind, as_table(finger.get(f"{kind}s")))
        for key, table_of_finger in hand.items():
            present[*place, key] = kind, as_table(as_table(table_of_finger).get(f"{kind}s"))
    if hand := hand or as_table(as_table(finger.get("tree")).get("tips")):
        present |= {("controller", "fingers"): ("finger", hand), ("environment", "fingers"): ("finger", hand)}
    present["environment", "objects"] = "object", siblings
    field = find_field(Scenario, owner) if owner else None
    if owner not in present and (field is None or get_origin(field.annotation) is not dict):
        return
    kind, names = present.get(owner, (owner[-1].removesuffix("s"), siblings))
    if name not in names:
        allowed = f"no such {kind}; there are {', '.join(names) or 'none'}"
        if not names and (kind == "object" or owner not in present):
            allowed = f"{allowed}; {'.'.join(owner)} = {{ {name} = {{ ... }} }} puts it there"
        raise InputError(".".join(path), f"{allowed}{suggestion(name, names)}")


def _normalised(overrides: Mapping[str, Any], sections: Iterable[str]) -> Table:
    """Return overrides whose keys begin with a section, with the path of a finger's file made absolute."""
    checked: Table = {}
    if not isinstance(overrides, Mapping):
        raise InputError("overrides", 'must be values by dotted key, such as {"controller.gain": 2.0}', overrides)
    for key, value in _flatten_overrides(overrides):
        first, *rest = key.split(".")
        if first not in sections:
            nearest_section = nearest(first, sections)
            hint = f"; did you mean {'.'.join([nearest_section, *rest])}?" if nearest_section else ""
            raise InputError(key, f"unknown key; keys begin with {', '.join(sorted(sections))}{hint}")
        if _PLACE.fullmatch(key) and isinstance(value, str):
            # Another finger at the same place.
            key = f"{key}.finger"
        if _OTHER_FINGER.fullmatch(key):
            value = _absolute(value)
        checked[key] = value
    return checked


def _flatten_overrides(overrides: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield overrides, tables of a hand's fingers entry by entry: they go on top of earlier entries, as in a file."""
    for key, value in overrides.items():
        if isinstance(value, Mapping) and (key == "hand.fingers" or _PLACE.fullmatch(key)):
            yield from _flatten_overrides({f"{key}.{name}": entry for name, entry in value.items()})
        else:
            yield key, value


def _absolute(finger: Any) -> Any:
    if isinstance(finger, dict) and "base" in finger:
        return {**finger, "base": _absolute(finger["base"])}
    return str(expand(finger).absolute()) if isinstance(finger, str) and is_path(finger) else finger
