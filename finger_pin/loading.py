"""From TOML to validated descriptions: shipped data, a user's files, overrides, and errors a person can act on."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, NoReturn, TypeVar, get_args

import tomli_w
from pydantic import BaseModel, ValidationError

from finger_pin.exceptions import InputError
from finger_pin.parameters import FingerDescription
from finger_pin.scenario import Scenario
from finger_pin.validation import Description, nearest

_Model = TypeVar("_Model", bound=Description)
Table = dict[str, Any]


def list_fingers() -> dict[str, str]:
    """Return the fingers that ship with the package, with a line about each."""
    return _shipped("fingers")


def list_scenarios() -> dict[str, str]:
    """Return the scenarios that ship with the package, with a line about each."""
    return _shipped("scenarios")


def load_finger(name: str | Path, overrides: Mapping[str, Any] | None = None) -> FingerDescription:
    """Load a finger by the name of a shipped one or the path of a TOML file.

    Args:
        name: Such as ``ub`` or ``my_finger.toml``.
        overrides: Values by dotted key, such as ``{"finger.joints.distal.link.length": 0.025}``.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    table: Table = {"finger": str(name)}
    _apply({key: value for key, value in (overrides or {}).items() if _root(key, {"finger"})}, table)
    return _validate(FingerDescription, _resolve_finger(table["finger"], Path()), ("finger",))


