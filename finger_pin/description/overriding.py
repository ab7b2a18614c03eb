"""Overrides: values by dotted key, put into the tables of files or of a description that is there."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_origin

from finger_pin.description.effects import without_unread
from finger_pin.description.fields import find_field
from finger_pin.description.reading import NONE, is_other_kind, is_path, resolve_finger, resolve_hand, with_motors
from finger_pin.description.recordings.signal_files import fingers_of
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, Table, as_table, nearest, suggestion
from finger_pin.exceptions import InputError
from finger_pin.files import expand

# Keys that put another finger or hand in place of what there is.
_OTHER_FINGER = re.compile(r"(hand|finger|hand\.fingers\.[^.]+\.finger)(\.base)?")
_PLACE = re.compile(r"hand\.fingers\.[^.]+")
# Tables by joint or tendon, and which of the two.
_BY_NAME = {
    ("reference", "joints"): "joint",
    ("controller", "tensions"): "tendon",
    ("simulation", "initial", "position"): "joint",
    ("simulation", "initial", "velocity"): "joint",
}


def override(overrides: Table, table: Table, folder: Path) -> None:
    """Resolve the fingers of a table, and apply overrides: other fingers before entries on top of them."""
    whole = {key: value for key, value in overrides.items() if _OTHER_FINGER.fullmatch(key)}
    for key in whole:
        del overrides[key]
    for kind, other in (("hand", "finger"), ("finger", "hand")):
        chosen = {key: whole.pop(key) for key in (kind, f"{kind}.base") if key in whole}
        if chosen:
            table.pop(other, None)
        _apply(chosen, table)
    for key in (*whole, *overrides):
        refuse_other(key, hand="hand" in table, finger="finger" in table)
    if "hand" in table:
        table["hand"] = resolve_hand(table["hand"], folder)
        _apply(_expand_wildcards(whole, table), table)
        table["hand"] = resolve_hand(table["hand"], folder)
    elif "finger" not in table:
        raise InputError("finger", 'is missing; name a finger, such as finger = "ub", or describe one')
    else:
        table["finger"] = resolve_finger(table["finger"], folder)
    entries = _expand_wildcards(overrides, table)
    # A choice comes before what belongs to it, and a motor before its entries.
    first = (".kind", ".motor", ".law", ".drive")
    for early in (True, False):
        _apply({key: value for key, value in entries.items() if key.endswith(first) == early}, table)
        for owner in fingers_of(table).values() or [table]:
            with_motors(as_table(as_table(owner).get("finger")), Path())


def _expand_wildcards(overrides: Table, table: Table) -> Table:
    return {".".join(path): value for key, value in overrides.items() for path in matching_paths(key.split("."), table)}


def matching_paths(pattern: Sequence[str], table: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the paths of a key's pattern: a star stands for every name there is, ``{T1,T2}`` for these.

    Raises:
        InputError: If there is nothing that a star could stand for.
    """
    if not pattern:
        yield above
        return
    part, *rest = pattern
    names = [*as_table(table)] if part == "*" else part.strip("{}").split(",") if part.startswith("{") else [part]
    if not names:
        raise InputError(".".join((*above, *pattern)), "there is nothing that the star could stand for")
    for name in names:
        yield from matching_paths(rest, as_table(table).get(name), (*above, name))


def refuse_other(key: str, *, hand: bool, finger: bool) -> None:
    """Refuse a key of a finger in a hand's scenario, and a key of a hand in a finger's."""
    if key.startswith("finger.") and hand:
        raise InputError(key, "there is a hand; keys of its fingers begin with hand.fingers.NAME.finger")
    if key.startswith("hand.") and finger:
        raise InputError(key, 'there is one finger; hand = "ub_hand" puts a hand in its place')


def _apply(overrides: Mapping[str, Any], table: Table) -> None:
    for key, value in overrides.items():
        *path, last = key.split(".")
        inner = table
        for depth, part in enumerate(path):
            _refuse_new([*path[:depth], part], inner, table)
            below = inner.get(part)
            if isinstance(below, str) and part in ("finger", "hand"):
                below = {"base": below}
            if not isinstance(below, dict | Description | None):
                raise InputError(key, f"{'.'.join(path[: depth + 1])} has no entries of its own", value)
            # Of a description what lies on the way becomes a table; all else stays, checked.
            inner[part] = inner = as_table(below)
        if last == "kind" and isinstance(value, str) and is_other_kind(inner, {"kind": value}):
            inner.clear()
        _refuse_new([*path, last], inner, table)
        read = without_unread(inner, {last: value})
        for unread in inner.keys() - read.keys():
            del inner[unread]
        if last in inner and isinstance(value, str) and value == NONE:
            del inner[last]
        else:
            inner[last] = copy.deepcopy(value)


def _refuse_new(path: list[str], siblings: Table, table: Table) -> None:
    """Refuse an override that would bring a joint, a tendon or the like into being: only a file does."""
    *owner, name = path
    if name in siblings:
        return
    finger = as_table(table.get("finger"))
    hand = {key: as_table(each).get("finger") for key, each in fingers_of(table).items()}
    # A signal for a joint or a tendon that is there may have no entry of its own yet.
    present: dict[tuple[str, ...], tuple[str, Iterable[str]]] = {}
    for place, what in _BY_NAME.items():
        present[place] = ("finger", hand) if hand else (what, as_table(finger.get(f"{what}s")))
        for key, table_of_finger in hand.items():
            present[*place, key] = what, as_table(as_table(table_of_finger).get(f"{what}s"))
    tips = {} if hand else as_table(as_table(finger.get("tree")).get("tips"))
    if hand or tips:
        hand = hand or tips
        present |= {("controller", "fingers"): ("finger", hand), ("environment", "fingers"): ("finger", hand)}
    present["environment", "objects"] = "object", siblings
    field = find_field(Scenario, owner) if owner else None
    if tuple(owner) not in present and (field is None or get_origin(field.annotation) is not dict):
        return
    what, names = present.get(tuple(owner), (owner[-1].removesuffix("s"), siblings))
    if name not in names:
        allowed = f"no such {what}; there are {', '.join(names) or 'none'}"
        if not names and (what == "object" or tuple(owner) not in present):
            allowed = f"{allowed}; {'.'.join(owner)} = {{ {name} = {{ ... }} }} puts it there"
        raise InputError(".".join(path), f"{allowed}{suggestion(name, names)}")


def normalise_overrides(overrides: Mapping[str, Any], allowed: set[str]) -> Table:
    """Return overrides whose keys begin with an allowed one, with the path of a finger's file made absolute."""
    checked: Table = {}
    if not isinstance(overrides, Mapping):
        raise InputError("overrides", 'must be values by dotted key, such as {"controller.gain": 2.0}', overrides)
    for key, value in _flatten_overrides(overrides):
        first, *rest = key.split(".")
        if first not in allowed:
            near = nearest(first, allowed)
            hint = f"; did you mean {'.'.join([near, *rest])}?" if near else ""
            raise InputError(key, f"unknown key; keys begin with {', '.join(sorted(allowed))}{hint}")
        if _PLACE.fullmatch(key) and isinstance(value, str):
            # Another finger at the same place.
            key = f"{key}.finger"
        if _OTHER_FINGER.fullmatch(key):
            value = _absolute(value)
        if key.endswith("finger") and isinstance(value, dict) and "base" in value:
            value = {**value, "base": _absolute(value["base"])}
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
    return str(expand(finger).absolute()) if isinstance(finger, str) and is_path(finger) else finger
