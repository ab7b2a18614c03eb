"""Tables as TOML has them: on top of others, by dotted key or by finger, and with series of a million numbers."""

from __future__ import annotations

import base64
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PlainValidator
from pydantic_core import PydanticCustomError

from finger_pin.description.effects import without_unread
from finger_pin.description.validation import Description, Table, as_table, checker, problem
from finger_pin.exceptions import InputError

#: In place of an inherited table or value: takes it away, as if the base had left it out.
INHERIT_NOTHING = "none"
#: What a text of many numbers begins with.
PACKED_PREFIX = "base64:"
# Of more numbers than this a text is written that is read at once; nobody reads them one by one.
_MOST_PLAIN_NUMBERS = 10_000
# Kinds whose entries mean nothing to another kind: a table of one replaces, rather than completes, one of another.
_KINDS_APART = {"step", "ramp", "points", "cosine", "samples", "hold", "tensions"}
_INDEXED_KEY = re.compile(r"(?P<name>[^\[\]]+)\[(?P<index>\d{1,6}(,\d{1,6})*)\]")
_Settings = TypeVar("_Settings", bound=Description)


def shipped(kind: str) -> dict[str, str]:
    """Return the names of a kind that ship, such as fingers, with a line about each."""
    return {name: str(tomllib.loads(text).get("title", "")) for name, text in shipped_texts(kind).items()}


@cache
def shipped_texts(kind: str) -> dict[str, str]:
    """Return the TOML texts of a kind that ship, by name."""
    entries = resources.files("finger_pin.description").joinpath(kind).iterdir()
    texts = {entry.name: entry.read_text("utf-8") for entry in entries if entry.name.endswith(".toml")}
    return {name.removesuffix(".toml"): texts[name] for name in sorted(texts)}


@cache
def shipped_table(kind: str, name: str) -> Table:
    """Return the table of a kind and name that ships."""
    return tomllib.loads(shipped_texts(kind)[name])


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


def is_path(name: str) -> bool:
    """Return whether a name is the path of a file rather than something that ships."""
    return name.endswith(".toml") or "/" in name or "\\" in name


def as_name(stem: str) -> str:
    """Return a valid name made of that of a file."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]
    return name if re.match(r"[A-Za-z]", name) else f"scenario_{name}"


def is_other_kind(base: Table, top: Table) -> bool:
    """Return whether a signal or controller is of another kind than the one that it is put on."""
    kinds = {base.get("kind"), top["kind"]} if "kind" in top else set()
    return len(kinds) == 2 and not _KINDS_APART.isdisjoint(kinds)


def merge(base: Table, top: Table) -> Table:
    """Return a table with the entries of another on top; the value "none" removes an entry."""
    merged = without_unread(base, top)
    for key, value in top.items():
        if key in merged and isinstance(value, str) and value == INHERIT_NOTHING:
            del merged[key]
            continue
        both = isinstance(value, dict) and isinstance(merged.get(key), dict) and not is_other_kind(merged[key], value)
        # A table that names its base starts from that one.
        merged[key] = merge(merged[key], value) if both and "base" not in value else value
    return merged


def settings_of_finger(settings: _Settings, finger: str) -> _Settings:
    """Return settings for all fingers with the entries for one, from their table ``fingers``, on top.

    A table of another ``kind`` replaces, rather than completes.
    """
    by_finger: dict[str, _Settings] | None = getattr(settings, "fingers")  # noqa: B009
    if by_finger is None:
        return settings
    shared, top = settings.updated(fingers=None), by_finger.get(finger)
    if top is None:
        return shared
    if "kind" in top.model_fields_set and getattr(top, "kind", None) != getattr(shared, "kind", None):
        return top
    return shared.model_copy(update={entry: getattr(top, entry) for entry in top.model_fields_set})


def dump_set_fields(table: Mapping[str, Description] | None) -> Any:
    """Serialise tables by finger with the entries that they were given, and no others."""
    if table is None:
        return None
    return {name: settings.model_dump(exclude_unset=True, exclude_none=True) for name, settings in table.items()}


def error_of_hand(finger: str, error: PydanticCustomError) -> PydanticCustomError:
    """Return an error of one finger as that of the whole hand."""
    context = error.context or {}
    entry, allowed, value = str(context["entry"]), str(context["allowed"]), context["value"].content
    if finger and entry.startswith("finger."):
        return problem(f"hand.fingers.{finger}.{entry}", allowed, value)
    named = not finger or finger in f"{entry} {allowed}"
    return problem(entry, allowed if named else f"{allowed} (finger {finger})", value)


def match_paths(pattern: Sequence[str], table: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the paths of a key's pattern: a star stands for every name there is, ``{T1,T2}`` for these.

    Raises:
        InputError: If there is nothing that a star could stand for.
    """
    if "*" not in pattern and "{" not in "".join(pattern):
        yield (*above, *pattern)
        return
    part, *rest = pattern
    names = [*as_table(table)] if part == "*" else part.strip("{}").split(",") if part.startswith("{") else [part]
    if not names:
        raise InputError(".".join((*above, *pattern)), "there is nothing that the star could stand for")
    for name in names:
        yield from match_paths(rest, as_table(table).get(name), (*above, name))


