"""Laws compiled: every function of a law becomes one over the rows of a table, called through its address.

Compiled code that calls a law does not know it: a law that is written anywhere is compiled on its own, in a second or
two, and the core stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

from finger_pin.core.jit import Pointer, address_of, inlined, njit_inline
from finger_pin.core.jit import numbers as _numbers
from finger_pin.core.jit import put as _put
from finger_pin.exceptions import InputError
from finger_pin.laws.law import ContactLaw, Law, Row, Touch


class RowColumns(NamedTuple):
    """Columns of the table of rows: the arguments of a law, as in `Row`, its results, and the first of its signals."""

    length: int
    speed: int
    state: int
    load: int
    command: int
    curvature: int
    side: int
    reading: int
    force: int
    rate: int
    signals: int


class SlopeColumns(NamedTuple):
    """Columns of the table of slopes, in the order of `Law.slopes`; that by readings is the last of each."""

    force_by_length: int
    force_by_speed: int
    force_by_state: int
    force_by_rate: int
    force_by_load: int
    force_by_command: int
    force_by_curvature: int
    force_by_reading: int
    rate_by_length: int
    rate_by_speed: int
    rate_by_state: int
    rate_by_load: int
    rate_by_command: int
    rate_by_curvature: int
    rate_by_reading: int


class TouchSlopeColumns(NamedTuple):
    """Columns of the table of slopes in the rows of a contact, in the order of `ContactLaw.slopes`."""

    force_by_gap: int
    force_by_speed: int
    force_by_slip_1: int
    force_by_slip_2: int
    force_by_slip_3: int
    force_by_state_1: int
    force_by_state_2: int
    force_by_state_3: int
    rate_by_gap: int
    rate_by_speed: int
    rate_by_slip_1: int
    rate_by_slip_2: int
    rate_by_slip_3: int
    rate_by_state_1: int
    rate_by_state_2: int
    rate_by_state_3: int


# A law is called with a whole table, so that its columns are positions in one array; the compiler takes them for
# constants. The table of slopes serves both kinds of laws, whose rates begin in the same column.
ROW, SLOPE = RowColumns(*range(len(RowColumns._fields))), SlopeColumns(*range(len(SlopeColumns._fields)))
_STEPS = range(len(TouchSlopeColumns._fields) // 2)
TOUCH_SLOPE = TouchSlopeColumns(*_STEPS, *(SLOPE.rate_by_length + step for step in _STEPS))
#: Columns of the table of slopes.
SLOPE_COLUMNS = 1 + max(*SLOPE, *TOUCH_SLOPE)
_ARGUMENTS = len(Row._fields)

# Filled in for every law; the last are zeros for the states that a contact does not have.
_law: Any = None
_PARAMETERS = _COUNT = _ARMS = _STATES = _END = 0
_ABSENT: tuple[float, ...] = ()


class Addresses(NamedTuple):
    """The addresses of the compiled functions of a law."""

    value: int
    slopes: int
    account: int


@cache
def addresses(law: Law | ContactLaw) -> Addresses:
    """Return the addresses of a law's functions, compiled; they live as long as the process."""
    value, slopes, account = (
        (_value, _slopes, _account) if law.arms == 1 else (_contact_value, _contact_slopes, _contact_account)
    )
    return Addresses(
        _address(law, value, law.value), _address(law, slopes, law.slopes), _address(law, account, law.account)
    )


def column_counts(laws: Sequence[Law | ContactLaw]) -> tuple[int, int]:
    """Return the numbers of columns of the table of rows and of that of energies and powers."""
    powers = max((len(law.supplies) + len(law.losses) for law in laws), default=0)
    return ROW.signals + max((len(law.signals) for law in laws), default=0), 1 + powers


def kink_column(law: Law | ContactLaw) -> int:
    """Return the column of the table of rows by whose sign a law bends, -1 for none."""
    if law.kink != "speed":
        return ROW.signals + law.signals.index(law.kink) if law.kink else -1
    if law.scale is None or law.arms > 1:
        raise InputError(f"law {law.name}: kink", "is 'speed', which is for laws of one arm with a state")
    return ROW.speed


def _address(law: Law | ContactLaw, template: Callable[..., Any], function: Callable[..., Any]) -> int:
    assert isinstance(template, FunctionType)
    world = {
        **template.__globals__,
        "_law": inlined(function),
        "_PARAMETERS": len(law.parameters),
        "_COUNT": len(law.signals),
        "_ARMS": law.arms,
        "_STATES": law.states,
        # The compiler slices tuples by constants alone.
        "_END": 4 + law.states,
        "_ABSENT": (0.0,) * (3 - law.states),
    }
    twin = FunctionType(template.__code__, world, template.__name__)
    tables = "CPointer(float64), " * (2 if template in (_value, _contact_value) else 3)
    shipped = function.__module__.startswith("finger_pin.")
    return address_of(f"void({tables}int64, int64, int64)", twin, announced=shipped)