def load_scenario(name: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Load a scenario by the name of a shipped one or the path of a TOML file.

    A scenario file may say ``extends = "fig6"`` to start from another scenario, and ``finger = "ub"`` or, to change
    some of a finger, ``[finger]`` with ``base = "ub"`` and further entries.

    Args:
        name: Such as ``fig6`` or ``my_scenario.toml``.
        overrides: Values by dotted key, such as ``{"controller.gain": 2.0}``; they win over the file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    table, folder = _read_scenario(str(name), Path(), [])
    table.setdefault("name", _as_name(Path(str(name)).stem))
    overrides = dict(overrides or {})
    # Another finger replaces the old one before entries on top of either are applied.
    _apply({key: overrides.pop(key) for key in ("finger", "finger.base") if key in overrides}, table)
    if "finger" not in table:
        raise InputError("finger", 'is missing; name a finger, such as finger = "ub", or describe one')
    table["finger"] = _resolve_finger(table["finger"], folder)
    _apply({key: value for key, value in overrides.items() if _root(key, set(Scenario.model_fields))}, table)
    return _validate(Scenario, table, ())


def to_toml(description: Description) -> str:
    """Return the TOML text of a description, complete: reading it gives the same description back."""
    return tomli_w.dumps(_plain(description.model_dump(mode="python", exclude_none=True)))


def _shipped(kind: str) -> dict[str, str]:
    found = {}
    for entry in sorted(resources.files("finger_pin").joinpath(kind).iterdir(), key=lambda item: item.name):
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = str(tomllib.loads(entry.read_text("utf-8")).get("title", ""))
    return found


def _read(kind: str, name: str, folder: Path) -> tuple[Table, Path]:
    """Return the table of a shipped item or of a file relative to a folder, and the file's folder."""
    if name.endswith(".toml") or "/" in name or "\\" in name:
        path = folder / Path(name).expanduser()
        try:
            text = path.read_bytes().decode("utf-8")
        except FileNotFoundError:
            raise InputError(f"{kind} file {name}", "there is no such file") from None
        except UnicodeDecodeError:
            raise InputError(f"{kind} file {name}", "is not a text file in UTF-8") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{kind} file {name}", f"cannot be read: {reason}") from None
        folder = path.parent
    else:
        entry = resources.files("finger_pin").joinpath(f"{kind}s/{name}.toml")
        if not re.fullmatch(r"[A-Za-z0-9_]+", name) or not entry.is_file():
            names = _shipped(f"{kind}s")
            near = nearest(name, names)
            hint = f"; did you mean {near}?" if near else ""
            allowed = f"no such {kind}; there are {', '.join(names)}, or the path of a .toml file{hint}"
            raise InputError(kind, allowed, name)
        text = entry.read_text("utf-8")
    try:
        return tomllib.loads(text), folder
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{kind} file {name}", f"is not valid TOML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise InputError(f"{kind} file {name}", "is nested too deeply") from None


def _read_scenario(name: str, folder: Path, seen: list[str]) -> tuple[Table, Path]:
    table, folder = _read("scenario", name, folder)
    if "extends" not in table:
        return table, folder
    base = table.pop("extends")
    if not isinstance(base, str) or base in seen:
        raise InputError("extends", "must be the name or path of another scenario, without a circle", base)
    parent, parent_folder = _read_scenario(base, folder, [*seen, base])
    parent.pop("name", None)
    if "finger" in parent:
        parent["finger"] = _resolve_finger(parent["finger"], parent_folder)
    if isinstance(table.get("finger"), str) or "base" in _as_table(table.get("finger")):
        parent.pop("finger", None)
    return _merge(parent, table), folder


def _resolve_finger(finger: Any, folder: Path, seen: tuple[str, ...] = ()) -> Any:
    """Return the table of a finger given by name, by path, or as a table that may start from a base."""
    if isinstance(finger, str):
        if finger in seen or len(seen) > 20:
            raise InputError("finger.base", "a finger cannot start from itself", finger)
        table, folder = _read("finger", finger, folder)
        table.setdefault("name", _as_name(Path(finger).stem))
        return _resolve_finger(table, folder, (*seen, finger))
    if isinstance(finger, dict) and "base" in finger:
        rest = dict(finger)
        base = rest.pop("base")
        if not isinstance(base, str):
            raise InputError("finger.base", "must be the name or path of a finger", base)
        return _merge(_resolve_finger(base, folder, seen), rest)
    return finger


def _merge(base: Table, top: Table) -> Table:
    merged = dict(base)
    for key, value in top.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merge(merged[key], value) if both else value
    return merged


def _apply(overrides: Mapping[str, Any], table: Table) -> None:
    for key, value in overrides.items():
        *path, last = key.split(".")
        inner = table
        for depth, part in enumerate(path):
            below = inner.setdefault(part, {})
            if isinstance(below, str) and path[: depth + 1] == ["finger"]:
                below = inner[part] = {"base": below}
            if not isinstance(below, dict):
                raise InputError(key, f"{'.'.join(path[: depth + 1])} has no entries of its own", value)
            inner = below
        inner[last] = copy.deepcopy(value)


def _root(key: str, allowed: set[str]) -> bool:
    first = key.split(".")[0]
    if first in allowed:
        return True
    near = nearest(first, allowed)
    hint = f"; did you mean {'.'.join([near, *key.split('.')[1:]])}?" if near else ""
    raise InputError(key, f"unknown key; keys begin with {', '.join(sorted(allowed))}{hint}")


def _validate(model: type[_Model], table: Any, prefix: tuple[str, ...]) -> _Model:
    try:
        return model.model_validate(table)
    except ValidationError as error:
        _translate(model, error, prefix)


def _translate(model: type[BaseModel], error: ValidationError, prefix: tuple[str, ...]) -> NoReturn:
    # A misspelt key also makes the right one missing: the cause comes first.
    found = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    location = [str(part) for part in found["loc"] if part != "[key]"]
    entry = ".".join([*prefix, *location])
    given = found["input"]
    value = None if isinstance(given, dict) else given
    if found["type"] == "entry":
        context = found["ctx"]
        below = str(context["entry"])
        entry = f"{entry}{'' if below.startswith('[') or not below or not entry else '.'}{below}"
        raise InputError(entry, context["allowed"], context["value"]) from None
    if found["type"] == "extra_forbidden":
        names = sorted(_fields(model, location[:-1]))
        near = nearest(location[-1], names)
        hint = f"; did you mean {'.'.join([*prefix, *location[:-1], near])}?" if near else ""
        raise InputError(entry, f"unknown key; allowed here: {', '.join(names)}{hint}") from None
    if found["type"] == "missing":
        raise InputError(entry, f"is missing: {_document(model, location)}") from None
    message = found["msg"]
    raise InputError(entry, _MESSAGES.get(found["type"], message[:1].lower() + message[1:]), value) from None


_MESSAGES = {
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "string_type": "must be a string",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
    "string_pattern_mismatch": "names are letters, digits and underscores, and begin with a letter",
    "string_too_long": "is too long",
    "too_short": "must have at least one entry",
    "greater_than_equal": "must be at least 0",
}


def _fields(model: type[BaseModel], location: Iterable[str]) -> list[str]:
    """Return the field names of the model found by following a location through nested models and tables."""
    current: Any = model
    for part in location:
        if isinstance(current, type) and issubclass(current, BaseModel):
            current = _inner(current.model_fields[part].annotation)
        elif isinstance(current, dict):
            current = current["values"]
    return list(current.model_fields) if isinstance(current, type) and issubclass(current, BaseModel) else []


def _inner(annotation: Any) -> Any:
    """Return the model behind an annotation; for a table of models, a dictionary that says so."""
    arguments = get_args(annotation)
    if getattr(annotation, "__origin__", None) is dict:
        return {"values": _inner(arguments[1])}
    models = [each for each in (annotation, *arguments) if isinstance(each, type) and issubclass(each, BaseModel)]
    return models[0] if models else annotation


def _document(model: type[BaseModel], location: list[str]) -> str:
    owner: Any = model
    for part in location[:-1]:
        owner = _inner(owner.model_fields[part].annotation) if not isinstance(owner, dict) else owner["values"]
    return str(owner.model_fields[location[-1]].description or "a table")


def _as_table(value: Any) -> Table:
    return value if isinstance(value, dict) else {}


def _as_name(stem: str) -> str:
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]
    return name if re.match(r"[A-Za-z]", name) else f"scenario_{name}"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
