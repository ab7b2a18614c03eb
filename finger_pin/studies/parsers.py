"""Parsers of a key's values on a command line: START:STOP:N, LOW:HIGH, or A,B,C."""

from __future__ import annotations

import math

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.studies.designs import MAX_POINTS, Range
from finger_pin.studies.keys import Value

_VALUES_MESSAGE = "must be KEY=START:STOP:N, KEY=START:STOP:N:log or KEY=A,B,C"
_BOOLEANS = {"true": True, "false": False}
_RANGE_MESSAGE = "must be KEY=LOW:HIGH or KEY=LOW:HIGH:log"


def parse_values(text: str) -> tuple[str, tuple[Value, ...]]:
    """Return the key and the values of ``KEY=START:STOP:N``, ``KEY=START:STOP:N:log`` or ``KEY=A,B,C``.

    START and STOP are among the N values. A, B and C are numbers, or names, or true and false.
    """
    key, text_value = _split(text, _VALUES_MESSAGE)
    if ":" not in text_value:
        words = [word.strip() for word in text_value.split(",")]
        if not all(words) or any(_is_number(word) for word in words):
            return key, tuple(_number(text, word, _VALUES_MESSAGE) for word in words)
        return key, tuple(_BOOLEANS.get(word, word) for word in words)
    parts, logarithmic = _split_range(text_value)
    if len(parts) != 3 or not parts[2].strip().isdecimal():
        raise InputError("over", _VALUES_MESSAGE, text)
    start, stop = (_number(text, word, _VALUES_MESSAGE) for word in parts[:2])
    count = int(parts[2]) if len(parts[2].strip()) < 10 else MAX_POINTS + 1
    if not 1 <= count <= MAX_POINTS:
        raise InputError("over", f"N must be from 1 to {MAX_POINTS}", text)
    if logarithmic and not (start > 0.0 and stop > 0.0):
        raise InputError("over", "START and STOP must be above 0 for logarithmic steps", text)
    values = np.geomspace(start, stop, count) if logarithmic else np.linspace(start, stop, count)
    return key, tuple(values.tolist())


def parse_range(text: str) -> tuple[str, Range]:
    """Return the key and the range of ``KEY=LOW:HIGH`` or ``KEY=LOW:HIGH:log``."""
    key, text_value = _split(text, _RANGE_MESSAGE)
    parts, logarithmic = _split_range(text_value)
    if len(parts) != 2:
        raise InputError("over", _RANGE_MESSAGE, text)
    low, high = (_number(text, part, _RANGE_MESSAGE) for part in parts)
    interval = Range(low, high, logarithmic)
    interval.check(key)
    return key, interval


def _split(text: str, allowed: str) -> tuple[str, str]:
    key, equals, text_value = text.partition("=")
    if not equals or not key.strip() or not text_value.strip():
        raise InputError("over", allowed, text)
    return key.strip(), text_value


def _split_range(text_value: str) -> tuple[list[str], bool]:
    parts = text_value.split(":")
    logarithmic = parts[-1].strip() == "log"
    return (parts[:-1] if logarithmic else parts), logarithmic


def _is_number(text_value: str) -> bool:
    try:
        float(text_value)
    except ValueError:
        return False
    return True


def _number(text: str, text_value: str, allowed: str) -> float:
    if not _is_number(text_value):
        raise InputError("over", f"{allowed}; {text_value.strip() or 'nothing'} is not a number", text)
    number = float(text_value)
    if not math.isfinite(number):
        raise InputError("over", f"{allowed}; numbers must be finite", text)
    return number