def split(key: str) -> tuple[str, tuple[int, ...] | None]:
    """Return the name of a key, and its indices or None.

    Raises:
        InputError: If it has brackets elsewhere than at its end.
    """
    indexed = _INDEXED_KEY.fullmatch(key)
    if indexed:
        return indexed["name"], tuple(map(int, indexed["index"].split(",")))
    if "[" in key or "]" in key:
        raise InputError(key, "an index is whole numbers in brackets at the end, such as controller.gain[2] or [0,1]")
    return key, None


def entry_at(owner: Any, path: Sequence[str]) -> Any:
    """Return the value of an entry of a description, set or default; None if there is none."""
    for place, part in enumerate(path):
        if isinstance(owner, Mapping):
            # Tables of a hand have dotted names inside.
            dotted = ".".join(path[place : place + 2])
            if dotted in owner:
                return entry_at(owner[dotted], path[place + 2 :])
            owner = owner.get(part)
        else:
            owner = getattr(owner, part, None) if part in getattr(type(owner), "model_fields", {}) else None
    return owner


class Series(Sequence[float]):
    """Immutable sequence of floats, stored as an array."""

    def __init__(self, values: ArrayLike) -> None:
        """Keep numbers of shape (m,); of an array a copy."""
        self._values = np.array(values, dtype=float)
        self._values.flags.writeable = False

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the numbers as numpy wants them; without a copy they cannot be written."""
        return np.array(self._values, dtype=dtype, copy=copy)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self._values)

    @overload
    def __getitem__(self, index: int) -> float: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[float, ...]: ...
    def __getitem__(self, index: int | slice) -> float | tuple[float, ...]:
        """Return one number, or a tuple of several."""
        numbers = self._values[index].tolist()
        return tuple(numbers) if isinstance(index, slice) else numbers

    def __iter__(self) -> Iterator[float]:
        """Return the numbers in their order."""
        return iter(self._values.tolist())

    def __eq__(self, other: object) -> bool:
        """Return whether another series, or a tuple or list, has the same numbers."""
        if not isinstance(other, Series | tuple | list):
            return NotImplemented
        return self is other or (len(self) == len(other) and bool(np.array_equal(self, other)))

    def __hash__(self) -> int:
        """Return a hash that equal series share."""
        return hash(self._values.tobytes())

    def __copy__(self) -> Series:
        """Return itself."""
        return self

    def __deepcopy__(self, memo: object) -> Series:
        """Return itself."""
        return self

    def __repr__(self) -> str:
        """Return the first of its numbers, and their count."""
        shown = ", ".join(map(repr, self[:3]))
        return f"[{shown}{', ...' if len(self) > 3 else ''}] ({len(self)} numbers)"


def series(low: float = -math.inf, high: float = math.inf, hint: str = "") -> PlainValidator:
    """Return a validator for a list of finite numbers in [low, high], or the text that `packed` makes of one."""
    check = checker(low, high, False, hint)

    def validate(value: Any) -> tuple[float, ...] | Series:
        if isinstance(value, str):
            value = _unpacked(value)
        if isinstance(value, Series):
            numbers = np.asarray(value)
            # A comparison with what is not a number is false.
            if numbers.size == 0 or (low <= numbers.min() and numbers.max() <= high and math.isfinite(numbers.sum())):
                return value
        elif not isinstance(value, list | tuple):
            raise problem("", "must be a list of numbers", value)
        # Many are not asked one by one unless something is wrong; a sum tells of what is not finite.
        elif (
            set(map(type, value)) == {float} and low <= min(value) and max(value) <= high and math.isfinite(sum(value))
        ):
            return tuple(value)
        return tuple(check(item, f"[{index}]") for index, item in enumerate(value))

    return PlainValidator(validate)


def packed(value: Any, texts: list[str]) -> Any:
    """Return a value for TOML; long series are appended to ``texts``, and their place says at which index.

    Times that a neighbour has already are that neighbour's name.
    """
    if isinstance(value, dict):
        plain, timed = {}, dict[str, Any]()
        for key, item in value.items():
            times = item.get("times") if isinstance(item, dict) else None
            if times is not None and len(times) > _MOST_PLAIN_NUMBERS:
                same = next((name for name, other in timed.items() if other == times), None)
                item = item if same is None else item | {"times": same}
                timed[key] = times
            plain[key] = packed(item, texts)
        return plain
    if not isinstance(value, tuple | Series):
        return value
    if len(value) > _MOST_PLAIN_NUMBERS:
        # Bit for bit: base64 of doubles, the least byte first.
        texts.append(PACKED_PREFIX + base64.b64encode(np.asarray(value, dtype="<f8").tobytes()).decode("ascii"))
        return f"{PACKED_PREFIX}{len(texts) - 1}"
    return [packed(item, texts) for item in value]


def _unpacked(text: str) -> Series:
    try:
        if not text.startswith(PACKED_PREFIX):
            raise ValueError
        return Series(np.frombuffer(base64.b64decode(text[len(PACKED_PREFIX) :], validate=True), "<f8"))
    except ValueError:
        raise problem("", "must be a list of numbers", text[:40]) from None
