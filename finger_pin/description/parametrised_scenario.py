"""The scenarios that differ from one in the values at some keys."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.description.finger import FingerDescription
from finger_pin.description.overriding import normalise_overrides, override, refuse_other
from finger_pin.description.reading import Table, resolve_signals
from finger_pin.description.recordings.series import Series
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, find_field, validate
from finger_pin.exceptions import InputError

_INDEXED = re.compile(r"(?P<name>[^\[\]]+)\[(?P<index>\d{1,6}(,\d{1,6})*)\]")


class ParametrisedScenario:
    """A scenario, and those that other values at some of its keys make of it.

    A scenario with other numbers is what `load_scenario` returns with the same overrides: what a file leaves to its
    default follows the numbers. Only the tables on the way to a key are read and checked anew; all others are shared
    with the scenario, which tells what has to be built anew and what has not.

    Attributes:
        scenario: The scenario itself.
        keys: Dotted keys, as of `load_scenario`; ``[2]`` at the end of one stands for one number of a list, ``[0,1]``
            for two that are equal, a star for every name, ``{T1,T2}`` for some names.
        values: Their present values; None where there is nothing.
    """

    def __init__(self, scenario: Scenario, keys: Sequence[str]) -> None:
        """Find the keys.

        Raises:
            InputError: If there is no such key.
        """
        self.scenario, self.keys = scenario, tuple(keys)
        self._names = [split(key) for key in self.keys]
        for name, _ in self._names:
            if name not in ("finger.base", "hand.base"):
                refuse_other(name, hand=scenario.hand is not None, finger=scenario.hand is None)
        spelled = _spelled(scenario)
        self._places = [list(_places(name.split("."), scenario, spelled)) for name, _ in self._names]
        self._spelled = spelled
        self.values: tuple[Any, ...] = tuple(self._value(key) for key in range(len(self.keys)))
        for (name, index), places, value in zip(self._names, self._places, self.values, strict=True):
            if index is not None and value is not None:
                for *path, last in places:
                    _at(spelled, path).setdefault(last, _found(scenario, [*path, last]))
            if value is not None:
                continue
            if index is not None:
                raise InputError(name, "has no numbers of which one could be given; give all of them")
            # Without a value there is nothing wrong with but its name.
            probe = 0.0
            override(normalise_overrides({name: probe}, set(Scenario.model_fields)), self._table(), Path())
            if "*" not in name and find_field(Scenario, name.split(".")) is None:
                self._anew({name: probe})

    @classmethod
    def of_finger(cls, description: FingerDescription, keys: Sequence[str]) -> ParametrisedScenario:
        """Return the family of a scenario in which nothing but a finger or a hand is of account.

        Raises:
            InputError: If there is no such key, or one is not of a finger or a hand.
        """
        for key in keys:
            if key.partition(".")[0] not in ("finger", "hand"):
                raise InputError(key, "does not act on a finger alone; keys begin with finger or hand")
        hand, table = description.hand, {"name": description.name, "controller": {"kind": "tensions"}}
        return cls(validate(Scenario, table | ({"hand": hand} if hand else {"finger": description}), ()), keys)

    def with_values(self, values: Sequence[Any]) -> Scenario:
        """Return the scenario with values at the keys, in their order.

        Raises:
            InputError: Naming the entry that is wrong.
        """
        if len(values) != len(self.keys):
            raise InputError("values", f"must be {len(self.keys)}, one per key ({', '.join(self.keys)})", len(values))
        if not self.keys:
            return self.scenario
        given = [_plain(value, own) for value, own in zip(values, self.values, strict=True)]
        if not all(map(_is_number, given)):
            return self._anew(self._overrides(given))
        table = _copied(self._spelled)
        for places, (_, index), value in zip(self._places, self._names, given, strict=True):
            for *path, last in places:
                inner = _at(table, path)
                inner[last] = value if index is None else _with_numbers(inner[last], index, value)
        return validate(Scenario, table, ())

    def _overrides(self, values: Sequence[Any]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for (name, index), places, value in zip(self._names, self._places, values, strict=True):
            if index is None:
                found[name] = value
            else:
                for path in places:
                    whole = found.get(".".join(path), _found(self.scenario, path))
                    found[".".join(path)] = _with_numbers(whole, index, value)
        return found

    def _anew(self, overrides: Mapping[str, Any]) -> Scenario:
        """Return the scenario with overrides of any kind, read from its whole table."""
        table = self._table()
        override(normalise_overrides(overrides, set(Scenario.model_fields)), table, Path())
        resolve_signals(table, Path())
        return validate(Scenario, table, ())

    def _table(self) -> Table:
        return copy.deepcopy(self.scenario.model_dump(mode="python", exclude_unset=True))

    def _value(self, key: int) -> Any:
        (name, index), places = self._names[key], self._places[key]
        value = _found(self.scenario, places[0]) if places else None
        if index is None or value is None:
            return value
        if isinstance(value, tuple | Series) and max(index) < len(value):
            return value[index[0]]
        allowed = "there is no such list of numbers"
        if isinstance(value, int | float):
            allowed = f"{name} is one number for all; give it a list first, or leave out the index"
        elif isinstance(value, tuple | Series):
            allowed = f"{name} has {len(value)} numbers, [0] to [{len(value) - 1}]"
        raise InputError(self.keys[key], allowed)


def split(key: str) -> tuple[str, tuple[int, ...] | None]:
    """Return the name of a key, and its indices or None.

    Raises:
        InputError: If it has brackets elsewhere than at its end.
    """
    found = _INDEXED.fullmatch(key)
    if found:
        return found["name"], tuple(map(int, found["index"].split(",")))
    if "[" in key or "]" in key:
        raise InputError(key, "an index is whole numbers in brackets at the end, such as controller.gain[2] or [0,1]")
    return key, None


def _places(path: Sequence[str], owner: Any, table: Table, above: tuple[str, ...] = ()) -> Iterator[list[str]]:
    """Spell out the tables on the way to a key, and return all entries that it stands for."""
    part, *rest = path
    names = [*table] if part == "*" else part.strip("{}").split(",") if part.startswith("{") else [part]
    for name in names:
        if not rest:
            yield [name]
            continue
        inner = table.get(name)
        if not isinstance(inner, dict):
            if inner is not None and not isinstance(inner, Description):
                raise InputError(".".join((*above, *path)), f"{'.'.join((*above, name))} has no entries of its own")
            inner = table[name] = {} if inner is None else _spelled(inner)
        for found in _places(rest, owner, inner, (*above, name)):
            yield [name, *found]


def _spelled(value: Description | Mapping[str, Any]) -> Table:
    """Return the entries that a description was given, by name; those by finger and joint in tables of tables."""
    given = value if isinstance(value, Mapping) else {key: getattr(value, key) for key in value.model_fields_set}
    table: Table = {}
    for key, each in given.items():
        finger, dot, own = key.partition(".")
        if dot:
            table.setdefault(finger, {})[own] = each
        else:
            table[key] = _spelled(each) if isinstance(each, dict) else each
    return table


def _with_numbers(numbers: Sequence[Any], index: Sequence[int], value: Any) -> list[Any]:
    """Return a list of numbers with a value at some indices."""
    return [value if k in index else number for k, number in enumerate(numbers)]


def _at(table: Table, path: Sequence[str]) -> Table:
    return reduce(lambda inner, part: inner[part], path, table)


def _copied(table: Table) -> Table:
    """Return a copy of nested tables with shared entries."""
    return {key: _copied(each) if isinstance(each, dict) else each for key, each in table.items()}


def _found(owner: Any, path: Sequence[str]) -> Any:
    """Return the value of an entry, defaults among them; None for nothing."""
    for at, part in enumerate(path):
        if isinstance(owner, Mapping):
            # Tables of a hand have dotted names inside.
            dotted = ".".join(path[at : at + 2])
            if dotted in owner:
                return _found(owner[dotted], path[at + 2 :])
            owner = owner.get(part)
        else:
            owner = getattr(owner, part, None) if part in getattr(type(owner), "model_fields", {}) else None
    return owner


def _plain(value: Any, own: Any) -> Any:
    """Return a value as TOML has it: arrays as lists, whole numbers as such."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if type(own) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value


def _is_number(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_is_number, value))
    return isinstance(value, int | float) and not isinstance(value, bool)
