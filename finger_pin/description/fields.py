"""Fields of descriptions, by a location through nested models and tables, and tables as files nest them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo


def field_names(model: type[BaseModel], location: Iterable[str]) -> list[str]:
    """Return the field names of the model found by following a location through nested models and tables."""
    found = _model_at(model, location)
    return [*getattr(found, "model_fields", ()), *getattr(found, "file_keys", ())]


def find_field(model: type[BaseModel], location: Sequence[str]) -> FieldInfo | None:
    """Return the field at a location through nested models and tables, or None if there is none."""
    field: FieldInfo | None = getattr(_model_at(model, location[:-1]), "model_fields", {}).get(location[-1])
    return field


def unit_of(field: FieldInfo | None) -> str:
    """Return the unit of a field, empty where it has none."""
    extra = field.json_schema_extra if field is not None else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def _model_at(model: type[BaseModel], location: Iterable[str]) -> Any:
    """Return what is at a location, a model if there is one; for a table of models, a dictionary that says so."""
    found: Any = model
    for part in location:
        fields = getattr(found, "model_fields", {})
        found = (
            found["values"] if isinstance(found, dict) else _inner(fields[part].annotation if part in fields else None)
        )
    return found


def _inner(annotation: Any) -> Any:
    """Return the model behind an annotation; for a table of models, a dictionary that says so."""
    arguments = get_args(annotation)
    tables = [each for each in (annotation, *arguments) if getattr(each, "__origin__", None) is dict]
    if tables:
        return {"values": _inner(get_args(tables[0])[1])}
    models = [each for each in (annotation, *arguments) if isinstance(each, type) and issubclass(each, BaseModel)]
    return models[0] if models else annotation


def document(model: type[BaseModel], location: Sequence[str]) -> str:
    """Return what the field at a location is, in words."""
    field = find_field(model, location)
    return str(field.description if field and field.description else "a table")


def without(table: Mapping[str, Any], *entries: str) -> dict[str, Any]:
    """Return a table less some entries."""
    return {name: value for name, value in table.items() if name not in entries}


def nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``{index.medial = ...}`` as ``{index = {medial = ...}}``, as files have it."""
    if "." not in "".join(table):
        return dict(table)
    outer: dict[str, Any] = {}
    for name, value in table.items():
        finger, dot, inner = name.partition(".")
        if dot:
            outer.setdefault(finger, {})[inner] = value
        else:
            outer[name] = value
    return outer


def flatten(table: Any, numbers: bool = False) -> Any:
    """Return ``{index = {medial = ...}}`` as ``{index.medial = ...}``, the inverse of `nested`.

    Entries are tables, so that a table of tables is that of a finger; or ``numbers``, so that every table is.
    """
    if not isinstance(table, dict):
        return table
    flat = {}
    for name, value in table.items():
        if (
            isinstance(value, dict)
            and value
            and (numbers or all(isinstance(v, dict | BaseModel) for v in value.values()))
        ):
            flat.update({f"{name}.{inner}": entry for inner, entry in value.items()})
        else:
            flat[name] = value
    return flat


def unflatten(table: Mapping[str, Any] | None, handler: Callable[[Any], Any]) -> Any:
    """Serialise ``{index.medial = ...}`` as ``{index = {medial = ...}}``."""
    return None if table is None else nested(handler(table))
