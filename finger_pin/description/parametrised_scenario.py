"""The scenarios that differ from one in the values at some keys."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.description.fields import find_field
from finger_pin.description.finger import FingerDescription
from finger_pin.description.loading import load_scenario
from finger_pin.description.overriding import matching_paths, normalise_overrides, override, refuse_other
from finger_pin.description.recordings.series import Series
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import validate
from finger_pin.exceptions import InputError

_INDEXED = re.compile(r"(?P<name>[^\[\]]+)\[(?P<index>\d{1,6}(,\d{1,6})*)\]")


class ParametrisedScenario:
    """Scenario of which some keys take other values.

    A scenario with other numbers is what `load_scenario` returns with the same overrides.

    Attributes:
        scenario: The scenario itself.
        keys: Dotted keys, as of `load_scenario`; ``[2]`` at the end of one stands for one number of a list, ``[0,1]``
            for two that are equal, a star for every name, ``{T1,T2}`` for some names.
        values: Their present values; None where there is nothing.
    """

    def __init__(self, scenario: Scenario, keys: Sequence[str]) -> None:
        """Read the keys and their present values.

        Raises:
            InputError: If there is no such key.
        """
        self.scenario, self.keys = scenario, tuple(keys)
        self._names = [split(key) for key in self.keys]
        for name, _ in self._names:
            if name not in ("finger.base", "hand.base"):
                refuse_other(name, hand=scenario.hand is not None, finger=scenario.hand is None)
        self._paths = [list(matching_paths(name.split("."), scenario)) for name, _ in self._names]
        self.values: tuple[Any, ...] = tuple(self._value(key) for key in range(len(self.keys)))
        for (name, index), value in zip(self._names, self.values, strict=True):
            if value is None:
                self._refuse_unknown(name, index)

    def _refuse_unknown(self, name: str, index: tuple[int, ...] | None) -> None:
        """Refuse a key without a value whose name is wrong, or that has no numbers."""
        if index is not None:
            raise InputError(name, "has no numbers of which one could be given; give all of them")
        probe = {name: 0.0}
        override(normalise_overrides(probe, set(Scenario.model_fields)), self.scenario.set_entries(), Path())
        if "*" not in name and find_field(Scenario, name.split(".")) is None:
            load_scenario(self.scenario, probe)

    @classmethod
    def from_finger(cls, description: FingerDescription, keys: Sequence[str]) -> ParametrisedScenario:
        """Return the family of a scenario of which only the finger or hand matters.

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
        overrides: dict[str, Any] = {}
        for (name, index), paths, value, old in zip(self._names, self._paths, values, self.values, strict=True):
            number = _plain(value, old)
            if index is None:
                overrides[name] = number
                continue
            for path in paths:
                numbers = overrides.get(".".join(path), _entry(self.scenario, path))
                overrides[".".join(path)] = [number if k in index else other for k, other in enumerate(numbers)]
        return load_scenario(self.scenario, overrides)

    def _value(self, key: int) -> Any:
        (name, index), paths = self._names[key], self._paths[key]
        value = _entry(self.scenario, paths[0])
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
    indexed = _INDEXED.fullmatch(key)
    if indexed:
        return indexed["name"], tuple(map(int, indexed["index"].split(",")))
    if "[" in key or "]" in key:
        raise InputError(key, "an index is whole numbers in brackets at the end, such as controller.gain[2] or [0,1]")
    return key, None


def _entry(owner: Any, path: Sequence[str]) -> Any:
    """Return the value of an entry, set or default; None if there is none."""
    for at, part in enumerate(path):
        if isinstance(owner, Mapping):
            # Tables of a hand have dotted names inside.
            dotted = ".".join(path[at : at + 2])
            if dotted in owner:
                return _entry(owner[dotted], path[at + 2 :])
            owner = owner.get(part)
        else:
            owner = getattr(owner, part, None) if part in getattr(type(owner), "model_fields", {}) else None
    return owner


def _plain(value: Any, old: Any) -> Any:
    """Return a value as TOML has it: arrays as lists, whole numbers as such."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if type(old) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
