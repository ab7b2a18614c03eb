"""Series of numbers, such as the samples of a signal: a million are as ordinary as ten."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PlainValidator

from finger_pin.description.validation import checker, problem

# What a text of many numbers begins with.
PACKED = "base64:"


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


def packed(values: Sequence[float]) -> str:
    """Return numbers as a text that `series` reads back bit for bit: base64 of doubles, the least byte first."""
    return PACKED + base64.b64encode(np.asarray(values, dtype="<f8").tobytes()).decode("ascii")


def _unpacked(text: str) -> Series:
    try:
        if not text.startswith(PACKED):
            raise ValueError
        return Series(np.frombuffer(base64.b64decode(text[len(PACKED) :], validate=True), "<f8"))
    except ValueError:
        raise problem("", "must be a list of numbers", text[:40]) from None
