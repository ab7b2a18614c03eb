"""Field types shared by every description: finite numbers with bounds, vectors, names.

A description is a frozen pydantic model. Every physical field is made by `quantity`, which carries its unit and
its source beside the bounds, so that a schema printed from the models documents itself.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, ClassVar, NoReturn, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints, ValidationError
from pydantic_core import PydanticCustomError

from finger_pin.description.caching import Frozen
from finger_pin.description.fields import document, field_names, nested
from finger_pin.exceptions import InputError

Name = Annotated[str, StringConstraints(strict=True, pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=64)]
#: Of a joint or tendon, which begins with that of its finger and a dot where there is a hand.
_DOTTED_NAME = r"^[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)?$"
FullName = Annotated[str, StringConstraints(strict=True, pattern=_DOTTED_NAME, max_length=129)]
# So many names a message lists; of more it lists so many that are near.
_MOST_NAMES_LISTED, _NEAREST_NAMES_LISTED = 20, 5
# Directions are given with three digits at least.
_UNIT = 1.001
#: The largest angle of a joint, rad: two turns. Nearly every angle in degrees is beyond it.
MOST_ANGLE = 12.5
IN_RADIANS = " rad (is it in degrees?)"
MILLIMETRES = " m (is it in millimetres?)"
Numbers = float | tuple[float, ...]
Table = dict[str, Any]
_Model = TypeVar("_Model", bound="Description")


class Description(Frozen):
    """Base of all descriptions: frozen, no unknown entries, finite numbers only.

    Attributes:
        file_keys: Further keys of its table in a file, which loading resolves.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)
    file_keys: ClassVar[tuple[str, ...]] = ()

    def updated(self, **entries: Any) -> Self:
        """Return a copy with other values of some entries, unchecked; a dictionary updates a part that is there."""
        fields = type(self).model_fields
        for name, entry in entries.items():
            if name not in fields:
                raise InputError(name, f"is no entry here{suggestion(name, fields)}", entry)
            if isinstance(entry, dict) and isinstance(part := getattr(self, name), Description):
                entries[name] = part.updated(**entry)
        return self.model_copy(update=entries)

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        """Return itself: nothing in it changes, and what is remembered of it is found again."""
        return self

    def set_entries(self) -> dict[str, Any]:
        """Return the entries that were set, as in tables; nested descriptions stay objects."""
        entries = ((key, getattr(self, key)) for key in self.model_fields_set)
        return {key: nested(value) if isinstance(value, dict) else value for key, value in entries}


def as_table(value: Any) -> Table:
    """Return a table, the entries of a description, or nothing for any other value: validation refuses that by name."""
    if isinstance(value, Description):
        return value.set_entries()
    return value if isinstance(value, dict) else {}


def problem(entry: str, allowed: str, value: Any = None) -> PydanticCustomError:
    """Return an error that names an entry below the model that raises it.

    Args:
        entry: Dotted name relative to the model, such as ``stiction``; empty for the model itself.
        allowed: The values that are accepted, in words.
        value: The value given.
    """
    return PydanticCustomError("entry", "{allowed}", {"entry": entry, "allowed": allowed, "value": _Opaque(value)})


class _Opaque:
    """Holds a value that pydantic shall not format: it cannot write integers of thousands of digits."""

    def __init__(self, content: Any) -> None:
        self.content = content


def quantity(default: Any, *, unit: str, source: str, doc: str) -> Any:
    """Return a field that carries its unit and source.

    Args:
        default: Default value; `...` where the entry must be given.
        unit: SI unit, ``1`` for a pure number.
        source: Equation, table or reason behind the default.
        doc: One sentence; the paper's symbol first where it has one.
    """
    return Field(default, description=doc, json_schema_extra={"unit": unit, "source": source})


