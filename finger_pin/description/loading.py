"""From TOML to validated descriptions and back: every door, one-line errors, and families of scenarios."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import tomli_w

from finger_pin.description.fields import find_field, without
from finger_pin.description.finger_description import FingerDescription, HandSettings
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.recordings.signal_files import with_commands, with_signals
from finger_pin.description.resolution import kind_of, overridden, read_scenario_file, refuse_other
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import Series, entry_at, is_path, match_paths, merge, packed, shipped, split
from finger_pin.description.validation import Description, Table, as_table, suggestion, validate
from finger_pin.exceptions import InputError

_Described = TypeVar("_Described", bound=Description)
#: Wherever a scenario is taken: itself, the name of one that ships, or the path of a file.
ScenarioLike: TypeAlias = Scenario | str | Path
#: Likewise a finger; a hand is one, too, and a scenario stands for its own.
DescriptionLike: TypeAlias = FingerDescription | Scenario | str | Path


@contextmanager
def _depth_limited(kind: str) -> Iterator[None]:
    """Refuse, in one line, what is nested more deeply than calls can be."""
    try:
        yield
    except RecursionError:
        raise InputError(kind, "is nested too deeply") from None


def load_finger(name: str | Path | FingerDescription, overrides: Mapping[str, Any] | None = None) -> FingerDescription:
    """Load a finger by the name of a shipped one or the path of a TOML file, or change one that is read.

    Args:
        name: Such as ``ub`` or ``my_finger.toml``, or a finger, such as `from_mujoco` returns.
        overrides: Values by dotted key, such as ``{"finger.joints.distal.link.length": 0.025}``.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    return _load("finger", FingerDescription, name, overrides)


def load_hand(name: str | Path, overrides: Mapping[str, Any] | None = None) -> FingerDescription:
    """Load all fingers of a hand together by the name of a shipped one or the path of a TOML file.

    Joints and tendons have dotted names, such as ``index.medial``. Palm and placed fingers are its `hand`.

    Args:
        name: Such as ``ub_hand`` or ``my_hand.toml``.
        overrides: Values by dotted key, such as ``{"hand.fingers.thumb.scale": 1.1}``.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    return _load("hand", HandSettings, name, overrides).joined()


def describe(finger: DescriptionLike) -> FingerDescription:
    """Return the description of a finger or a hand that is given in any way; of a scenario, its own.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    if isinstance(finger, str | Path):
        kind, names = kind_of(str(finger)), [*shipped("fingers"), *shipped("hands")]
        if kind == "scenario" and _is_scenario(str(finger)):
            return load_scenario(finger).finger
        if kind == "scenario" and not is_path(str(finger)):
            allowed = f"no such finger or hand; there are {', '.join(names)}, or the path of a .toml file"
            raise InputError("finger", allowed + suggestion(finger, names), str(finger))
        return load_hand(finger) if kind == "hand" else load_finger(finger)
    if isinstance(finger, Scenario):
        return finger.finger
    if not isinstance(finger, FingerDescription):
        allowed = "must be that of a finger or a hand, as fp.load_finger(name), or the name or path of one"
        raise InputError("description", allowed, type(finger).__name__)
    return finger


def _is_scenario(name: str) -> bool:
    """Return whether a name or file is that of a scenario, valid or not."""
    try:
        table, _ = read_scenario_file(name, Path())
    except InputError:
        return False
    return not is_path(name) or not {"extends", "finger", "hand"}.isdisjoint(table)


