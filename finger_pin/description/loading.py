"""From TOML to validated descriptions: shipped data, a user's files, overrides, and one-line errors."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import tomli_w

from finger_pin.description.finger import FingerDescription, HandSettings
from finger_pin.description.overriding import normalise_overrides, override
from finger_pin.description.reading import as_name, bench_file, is_path, kind_of, merge, read_scenario_file, shipped
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.recordings.series import PACKED, Series, packed
from finger_pin.description.recordings.signal_files import resolve_commands, resolve_signals
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, Table, as_table, suggestion, validate
from finger_pin.exceptions import InputError

# Of more numbers than this a text is written that is read at once; nobody reads them one by one.
_MANY = 10_000
_Described = TypeVar("_Described", bound=Description)
# Few: some have millions of numbers.
#: Wherever a scenario is taken: itself, the name of one that ships, or the path of a file.
ScenarioLike: TypeAlias = Scenario | str | Path
#: Likewise a finger; a hand is one, too, and a scenario stands for its own.
DescriptionLike: TypeAlias = FingerDescription | Scenario | str | Path


def list_fingers() -> dict[str, str]:
    """Return the fingers that ship with the package, with a line about each."""
    return shipped("fingers")


def list_hands() -> dict[str, str]:
    """Return the hands that ship with the package, with a line about each."""
    return shipped("hands")


def list_scenarios() -> dict[str, str]:
    """Return the scenarios that ship with the package, with a line about each."""
    return shipped("scenarios")


def list_benches() -> dict[str, str]:
    """Return the benches that ship with the package, with a line about each."""
    return shipped("benches")


def list_motors() -> dict[str, str]:
    """Return the motors that ship with the package, with a line about each."""
    return shipped("motors")


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
        kind, names = kind_of(str(finger)), [*list_fingers(), *list_hands()]
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
    if isinstance(name, Scenario) and not overrides:
        return name
    if not overrides and not is_path(str(name)):
        return _shipped_scenario(str(name))
    overrides = normalise_overrides(overrides or {}, set(Scenario.model_fields))
    with _depth_limited("scenario"):
        if isinstance(name, Scenario):
            return _resolved(name.set_entries(), overrides)
        return _scenario(*read_scenario_file(str(name), Path()), str(name), overrides)


@cache
def _shipped_scenario(name: str) -> Scenario:
    """Return a scenario that ships; it is frozen, so that all may have the same one."""
    with _depth_limited("scenario"):
        return _scenario(*read_scenario_file(name, Path()), name, {})


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
    checked = normalise_overrides(overrides or {}, set(Scenario.model_fields))
    if isinstance(name, str) and not is_path(name) and name not in {**list_benches(), **list_scenarios()}:
        near = suggestion(name, list_benches())
        allowed = f"no such bench; there are {', '.join(list_benches())}, or the path of a .toml file{near}"
        raise InputError("bench", allowed, name)
    with _depth_limited("scenario"):
        table, folder = (
            ({}, Path()) if isinstance(name, Scenario) else read_scenario_file(bench_file(str(name)), Path())
        )
        wanted = merge(as_table(table.pop("identify", None)), dict(identify or {}))
        if not wanted:
            raise InputError("identify", "is missing: which parameters are to be found, and from which recordings")
        made = (
            load_scenario(name, overrides)
            if isinstance(name, Scenario)
            else _scenario(table, folder, str(name), checked)
        )
        return made, validate(IdentifySettings, wanted, ("identify",))


def _scenario(table: Table, folder: Path, name: str, overrides: Table) -> Scenario:
    """Return the scenario of a file's table, without its table ``[identify]``."""
    table.pop("identify", None)
    table.setdefault("name", as_name(Path(name).stem))
    return _resolved(table, overrides, folder)


def _resolved(table: Table, overrides: Table, folder: Path = Path()) -> Scenario:
    """Return the scenario of a table, which is changed; descriptions that no key touches stay the same objects."""
    override(overrides, table, folder)
    resolve_signals(table, Path())
    resolve_commands(table)
    return validate(Scenario, table, ())


def read_scenario(table: Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Return the scenario of a table, as `load_scenario` does for a file.

    Raises:
        InputError: Naming the entry that is wrong.
    """
    checked = normalise_overrides(overrides or {}, set(Scenario.model_fields))
    with _depth_limited("scenario"):
        return _resolved(copy.deepcopy(dict(table)), checked)


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
    text = tomli_w.dumps(_plain(description.model_dump(mode="python", exclude_none=True), long))
    # In the single quotes of TOML nothing is escaped, so that nobody looks at each letter.
    pieces = re.split(r'^((?:times|values) = )"base64:\d+"$', text, flags=re.MULTILINE)
    pieces[1::2] = [f"{key}'{series}'" for key, series in zip(pieces[1::2], long, strict=True)]
    return "".join(pieces)


def _load(
    kind: str, model: type[_Described], name: str | Path | _Described, overrides: Mapping[str, Any] | None
) -> _Described:
    """Load a finger or a hand."""
    checked = normalise_overrides(overrides or {}, {kind})
    table: Table = {kind: name if isinstance(name, model) else str(name)}
    with _depth_limited(kind):
        override(checked, table, Path())
        return validate(model, table[kind], (kind,))


@contextmanager
def _depth_limited(what: str) -> Iterator[None]:
    try:
        yield
    except RecursionError:
        raise InputError(what, "is nested too deeply") from None


def _plain(value: Any, long: list[str]) -> Any:
    """Return a value for TOML; long series are put aside, and their place says at which index.

    Times that a neighbour has already are that neighbour's name.
    """
    if isinstance(value, dict):
        plain, timed = {}, dict[str, Any]()
        for key, item in value.items():
            times = item.get("times") if isinstance(item, dict) else None
            if times is not None and len(times) > _MANY:
                same = next((name for name, other in timed.items() if other == times), None)
                item = item if same is None else item | {"times": same}
                timed[key] = times
            plain[key] = _plain(item, long)
        return plain
    if not isinstance(value, tuple | Series):
        return value
    if len(value) > _MANY:
        long.append(packed(value))
        return f"{PACKED}{len(long) - 1}"
    return [_plain(item, long) for item in value]