def real(low: float = -math.inf, high: float = math.inf, *, above: bool = False, hint: str = "") -> BeforeValidator:
    """Return a validator for one finite number in [low, high], or (low, high] with ``above``."""
    check = checker(low, high, above, hint)
    return BeforeValidator(lambda value: check(value, ""))


def reals(
    low: float = -math.inf, high: float = math.inf, *, above: bool = False, hint: str = "", whole: bool = False
) -> BeforeValidator:
    """Return a validator for one finite number or a list of them, each in [low, high], and ``whole`` if asked."""
    check = checker(low, high, above, hint, whole)

    def validate(value: Any) -> Numbers:
        if isinstance(value, list | tuple):
            if not value:
                raise problem("", "must be a number or a list of numbers", value)
            return tuple(check(item, f"[{index}]") for index, item in enumerate(value))
        return check(value, "")

    return BeforeValidator(validate)


def vector(size: int, low: float = -math.inf, high: float = math.inf, hint: str = "") -> BeforeValidator:
    """Return a validator for a list of ``size`` finite numbers in [low, high]."""
    check = checker(low, high, False, hint)
    return BeforeValidator(lambda value: _checked(value, size, check))


def _checked(value: Any, size: int, check: Callable[[Any, str], float]) -> tuple[float, ...]:
    """Return a list of so many numbers, each checked."""
    if not isinstance(value, list | tuple) or len(value) != size:
        raise problem("", f"must be a list of {size} numbers", value)
    return tuple(check(item, f"[{index}]") for index, item in enumerate(value))


def direction(size: int) -> BeforeValidator:
    """Return a validator for ``size`` numbers of length 1, which rounding to three digits may miss: they are scaled."""
    check = checker(-_UNIT, _UNIT, False, "")
    expected = "a quaternion x, y, z, w of length 1" if size == 4 else "a unit vector"

    def validate(value: Any) -> tuple[float, ...]:
        numbers = _checked(value, size, check)
        length = math.hypot(*numbers)
        if abs(length - 1.0) > _UNIT - 1.0:
            raise problem("", f"must be {expected}", list(value))
        # What differs by rounding alone stays, to the bit.
        return numbers if abs(length - 1.0) < 1e-15 else tuple(number / length for number in numbers)

    return BeforeValidator(validate)


def choice(*allowed: str) -> BeforeValidator:
    """Return a validator for one of a few names; the error for a misspelt one has the nearest."""

    def validate(value: Any) -> Any:
        if value not in allowed:
            hint = suggestion(value, allowed)
            raise problem("", f"must be one of {', '.join(allowed)}{hint}", value)
        return value

    return BeforeValidator(validate)


