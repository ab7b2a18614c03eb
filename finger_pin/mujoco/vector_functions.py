"""exp(x) and an arc tangent as code of which the compiler makes vectors: of calls of the C library's it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from finger_pin.core.jit import njit_inline, two_to_the

# ln 2 as a sum, of which multiples of the first part up to 2^11 are exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
_PER_LN2 = 1.0 / math.log(2.0)
# What is added and taken off again rounds to a whole number, which in between stands in the last bits.
_ROUND = 1.5 * 2.0**52
# Below, exp(x) is nothing beside what it is multiplied with.
_LEAST = -700.0
_C2, _C3, _C4, _C5, _C6, _C7, _C8, _C9, _C10, _C11, _C12 = (1.0 / math.factorial(k) for k in range(2, 13))

_T3, _T5, _T7, _T9, _T11, _T13, _T15, _T17, _T19 = (1.0 / k for k in range(3, 20, 2))


@njit_inline
def exponential(x: float) -> float:
    """Return exp(x) of x <= 0 to 4e-16 of it: by 2^n and Taylor's series of the rest, at most ln 2 / 2."""
    x = _LEAST if x < _LEAST else x
    rounded = x * _PER_LN2 + _ROUND
    n = rounded - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    s = r * r
    t = s * s
    low = (1.0 + r) + s * (_C2 + r * _C3)
    middle = (_C4 + r * _C5) + s * (_C6 + r * _C7)
    high = (_C8 + r * _C9) + s * (_C10 + r * _C11) + t * _C12
    return (low + t * (middle + t * high)) * two_to_the(rounded)


@njit_inline
def angle(real: float, imaginary: float) -> float:
    """Return the angle of a complex number whose imaginary part is not negative, from 0 to pi, to 1e-15.

    y / (x + |x + i y|) is the tangent of half of it: three times, and Taylor's series of what is left, at most tan(pi /
    16).
    """
    away, square = abs(real), imaginary * imaginary
    away += math.sqrt(away * away + square)
    away += math.sqrt(away * away + square)
    away += math.sqrt(away * away + square)
    r = imaginary / away
    s = r * r
    t = s * s
    low = (1.0 - s * _T3) + t * (_T5 - s * _T7)
    high = (_T9 - s * _T11) + t * (_T13 - s * _T15) + t * t * (_T17 - s * _T19)
    found = 8.0 * r * (low + t * t * high)
    return found if real >= 0.0 else math.pi - found


_numpy: Any = ModuleType("numpy")
_numpy.exp, _numpy.abs, _numpy.maximum = exponential, np.abs, np.maximum


@njit_inline
def _magnitude(value: float, _side: float) -> float:
    """Return |x|: here no friction is held on a side."""
    return abs(value)


def compiled_law(law: Callable[..., Any]) -> Callable[..., Any]:
    """Return a law of `finger_pin.laws`, compiled with this exponential in place of NumPy's."""
    known = {"np": _numpy, "magnitude": _magnitude}
    return njit_inline(FunctionType(law.__code__, known, law.__name__, law.__defaults__))
