"""Units of columns, and their place in a header."""

from __future__ import annotations

import math
import re

from finger_pin.description.validation import nearest, suggestion
from finger_pin.exceptions import InputError

_POUND, _GRAVITY = 0.45359237, 9.80665
#: By SI unit, the units that a column may have and what one of each is.
UNITS: dict[str, dict[str, float]] = {
    "N": {
        "N": 1.0,
        "mN": 1e-3,
        "cN": 1e-2,
        "kN": 1e3,
        "gf": 1e-3 * _GRAVITY,
        "kgf": _GRAVITY,
        "lbf": _POUND * _GRAVITY,
    },
    "N m": {"N m": 1.0, "N mm": 1e-3, "mN m": 1e-3, "N cm": 1e-2, "kgf cm": 1e-2 * _GRAVITY},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "rev": 2.0 * math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0},
    "A": {"A": 1.0, "mA": 1e-3},
    "V": {"V": 1.0, "mV": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}

# A name in a header with its unit: in brackets, or of signals after an underscore as well.
BRACKETED = re.compile(r"(.+?)\s*[(\[]\s*(.+?)\s*[)\]]")
APPENDED = re.compile(r"(.+)_(s|ms|us|rad|mrad|deg|mN|gf|kgf)")
# What stands in brackets for no unit.
_NO_UNIT = ("1", "-")


def split_unit(name: str, *patterns: re.Pattern[str]) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit: what is in brackets, known or not."""
    for match in filter(None, (pattern.fullmatch(name) for pattern in patterns)):
        return match[1], None if match[2] in _NO_UNIT else match[2]
    return name, None


def check_header(entry: str, name: str, unit: str | None, si: str, asked: bool) -> None:
    """Refuse a unit in a header that is unknown, and ask about a name that ends as another unit does.

    Raises:
        InputError: Naming the column.
    """
    fitting = UNITS.get(si) or {each: 1.0 for units in UNITS.values() for each in units}
    if unit is not None and not any(unit in units for units in UNITS.values()):
        allowed = f"column {name} is in {unit}, which is no unit known here; write unit, one of {', '.join(fitting)}"
        raise InputError(entry, allowed + suggestion(unit, fitting))
    appended = split_unit(name, APPENDED)[1] if unit is None and asked else None
    if appended in UNITS.get(si, {}) and appended != si:
        allowed = f'column {name} seems to be in {appended}; write {{ column = "{name}", unit = "{appended}" }}'
        raise InputError(entry, f'{allowed}, or unit = "{si}" if it is not')


def in_si(entry: str, unit: str, wanted: str) -> float:
    """Return the factor from a unit to SI; of a quantity whose SI unit is not known, any unit will do.

    Raises:
        InputError: If it is no unit of that; ``entry`` says where it stands.
    """
    fitting = UNITS.get(wanted) or {unit: factor for units in UNITS.values() for unit, factor in units.items()}
    if unit in fitting:
        return fitting[unit]
    near = nearest(unit, fitting)
    other = [si for si, units in UNITS.items() if unit in units]
    what = f"is a unit of what is in {other[0]}, and this is in {wanted}" if other else f"must be {', '.join(fitting)}"
    raise InputError(entry, what + (f"; did you mean {near}?" if near and not other else ""), unit)
