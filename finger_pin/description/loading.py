"""From TOML to validated descriptions: shipped data, a user's files, overrides, and one-line errors."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any, get_origin

import tomli_w

from finger_pin.description.columns import read_columns
from finger_pin.description.hand import HandDescription
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, find_field, nearest, validate
from finger_pin.exceptions import InputError

Table = dict[str, Any]
# Sections that may name a CSV file, the key that does, and where its columns go.
_SIGNAL_FILES = (
    ("reference", "file", "joints"),
    ("controller", "file", "tensions"),
    ("environment", "fingertip_force_file", "fingertip_force_signal"),
)
# Kinds whose entries mean nothing to another kind: a table of one replaces, rather than completes, one of another.
_KINDS_APART = {"step", "ramp", "points", "samples", "tensions"}
_LARGEST = 10_000_000
# Keys that put another finger or hand in place of what there is.
_OTHER_FINGER = re.compile(r"(hand|finger|hand\.fingers\.[^.]+\.finger)(\.base)?")
# Tables by joint or tendon, and which of the two.
_BY_NAME = {
    ("reference", "joints"): "joint",
    ("controller", "tensions"): "tendon",
    ("simulation", "initial", "position"): "joint",
    ("simulation", "initial", "velocity"): "joint",
}


def list_fingers() -> dict[str, str]:
    """Return the fingers that ship with the package, with a line about each."""
    return _shipped("fingers")


def list_hands() -> dict[str, str]:
    """Return the hands that ship with the package, with a line about each."""
    return _shipped("hands")


def list_scenarios() -> dict[str, str]:
    """Return the scenarios that ship with the package, with a line about each."""
    return _shipped("scenarios")


def list_motors() -> dict[str, str]:
    """Return the motors that ship with the package, with a line about each."""
    return _shipped("motors")


def load_finger(name: str | Path, overrides: Mapping[str, Any] | None = None) -> FingerDescription:
    """Load a finger by the name of a shipped one or the path of a TOML file.

    Args:
        name: Such as ``ub`` or ``my_finger.toml``.
        overrides: Values by dotted key, such as ``{"finger.joints.distal.link.length": 0.025}``.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    overrides = _from_here(overrides or {}, {"finger"})
    table: Table = {"finger": str(name)}
    with _depth_limited("finger"):
        _override(overrides, table, Path())
        return validate(FingerDescription, table["finger"], ("finger",))


