"""Selections of tendons and joints: names with stars, keys of the descriptions, checked as these are."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Annotated, Any

from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.validation import Description, quantity, real, suggestion, validate
from finger_pin.exceptions import InputError


class RoutedFriction(TendonFrictionSettings):
    """Law (9) for a tendon, and the turn of its path."""

    curvature_offset: Annotated[float, real(0.0, 100.0)] = quantity(
        0.0, unit="rad", source="(15)", doc="phi_off, the turn that the model does not show."
    )
    bends: tuple[str, ...] | None = quantity(
        None, unit="1", source="(15)", doc="Of a fixed tendon, the joints whose angle bends its path; all if left out."
    )


TENDON_KEYS, JOINT = RoutedFriction, JointFrictionSettings


def choose(
    patterns: Mapping[str, Mapping[str, Any]] | None, names: list[str], entry: str, kind: type[Description]
) -> dict[str, tuple[Any, bool]]:
    """Return the checked keys of every name that matches, and whether it was written without stars.

    Raises:
        InputError: If a name matches nothing, or a key or number is not allowed.
    """
    tables: dict[str, dict[str, Any]] = {}
    named = set()
    if not isinstance(patterns or {}, Mapping):
        raise InputError(entry, "must be a table of names, with keys for each", patterns)
    for pattern, keys in (patterns or {}).items():
        if not isinstance(keys, Mapping):
            raise InputError(f"{entry}.{pattern}", "must be a table of keys", keys)
        matching = [name for name in names if fnmatchcase(name, pattern)]
        if not matching:
            hint = suggestion(pattern, names)
            raise InputError(f"{entry}.{pattern}", f"matches none of {', '.join(names) or 'no names'}{hint}")
        for key, value in validate(kind, dict(keys), (entry, pattern)):
            if key in ("law", "reversal_speed") and key in keys and value != "lugre":
                raise InputError(
                    f"{entry}.{pattern}.{key}", 'is for our own step: in MuJoCo\'s there is "lugre"', value
                )
            if isinstance(value, tuple) and key != "bends":
                raise InputError(f"{entry}.{pattern}.{key}", "must be one number", list(value))
        for name in matching:
            tables[name] = tables.get(name, {}) | dict(keys)
        named |= {pattern} & set(matching)
    return {name: (validate(kind, keys, (entry, name)), name in named) for name, keys in tables.items()}
