"""Units of recordings, and their factors to SI."""

from __future__ import annotations

import math

from finger_pin.description.validation import nearest
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