@njit_inline
def _row(table: Pointer, stride: int, k: int) -> Row:
    return Row(*_numbers(table, k, stride, _ARGUMENTS))


def _value(table: Pointer, numbers: Pointer, stride: int, begin: int, end: int) -> None:
    for k in range(begin, end):
        outputs = _law(_row(table, stride, k), _numbers(numbers, k, stride, _PARAMETERS))
        _put(table, ROW.force * stride + k, stride, outputs)


def _slopes(table: Pointer, numbers: Pointer, filled: Pointer, stride: int, begin: int, end: int) -> None:
    for k in range(begin, end):
        signals = _numbers(table, ROW.signals * stride + k, stride, _COUNT)
        of_force, of_rate = _law(_row(table, stride, k), _numbers(numbers, k, stride, _PARAMETERS), signals)
        _put(filled, k, stride, of_force)
        _put(filled, SLOPE.rate_by_length * stride + k, stride, of_rate)


def _account(table: Pointer, numbers: Pointer, filled: Pointer, stride: int, begin: int, end: int) -> None:
    for k in range(begin, end):
        signals = _numbers(table, ROW.signals * stride + k, stride, _COUNT)
        force, rate = _numbers(table, ROW.force * stride + k, stride, 2)
        terms = _law(_row(table, stride, k), _numbers(numbers, k, stride, _PARAMETERS), force, rate, signals)
        _put(filled, k, stride, terms)


@njit_inline
def _touched(table: Pointer, stride: int, k: int, slips: tuple[float, ...], states: tuple[float, ...]) -> Touch:
    gap, speed, side = table[ROW.length * stride + k], table[ROW.speed * stride + k], table[ROW.side * stride + k]
    return Touch(gap, speed, slips[0], slips[1], slips[2], states[0], states[1], states[2], side)


def _contact_value(table: Pointer, numbers: Pointer, stride: int, begin: int, end: int) -> None:
    for k in range(begin, end, _ARMS):
        slips = _numbers(table, ROW.speed * stride + k + 1, 1, _STATES) + _ABSENT
        states = _numbers(table, ROW.state * stride + k + 1, 1, _STATES) + _ABSENT
        outputs = _law(_touched(table, stride, k, slips, states), _numbers(numbers, k, stride, _PARAMETERS))
        _put(table, ROW.force * stride + k, 1, outputs[:_ARMS])
        _put(table, ROW.rate * stride + k + 1, 1, outputs[4:_END])
        _put(table, ROW.signals * stride + k, stride, outputs[7:])


def _contact_slopes(table: Pointer, numbers: Pointer, filled: Pointer, stride: int, begin: int, end: int) -> None:
    # The slopes of forces stand in the columns of their rows, those of the states' rates below.
    for k in range(begin, end, _ARMS):
        slips = _numbers(table, ROW.speed * stride + k + 1, 1, _STATES) + _ABSENT
        states = _numbers(table, ROW.state * stride + k + 1, 1, _STATES) + _ABSENT
        signals = _numbers(table, ROW.signals * stride + k, stride, _COUNT)
        normal, first, second, third, rate_1, rate_2, rate_3 = _law(
            _touched(table, stride, k, slips, states), _numbers(numbers, k, stride, _PARAMETERS), signals
        )
        _put(filled, k, stride, normal)
        _put(filled, k + 1, stride, first)
        _put(filled, k + 2, stride, second)
        _put(filled, TOUCH_SLOPE.rate_by_gap * stride + k + 1, stride, rate_1)
        _put(filled, TOUCH_SLOPE.rate_by_gap * stride + k + 2, stride, rate_2)
        if _ARMS > 3:
            _put(filled, k + 3, stride, third)
            _put(filled, TOUCH_SLOPE.rate_by_gap * stride + k + 3, stride, rate_3)


def _contact_account(table: Pointer, numbers: Pointer, filled: Pointer, stride: int, begin: int, end: int) -> None:
    for k in range(begin, end, _ARMS):
        slips = _numbers(table, ROW.speed * stride + k + 1, 1, _STATES) + _ABSENT
        states = _numbers(table, ROW.state * stride + k + 1, 1, _STATES) + _ABSENT
        signals = _numbers(table, ROW.signals * stride + k, stride, _COUNT)
        forces = _numbers(table, ROW.force * stride + k, 1, _ARMS) + _ABSENT
        rates = _numbers(table, ROW.rate * stride + k + 1, 1, _STATES) + _ABSENT
        touch, parameters = _touched(table, stride, k, slips, states), _numbers(numbers, k, stride, _PARAMETERS)
        _put(filled, k, stride, _law(touch, parameters, forces, rates, signals))
