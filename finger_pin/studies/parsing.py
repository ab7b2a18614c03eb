"""Spellings of a key's values on a command line: START:STOP:N, LOW:HIGH, or A,B,C."""

from __future__ import annotations

import math

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.studies.designs import MOST_POINTS, Range
from finger_pin.studies.keys import Value

_VALUES = "must be KEY=START:STOP:N, KEY=START:STOP:N:log or KEY=A,B,C"
_SWITCH = {"true": True, "false": False}
_RANGE = "must be KEY=LOW:HIGH or KEY=LOW:HIGH:log"


def parse_values(text: str) -> tuple[str, tuple[Value, ...]]:
    """Return the key and the values of ``KEY=START:STOP:N``, ``KEY=START:STOP:N:log`` or ``KEY=A,B,C``.

    START and STOP are among the N values. A, B and C are numbers, or names, or true and false.

    Raises:
        InputError: If it is neither.
    """
    key, spelt = _split(text, _VALUES)
    if ":" not in spelt:
        words = [each.strip() for each in spelt.split(",")]
        if not all(words) or any(_is_number(each) for each in words):
            return key, tuple(_number(text, each, _VALUES) for each in words)
        return key, tuple(_SWITCH.get(each, each) for each in words)
    parts, logarithmic = _parts(spelt)
    if len(parts) != 3 or not parts[2].strip().isdecimal():
        raise InputError("over", _VALUES, text)
    start, stop = (_number(text, each, _VALUES) for each in parts[:2])
    count = int(parts[2]) if len(parts[2].strip()) < 10 else MOST_POINTS + 1
    if not 1 <= count <= MOST_POINTS:
        raise InputError("over", f"N must be from 1 to {MOST_POINTS}", text)
    if logarithmic and not (start > 0.0 and stop > 0.0):
        raise InputError("over", "START and STOP must be above 0 for logarithmic steps", text)
    spaced = np.geomspace(start, stop, count) if logarithmic else np.linspace(start, stop, count)
    return key, tuple(spaced.tolist())


def parse_range(text: str) -> tuple[str, Range]:
    """Return the key and the range of ``KEY=LOW:HIGH`` or ``KEY=LOW:HIGH:log``.

    Raises:
        InputError: If it is neither.
    """
    key, spelt = _split(text, _RANGE)
    parts, logarithmic = _parts(spelt)
    if len(parts) != 2:
        raise InputError("over", _RANGE, text)
    low, high = (_number(text, each, _RANGE) for each in parts)
    interval = Range(low, high, logarithmic)
    interval.check(key)
    return key, interval


def _split(text: str, allowed: str) -> tuple[str, str]:
    key, equals, spelt = text.partition("=")
    if not equals or not key.strip() or not spelt.strip():
        raise InputError("over", allowed, text)
    return key.strip(), spelt


def _parts(spelt: str) -> tuple[list[str], bool]:
    parts = spelt.split(":")
    logarithmic = parts[-1].strip() == "log"
    return (parts[:-1] if logarithmic else parts), logarithmic


def _is_number(spelt: str) -> bool:
    try:
        float(spelt)
    except ValueError:
        return False
    return True


def _number(text: str, spelt: str, allowed: str) -> float:
    if not _is_number(spelt):
        raise InputError("over", f"{allowed}; {spelt.strip() or 'nothing'} is not a number", text)
    number = float(spelt)
    if not math.isfinite(number):
        raise InputError("over", f"{allowed}; numbers must be finite", text)
    return number