@_depth_limited("scenario")
def load_scenario(name: ScenarioLike, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Load a scenario by the name of a shipped one or the path of a TOML file.

    A scenario file may say ``extends = "fig6"`` to start from another scenario, and ``finger = "ub"`` or, to change
    some of a finger, ``[finger]`` with ``base = "ub"`` and further entries. ``hand`` takes the place of ``finger``
    where there are several; each of ``hand.fingers`` has a ``finger`` of its own.

    Args:
        name: Such as ``fig6`` or ``my_scenario.toml``; or a scenario, which the overrides change.
        overrides: Values by dotted key, such as ``{"controller.gain": 2.0}``; they win over the file. A star stands for
            every name, as in ``finger.actuators.*.spool_radius``. Paths among them are relative to the working
            directory, paths in a file to the file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    if isinstance(name, Scenario):
        return _scenario(name.set_entries(), Path(), overrides) if overrides else name
    if not overrides and not is_path(str(name)):
        return _shipped_scenario(str(name))
    return _named_scenario(str(name), overrides)


def _named_scenario(name: str, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Return the scenario of a name or path."""
    table, folder = read_scenario_file(name, Path())
    return _scenario(without(table, "identify"), folder, overrides)


# It is frozen, so that all may have the same one.
_shipped_scenario = cache(_named_scenario)


@_depth_limited("scenario")
def load_bench(
    name: ScenarioLike, overrides: Mapping[str, Any] | None = None, identify: Mapping[str, Any] | None = None
) -> tuple[Scenario, IdentifySettings]:
    """Load a scenario with its table ``[identify]``: its recordings, and the numbers to be found.

    Args:
        name: Name of a bench or scenario that ships, path of a TOML file, or a scenario.
        overrides: As for `load_scenario`.
        identify: Entries of the table, on top of the file's.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    benches = shipped("benches")
    if isinstance(name, str) and not is_path(name) and name not in {**benches, **shipped("scenarios")}:
        hint = suggestion(name, benches)
        allowed = f"no such bench; there are {', '.join(benches)}, or the path of a .toml file{hint}"
        raise InputError("bench", allowed, name)
    table, folder = ({}, Path()) if isinstance(name, Scenario) else read_scenario_file(str(name), Path(), bench=True)
    entries = merge(as_table(table.get("identify")), dict(identify or {}))
    if not entries:
        raise InputError("identify", "is missing: which parameters are to be found, and from which recordings")
    if isinstance(name, Scenario):
        scenario = load_scenario(name, overrides)
    else:
        scenario = _scenario(without(table, "identify"), folder, overrides)
    return scenario, validate(IdentifySettings, entries, ("identify",))


@_depth_limited("scenario")
def read_scenario(table: Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Return the scenario of a table, as `load_scenario` does for a file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    return _scenario(dict(table), Path(), overrides)


def _scenario(table: Table, folder: Path, overrides: Mapping[str, Any] | None) -> Scenario:
    """Return the scenario of a table; descriptions that no key touches stay the same objects."""
    table = overridden(table, overrides, folder)
    return validate(Scenario, with_commands(with_signals(table, Path())), ())


def _load(kind: str, model: type[_Described], name: Any, overrides: Mapping[str, Any] | None) -> _Described:
    """Load a finger or a hand."""
    with _depth_limited(kind):
        table = overridden({kind: name if isinstance(name, model) else str(name)}, overrides, sections=(kind,))
        return validate(model, table[kind], (kind,))


def to_toml(description: Description) -> str:
    """Return the TOML text of a description, complete: reading it gives the same description back, bit for bit.

    Series of more than 10,000 numbers are written as base64 of their doubles; times that signals share, once.

    Raises:
        InputError: If it is none.
    """
    if not isinstance(description, Scenario | FingerDescription):
        allowed = "must be a finger, hand or scenario, as fp.load_finger(name), or finger.description"
        raise InputError("description", allowed, type(description).__name__)
    if isinstance(description, FingerDescription) and description.hand is not None:
        description = description.hand
    long: list[str] = []
    text = tomli_w.dumps(packed(description.model_dump(mode="python", exclude_none=True), long))
    # In the single quotes of TOML nothing is escaped, so that nobody looks at each letter.
    pieces = re.split(r'^((?:times|values) = )"base64:\d+"$', text, flags=re.MULTILINE)
    pieces[1::2] = [f"{key}'{series}'" for key, series in zip(pieces[1::2], long, strict=True)]
    return "".join(pieces)


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
        self._paths = [list(match_paths(name.split("."), scenario)) for name, _ in self._names]
        self.values: tuple[Any, ...] = tuple(self._value(key) for key in range(len(self.keys)))
        for (name, index), value in zip(self._names, self.values, strict=True):
            if value is not None:
                continue
            # Its name is wrong, or nothing is there.
            if index is not None:
                raise InputError(name, "has no numbers of which one could be given; give all of them")
            overridden(scenario.set_entries(), {name: 0.0})
            if "*" not in name and find_field(Scenario, name.split(".")) is None:
                load_scenario(scenario, {name: 0.0})

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
            number = _toml_value(value, old)
            if index is None:
                overrides[name] = number
                continue
            for path in paths:
                numbers = overrides.get(".".join(path), entry_at(self.scenario, path))
                overrides[".".join(path)] = [number if k in index else other for k, other in enumerate(numbers)]
        return load_scenario(self.scenario, overrides)

    def _value(self, key: int) -> Any:
        (name, index), paths = self._names[key], self._paths[key]
        value = entry_at(self.scenario, paths[0])
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


def _toml_value(value: Any, old: Any) -> Any:
    """Return a value as TOML has it: arrays as lists, whole numbers as such."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return int(value) if type(old) is int and isinstance(value, float) and value.is_integer() else value