def nearest(name: Any, names: Iterable[str]) -> str | None:
    """Return the name that a misspelt one most likely means, or None."""
    folded = {candidate.casefold(): candidate for candidate in names}
    matches = difflib.get_close_matches(str(name).casefold(), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else None


def suggestion(name: Any, names: Iterable[str]) -> str:
    """Return the nearest valid name as the end of a message; empty if none is near."""
    nearest_name = nearest(name, names)
    return f"; did you mean {nearest_name}?" if nearest_name else ""


def choices(name: Any, names: Iterable[str]) -> str:
    """Return the valid names as the end of a message: the nearest ones if there are too many to read."""
    valid = list(names)
    shown = (
        valid
        if len(valid) <= _MOST_NAMES_LISTED
        else difflib.get_close_matches(str(name), valid, _NEAREST_NAMES_LISTED, cutoff=0.0)
    )
    rest = f" and {len(valid) - len(shown)} more" if len(shown) < len(valid) else ""
    return f"{', '.join(shown)}{rest}{suggestion(name, valid)}"


def expand(value: Numbers, size: int) -> NDArray[np.float64]:
    """Return one number per item, shape (size,), from one number for all or one for each."""
    if isinstance(value, int | float):
        numbers = np.empty(size)
        numbers.fill(value)
        return numbers
    if len(value) == size:
        return np.array(value, dtype=float)
    return np.broadcast_to(np.asarray(value, dtype=float), (size,)).copy()


def finite_vector(name: str, value: Sequence[float] | NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Return an argument as an array of ``size`` numbers."""
    numbers = np.asarray(value, dtype=float)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(name, f"must be {size} finite {'number' if size == 1 else 'numbers'}", numbers.tolist())
    return numbers


def check_size(value: Numbers, names: Sequence[str], entry: str, kind: str) -> None:
    """Raise the error of an entry whose list does not have one number per name."""
    if isinstance(value, tuple) and len(value) != len(names):
        listed = f"a list of {len(names)}, one per {kind} ({', '.join(names)})" if names else f"left out: no {kind}"
        raise problem(entry, f"must be one number, or {listed}", value)


def validate(model: type[_Model], table: Any, prefix: tuple[str, ...]) -> _Model:
    """Return the description that a table holds.

    Args:
        model: Which description.
        table: Keys and values as TOML has them.
        prefix: Place of the table in the whole input, for messages.
    """
    try:
        return model.model_validate(table)
    except ValidationError as error:
        _translate(model, error, prefix)


def _translate(model: type[BaseModel], error: ValidationError, prefix: tuple[str, ...]) -> NoReturn:
    # A misspelt key also makes the right one missing: the cause comes first.
    failure = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    location = [str(part) for part in failure["loc"] if part != "[key]"]
    entry = ".".join([*prefix, *location])
    value = None if isinstance(failure["input"], dict) else failure["input"]
    if failure["type"] == "entry":
        context = failure["ctx"]
        below = str(context["entry"])
        entry = f"{entry}{'' if below.startswith('[') or not below or not entry else '.'}{below}"
        raise InputError(entry, context["allowed"], context["value"].content) from None
    if failure["type"] == "extra_forbidden":
        names = sorted(field_names(model, location[:-1]))
        other = _OTHER_NAMES.get(location[-1])
        nearest_key = other if other in names else nearest(location[-1], names)
        hint = f"; did you mean {'.'.join([*prefix, *location[:-1], nearest_key])}?" if nearest_key else ""
        raise InputError(entry, f"unknown key; allowed here: {', '.join(names)}{hint}") from None
    if failure["type"] == "missing":
        raise InputError(entry, f"is missing: {document(model, location)}") from None
    message = failure["msg"]
    cause = failure.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        raise cause from None
    raise InputError(entry, _MESSAGES.get(failure["type"], message[:1].lower() + message[1:]), value) from None


# What people call keys whose names are not near.
_OTHER_NAMES = dict.fromkeys(("motor_position", "motor_angle"), "spool_angle")
_OTHER_NAMES |= dict.fromkeys(("winding", "windings", "tendon_length"), "tendon_winding")
_MESSAGES = {
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "string_type": "must be a string",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
    "string_pattern_mismatch": "names are letters, digits and underscores, and begin with a letter",
    "string_too_long": "is too long",
    "too_short": "must have at least one entry",
    "greater_than_equal": "must be at least 0",
}


def checker(low: float, high: float, above: bool, hint: str, whole: bool = False) -> Callable[[Any, str], float]:
    """Return a function that checks one number of `reals`, given its place in a list."""

    def check(value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            raise problem(where, "must be a number", value)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise problem(where, "must be a finite number", value)
        # Below 2.3e-308 doubles lose digits. A limit at zero is about the sign, not about the unit.
        if number < low or (above and number <= low + 2.3e-308):
            least = "at least 2.3e-308" if number > low else f"{'above' if above else 'at least'} {low:g}"
            raise problem(where, f"must be {least}{hint if low < 0.0 else ''}", value)
        if number > high:
            raise problem(where, f"must be at most {high:g}{hint}", value)
        if whole and number != int(number):
            raise problem(where, f"must be a whole number from {low:g} to {high:g}", value)
        return number

    return check
