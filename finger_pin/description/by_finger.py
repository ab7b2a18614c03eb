"""Tables of a hand, by joint or tendon with dotted names, or by finger."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from pydantic_core import PydanticCustomError

from finger_pin.description.fields import nested
from finger_pin.description.validation import Description, problem

_Settings = TypeVar("_Settings", bound=Description)


def flatten(table: Any) -> Any:
    """Return ``{index = {medial = {...}}}`` as ``{index.medial = {...}}``: tables of tables lose a level."""
    return _flat(table, lambda value: all(isinstance(each, dict | Description) for each in value.values()))


def flat_numbers(table: Any) -> Any:
    """Return ``{index = {medial = 0.4}}`` as ``{index.medial = 0.4}``."""
    return _flat(table, lambda value: True)


def unflatten(table: Mapping[str, Any] | None, handler: Callable[[Any], Any]) -> Any:
    """Serialise ``{index.medial = ...}`` as ``{index = {medial = ...}}``, as files have it."""
    return None if table is None else nested(handler(table))


def dump_set_fields(table: Mapping[str, Description] | None) -> Any:
    """Serialise tables by finger with the entries that they were given, and no others."""
    if table is None:
        return None
    return {name: settings.model_dump(exclude_unset=True, exclude_none=True) for name, settings in table.items()}


def of_finger(settings: _Settings, name: str) -> _Settings:
    """Return settings for all fingers with the entries for one, from their table ``fingers``, on top.

    A table of another ``kind`` replaces, rather than completes.
    """
    whole = settings.updated(fingers=None)
    settings_of_finger: _Settings | None = (getattr(settings, "fingers") or {}).get(name)  # noqa: B009
    if settings_of_finger is None:
        return whole
    if (
        getattr(settings_of_finger, "kind", None) != getattr(whole, "kind", None)
        and "kind" in settings_of_finger.model_fields_set
    ):
        return settings_of_finger
    return whole.model_copy(
        update={entry: getattr(settings_of_finger, entry) for entry in settings_of_finger.model_fields_set}
    )


def _flat(table: Any, holds_tables: Callable[[dict[str, Any]], bool]) -> Any:
    if not isinstance(table, dict):
        return table
    flat = {}
    for name, value in table.items():
        if isinstance(value, dict) and value and holds_tables(value):
            flat.update({f"{name}.{own}": each for own, each in value.items()})
        else:
            flat[name] = value
    return flat


def error_of_finger(finger: str, error: PydanticCustomError) -> PydanticCustomError:
    """Return an error of one finger as that of the whole hand."""
    context = error.context or {}
    entry, allowed, value = str(context["entry"]), str(context["allowed"]), context["value"].content
    if finger and entry.startswith("finger."):
        return problem(f"hand.fingers.{finger}.{entry}", allowed, value)
    named = not finger or finger in f"{entry} {allowed}"
    return problem(entry, allowed if named else f"{allowed} (finger {finger})", value)
