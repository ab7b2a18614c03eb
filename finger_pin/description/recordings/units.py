"""Units of columns, and their place in a header."""

from __future__ import annotations

import math
import re

from finger_pin.description.validation import nearest, suggestion
from finger_pin.exceptions import InputError

_KILOGRAMS_PER_POUND, _STANDARD_GRAVITY = 0.45359237, 9.80665
#: By SI unit, the units that a column may have and what one of each is.
UNITS: dict[str, dict[str, float]] = {
    "N": {
        "N": 1.0,
        "mN": 1e-3,
        "cN": 1e-2,
        "kN": 1e3,
        "gf": 1e-3 * _STANDARD_GRAVITY,
        "kgf": _STANDARD_GRAVITY,
        "lbf": _KILOGRAMS_PER_POUND * _STANDARD_GRAVITY,
    },
    "N m": {"N m": 1.0, "N mm": 1e-3, "mN m": 1e-3, "N cm": 1e-2, "kgf cm": 1e-2 * _STANDARD_GRAVITY},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "rev": 2.0 * math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0},
    "A": {"A": 1.0, "mA": 1e-3},
    "V": {"V": 1.0, "mV": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
# Further units, by the one above that they are so many of, and prefixes of those that have any.
_FURTHER_UNITS = {
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    "ozf": ("lbf", 0.0625),
    "dyn": ("N", 1e-5),
    "ft": ("in", 12.0),
}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3, "M": 1e6}
_PREFIXED = ("N", "m", "rad", "A", "V", "s")
# Other spellings: of one sign, and of whole units.
_SIGNS = str.maketrans({"\u00b5": "u", "\u03bc": "u", "\u00b0": "deg", **dict.fromkeys("*\u00b7\u22c5.-_", " ")})
_SPELLINGS = {"Nm": "N m", "mNm": "mN m", "Nmm": "N mm", "Ncm": "N cm", "rev/min": "rpm", "RPM": "rpm", "dps": "deg/s"}

# A name in a header with its unit: in brackets, or of signals after an underscore as well.
BRACKETED = re.compile(r"(.+?)\s*[(\[]\s*(.+?)\s*[)\]]")
APPENDED = re.compile(r"(.+)_(s|ms|us|ns|rad|mrad|deg|mN|gf|kgf)")
# What stands in brackets for no unit.
_DIMENSIONLESS = ("1", "-")


def split_unit(name: str, *patterns: re.Pattern[str]) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit: what is in brackets, known or not."""
    for match in filter(None, (pattern.fullmatch(name) for pattern in patterns)):
        return match[1], None if match[2] in _DIMENSIONLESS else match[2]
    return name, None


def parse_unit(text: str) -> tuple[str, float] | None:
    """Return the SI unit of a unit and the factor to it; None if it is unknown.

    Known are `UNITS`, SI prefixes, products of a force and a length, lengths and angles per time, and signs that others
    write, such as N*m and \N{MICRO SIGN}m.
    """
    spelled = " ".join(text.translate(_SIGNS).split()).replace(" / ", "/")
    spelled = _SPELLINGS.get(spelled, spelled)
    for si, units in UNITS.items():
        if spelled in units:
            return si, units[spelled]
    if spelled in _FURTHER_UNITS:
        unit, count = _FURTHER_UNITS[spelled]
        parsed = parse_unit(unit)
        return parsed and (parsed[0], count * parsed[1])
    if spelled[:1] in _PREFIXES and spelled[1:] in _PREFIXED:
        return spelled[1:], _PREFIXES[spelled[0]]
    for sign, allowed in (("/", ("m/s", "rad/s")), (" ", ("N m", "m N"))):
        one, separator, other = spelled.partition(sign)
        parts = [parse_unit(part) for part in (one, other)] if separator else []
        if len(parts) == 2 and parts[0] and parts[1]:
            (first, a), (second, b) = parts[0], parts[1]
            if f"{first}{sign}{second}" in allowed:
                return ("N m", a * b) if sign == " " else (f"{first}/{second}", a / b)
    return None


def check_header(entry: str, name: str, unit: str | None, si: str, asked: bool) -> None:
    """Refuse a unit in a header that is unknown, and ask about a name that ends as another unit does."""
    fitting = UNITS.get(si) or {each: 1.0 for units in UNITS.values() for each in units}
    if unit is not None and parse_unit(unit) is None:
        allowed = f"column {name} is in {unit}, which is no unit known here; write unit, one of {', '.join(fitting)}"
        raise InputError(entry, allowed + suggestion(unit, fitting))
    appended = split_unit(name, APPENDED)[1] if unit is None and asked else None
    if appended in UNITS.get(si, {}) and appended != si:
        allowed = f'column {name} seems to be in {appended}; write {{ column = "{name}", unit = "{appended}" }}'
        raise InputError(entry, f'{allowed}, or unit = "{si}" if it is not')


def in_si(entry: str, unit: str, wanted: str) -> float:
    """Return the factor from a unit to SI; of a quantity whose SI unit is not known, any unit will do."""
    parsed = parse_unit(unit)
    if parsed is not None and (wanted == parsed[0] or wanted not in UNITS):
        return parsed[1]
    fitting = UNITS.get(wanted) or {unit: factor for units in UNITS.values() for unit, factor in units.items()}
    if parsed is not None:
        raise InputError(entry, f"is a unit of what is in {parsed[0]}, and this is in {wanted}", unit)
    nearest_unit = nearest(unit, fitting)
    raise InputError(
        entry, f"must be {', '.join(fitting)}" + (f"; did you mean {nearest_unit}?" if nearest_unit else ""), unit
    )