def load_hand(name: str | Path, overrides: Mapping[str, Any] | None = None) -> HandDescription:
    """Load a hand by the name of a shipped one or the path of a TOML file.

    Args:
        name: Such as ``ub_hand`` or ``my_hand.toml``.
        overrides: Values by dotted key, such as ``{"hand.fingers.thumb.scale": 1.1}``.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    overrides = _from_here(overrides or {}, {"hand"})
    table: Table = {"hand": str(name)}
    with _depth_limited("hand"):
        _override(overrides, table, Path())
        return validate(HandDescription, table["hand"], ("hand",))


def load_scenario(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Load a scenario by the name of a shipped one or the path of a TOML file.

    A scenario file may say ``extends = "fig6"`` to start from another scenario, and ``finger = "ub"`` or, to change
    some of a finger, ``[finger]`` with ``base = "ub"`` and further entries. ``hand`` takes the place of ``finger``
    where there are several; each of ``hand.fingers`` has a ``finger`` of its own.

    Args:
        name: Such as ``fig6`` or ``my_scenario.toml``.
        overrides: Values by dotted key, such as ``{"controller.gain": 2.0}``; they win over the file. A star stands for
            every name, as in ``finger.actuators.*.spool_radius``. Paths among them are relative to the working
            directory, paths in a file to the file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    overrides = _from_here(overrides or {}, set(Scenario.model_fields))
    with _depth_limited("scenario"):
        table, folder = _read_scenario(str(name), Path())
        table.setdefault("name", _as_name(Path(str(name)).stem))
        _override(overrides, table, folder)
        _resolve_signals(table, Path())
        return validate(Scenario, table, ())


def read_scenario(table: Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Return the scenario that a table describes, as `load_scenario` returns that of a file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    checked, whole = _from_here(overrides or {}, set(Scenario.model_fields)), copy.deepcopy(dict(table))
    with _depth_limited("scenario"):
        _override(checked, whole, Path())
        _resolve_signals(whole, Path())
        return validate(Scenario, whole, ())


def to_toml(description: Description) -> str:
    """Return the TOML text of a description, complete: reading it gives the same description back."""
    if isinstance(description, FingerDescription) and description.hand is not None:
        description = description.hand
    return tomli_w.dumps(_plain(description.model_dump(mode="python", exclude_none=True)))


def _shipped(kind: str) -> dict[str, str]:
    found = {}
    for entry in sorted(resources.files("finger_pin.description").joinpath(kind).iterdir(), key=lambda item: item.name):
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = str(tomllib.loads(entry.read_text("utf-8")).get("title", ""))
    return found


def _read(kind: str, name: str, folder: Path) -> tuple[Table, Path]:
    """Return the table of a shipped item or of a file relative to a folder, and the path that it was read from."""
    if _is_path(name):
        what, path = f"{kind} file {name}", folder / _expand(name)
        data = _read_bytes(what, path)
    else:
        what, path = f"{kind} {name}", Path(name)
        names = _shipped(f"{kind}s")
        if name not in names:
            allowed = f"no such {kind}; there are {', '.join(names)}, or the path of a .toml file{_hint(name, names)}"
            raise InputError(kind, allowed, name)
        data = resources.files("finger_pin.description").joinpath(f"{kind}s/{name}.toml").read_bytes()
    try:
        return tomllib.loads(data.decode("utf-8-sig")), path
    except UnicodeDecodeError:
        raise InputError(what, "is not a text file in UTF-8") from None
    except RecursionError:
        raise InputError(what, "is nested too deeply") from None
    except ValueError as error:
        raise InputError(what, f"is not valid TOML: {error}") from None


def _is_path(name: str) -> bool:
    return name.endswith(".toml") or "/" in name or "\\" in name


def _expand(name: str) -> Path:
    """Return a path with the home folder in place of ~, or as it is where there is no such home."""
    try:
        return Path(name).expanduser()
    except RuntimeError:
        return Path(name)


def _read_bytes(what: str, path: Path) -> bytes:
    try:
        with open(path, "rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise InputError(what, "there is no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(what, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > _LARGEST:
        raise InputError(what, f"is larger than {_LARGEST} bytes")
    return data


def _read_scenario(name: str, folder: Path, seen: tuple[Path, ...] = ()) -> tuple[Table, Path]:
    """Return the table of a scenario on top of the ones that it extends, and the folder that it lies in."""
    table, path = _read("scenario", name, folder)
    identity = path.resolve()
    if identity in seen:
        raise InputError("extends", "a scenario cannot start from itself", name)
    folder = path.parent
    _resolve_signals(table, folder)
    if "extends" not in table:
        return table, folder
    base = table.pop("extends")
    if not isinstance(base, str):
        raise InputError("extends", "must be the name or path of another scenario", base)
    parent, parent_folder = _read_scenario(base, folder, (*seen, identity))
    parent.pop("name", None)
    if "finger" in parent:
        parent["finger"] = _resolve_finger(parent["finger"], parent_folder)
    if "hand" in parent:
        parent["hand"] = _resolve_hand(parent["hand"], parent_folder)
    whole = isinstance(table.get("finger"), str) or "base" in _as_table(table.get("finger"))
    if "hand" in table or whole:
        parent.pop("finger", None)
    if "finger" in table or isinstance(table.get("hand"), str) or "base" in _as_table(table.get("hand")):
        parent.pop("hand", None)
    if "hand" in parent and "hand" in table:
        table["hand"] = _on_top(parent.pop("hand"), table["hand"], folder)
    return _merge(parent, table), folder


def _resolve_finger(finger: Any, folder: Path, seen: tuple[Path, ...] = ()) -> Any:
    """Return the table of a finger given by name, by path, or as a table that may start from a base."""
    if isinstance(finger, str):
        table, path = _read("finger", finger, folder)
        identity = path.resolve()
        if identity in seen:
            raise InputError("finger.base", "a finger cannot start from itself", finger)
        table.setdefault("name", _as_name(Path(finger).stem))
        return _resolve_finger(table, path.parent, (*seen, identity))
    if isinstance(finger, dict) and "base" in finger:
        rest = dict(finger)
        base = rest.pop("base")
        if not isinstance(base, str):
            raise InputError("finger.base", "must be the name or path of a finger", base)
        return _with_motors(_merge(_resolve_finger(base, folder, seen), rest), folder)
    if not isinstance(finger, dict):
        raise InputError("finger", "must be the name of a finger, the path of a .toml file, or a table", finger)
    return _with_motors(finger, folder)


def _with_motors(finger: Table, folder: Path) -> Table:
    """Put the table of every motor of a finger where its name or path may stand; return the finger."""
    for actuator in _as_table(finger.get("actuators")).values():
        if isinstance(actuator, dict) and "motor" in actuator:
            actuator["motor"] = _resolve_motor(actuator["motor"], folder)
    return finger


def _resolve_motor(motor: Any, folder: Path) -> Any:
    """Return the table of a motor given by name, by path, or as a table that may start from a base."""
    if isinstance(motor, str):
        table, path = _read("motor", motor, folder)
        return _resolve_motor(table, path.parent)
    if isinstance(motor, dict) and "base" in motor:
        rest = dict(motor)
        return _merge(_as_table(_resolve_motor(rest.pop("base"), folder)), rest)
    return motor


def _resolve_hand(hand: Any, folder: Path, seen: tuple[Path, ...] = ()) -> Any:
    """Return the table of a hand given by name, by path, or as a table that may start from a base."""
    if isinstance(hand, str):
        table, path = _read("hand", hand, folder)
        identity = path.resolve()
        if identity in seen:
            raise InputError("hand.base", "a hand cannot start from itself", hand)
        table.setdefault("name", _as_name(Path(hand).stem))
        return _resolve_hand(table, path.parent, (*seen, identity))
    if not isinstance(hand, dict):
        raise InputError("hand", "must be the name of a hand, the path of a .toml file, or a table", hand)
    rest = dict(hand)
    base = rest.pop("base", {})
    if not isinstance(base, str | dict):
        raise InputError("hand.base", "must be the name or path of a hand", base)
    return _on_top(_resolve_hand(base, folder, seen) if base else {}, rest, folder)


def _on_top(base: Table, hand: Table, folder: Path) -> Table:
    """Return the table of a hand with another on top, whose fingers may be other ones altogether."""
    for name, placed in _as_table(_as_table(hand).get("fingers")).items():
        finger = _as_table(placed).get("finger")
        if isinstance(finger, str) or "base" in _as_table(finger):
            with _named(f"hand.fingers.{name}."):
                placed["finger"] = _resolve_finger(finger, folder)
            _as_table(_as_table(base.get("fingers")).get(name)).pop("finger", None)
    return _merge(base, hand)


@contextmanager
def _named(owner: str) -> Iterator[None]:
    """Put the owner of a finger before the entries that errors name."""
    try:
        yield
    except InputError as error:
        raise InputError(owner + error.entry, error.allowed, error.value) from None


def _resolve_signals(table: Table, folder: Path) -> None:
    """Put the columns of CSV files where a file may say them itself: as samples of signals by name."""
    for section, key, target in _SIGNAL_FILES:
        settings = table.get(section)
        if not isinstance(settings, dict) or key not in settings:
            continue
        name = settings.pop(key)
        entry = f"{section}.{key}"
        if not isinstance(name, str):
            raise InputError(entry, "must be the path of a CSV file", name)
        try:
            text = _read_bytes(f"{entry} {name}", folder / _expand(name)).decode("utf-8-sig")
        except UnicodeDecodeError:
            raise InputError(f"{entry} {name}", "is not a text file in UTF-8") from None
        times, *columns = read_columns(f"{entry} {name}", text).items()
        samples = {name: {"kind": "samples", "times": times[1], "values": values} for name, values in columns}
        settings[target] = {**_as_table(settings.get(target)), **samples}


def _is_other_kind(base: Table, top: Table) -> bool:
    """Return whether a signal or controller is of another kind than the one that it is put on."""
    kinds = {base.get("kind"), top["kind"]} if "kind" in top else set()
    return len(kinds) == 2 and not _KINDS_APART.isdisjoint(kinds)


def _merge(base: Table, top: Table) -> Table:
    merged = dict(base)
    for key, value in top.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict) and not _is_other_kind(merged[key], value)
        # A table that names its base starts from that one.
        merged[key] = _merge(merged[key], value) if both and "base" not in value else value
    return merged


def _override(overrides: Table, table: Table, folder: Path) -> None:
    """Resolve the fingers of a table, and apply overrides: other fingers before entries on top of them."""
    whole = {key: value for key, value in overrides.items() if _OTHER_FINGER.fullmatch(key)}
    for key in whole:
        del overrides[key]
    for kind, other in (("hand", "finger"), ("finger", "hand")):
        given = {key: whole.pop(key) for key in (kind, f"{kind}.base") if key in whole}
        if given:
            table.pop(other, None)
        _apply(given, table)
    if "hand" in table:
        table["hand"] = _resolve_hand(table["hand"], folder)
        _apply(whole, table)
        table["hand"] = _resolve_hand(table["hand"], folder)
    elif "finger" not in table:
        raise InputError("finger", 'is missing; name a finger, such as finger = "ub", or describe one')
    else:
        table["finger"] = _resolve_finger(table["finger"], folder)
    spelt_out = {each: value for key, value in overrides.items() for each in _each(key, table)}
    # A kind comes before what belongs to it, and a motor before its entries.
    first = (".kind", ".motor")
    for early in (True, False):
        _apply({key: value for key, value in spelt_out.items() if key.endswith(first) == early}, table)
        for finger in [each.get("finger") for each in _fingers(table).values()] or [table.get("finger")]:
            _with_motors(_as_table(finger), Path())


def _each(key: str, table: Table) -> list[str]:
    """Return the keys that a key stands for, in which a star stands for every name."""
    head, star, tail = key.partition("*")
    if not star:
        return [key]
    inner = table
    for part in head.split(".")[:-1]:
        inner = _as_table(inner.get(part))
    if not inner:
        raise InputError(key, "there is nothing that the star could stand for")
    return [found for name in inner for found in _each(f"{head}{name}{tail}", table)]


def _apply(overrides: Mapping[str, Any], table: Table) -> None:
    for key, value in overrides.items():
        *path, last = key.split(".")
        inner = table
        for depth, part in enumerate(path):
            _refuse_new([*path[:depth], part], inner, table)
            below = inner.setdefault(part, {})
            if isinstance(below, str) and part in ("finger", "hand"):
                below = inner[part] = {"base": below}
            if not isinstance(below, dict):
                raise InputError(key, f"{'.'.join(path[: depth + 1])} has no entries of its own", value)
            inner = below
        if last == "kind" and isinstance(value, str) and _is_other_kind(inner, {"kind": value}):
            inner.clear()
        _refuse_new([*path, last], inner, table)
        inner[last] = copy.deepcopy(value)


def _refuse_new(path: list[str], siblings: Table, table: Table) -> None:
    """Raise where an override would bring a joint, a tendon or the like into being: only a file does."""
    *owner, name = path
    finger = _as_table(table.get("finger"))
    hand = {key: _as_table(each).get("finger") for key, each in _fingers(table).items()}
    # A signal for a joint or a tendon that is there may have no entry of its own yet.
    present: dict[tuple[str, ...], tuple[str, Iterable[str]]] = {}
    for place, what in _BY_NAME.items():
        present[place] = ("finger", hand) if hand else (what, _as_table(finger.get(f"{what}s")))
        for key, each in hand.items():
            present[*place, key] = what, _as_table(_as_table(each).get(f"{what}s"))
    if hand:
        present |= {("controller", "fingers"): ("finger", hand), ("environment", "fingers"): ("finger", hand)}
    field = find_field(Scenario, owner) if owner else None
    if tuple(owner) not in present and (field is None or get_origin(field.annotation) is not dict):
        return
    what, names = present.get(tuple(owner), (owner[-1].removesuffix("s"), siblings))
    if name not in names:
        allowed = f"no such {what}; there are {', '.join(names) or 'none'}"
        raise InputError(".".join(path), f"{allowed}{_hint(name, names)}")


def _fingers(table: Table) -> Table:
    return _as_table(_as_table(table.get("hand")).get("fingers"))


def _from_here(overrides: Mapping[str, Any], allowed: set[str]) -> Table:
    """Return overrides whose keys begin with an allowed one, with the path of a finger's file made absolute."""
    checked: Table = {}
    for key, value in overrides.items():
        first, *rest = key.split(".")
        if first not in allowed:
            near = nearest(first, allowed)
            hint = f"; did you mean {'.'.join([near, *rest])}?" if near else ""
            raise InputError(key, f"unknown key; keys begin with {', '.join(sorted(allowed))}{hint}")
        if _OTHER_FINGER.fullmatch(key):
            value = _absolute(value)
        if key.endswith("finger") and isinstance(value, dict) and "base" in value:
            value = {**value, "base": _absolute(value["base"])}
        checked[key] = value
    return checked


def _absolute(finger: Any) -> Any:
    return str(_expand(finger).absolute()) if isinstance(finger, str) and _is_path(finger) else finger


@contextmanager
def _depth_limited(what: str) -> Iterator[None]:
    try:
        yield
    except RecursionError:
        raise InputError(what, "is nested too deeply") from None


def _hint(name: Any, names: Iterable[str]) -> str:
    near = nearest(name, names)
    return f"; did you mean {near}?" if near else ""


def _as_table(value: Any) -> Table:
    return value if isinstance(value, dict) else {}


def _as_name(stem: str) -> str:
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]
    return name if re.match(r"[A-Za-z]", name) else f"scenario_{name}"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
