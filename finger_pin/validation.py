"""Field types shared by every description: finite numbers with bounds, vectors, names.

A description is a frozen pydantic model. Every physical field is made by `quantity`, which carries its unit and
its source beside the bounds, so that a schema printed from the models documents itself.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints
from pydantic_core import PydanticCustomError

Name = Annotated[str, StringConstraints(strict=True, pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=64)]
Numbers = float | tuple[float, ...]


class Description(BaseModel):
    """Base of all descriptions: frozen, no unknown entries, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def problem(entry: str, allowed: str, value: Any = None) -> PydanticCustomError:
    """Return an error that names an entry below the model that raises it.

    Args:
        entry: Dotted name relative to the model, such as ``stiction``; empty for the model itself.
        allowed: What would be accepted.
        value: What was given.
    """
    return PydanticCustomError("entry", "{allowed}", {"entry": entry, "allowed": allowed, "value": value})


def quantity(default: Any, *, unit: str, source: str, doc: str) -> Any:
    """Return a field that carries its unit and source.

    Args:
        default: Default value; `...` where the entry must be given.
        unit: SI unit, ``1`` for a pure number.
        source: Equation, table or reason behind the default.
        doc: One sentence; the paper's symbol first where it has one.
    """
    return Field(default, description=doc, json_schema_extra={"unit": unit, "source": source})


def real(
    low: float = -math.inf, high: float = math.inf, *, above: bool = False, hint: str = ""
) -> BeforeValidator:
    """Return a validator for one finite number in [low, high], or (low, high] with ``above``."""
    check = _checker(low, high, above, hint)
    return BeforeValidator(lambda value: check(value, ""))


def reals(
    low: float = -math.inf, high: float = math.inf, *, above: bool = False, hint: str = ""
) -> BeforeValidator:
    """Return a validator for one finite number or a list of them, each in [low, high]."""
    check = _checker(low, high, above, hint)

    def validate(value: Any) -> Numbers:
        if isinstance(value, list | tuple):
            if not value:
                raise problem("", "must be a number or a list of numbers", value)
            return tuple(check(item, f"[{index}]") for index, item in enumerate(value))
        return check(value, "")

    return BeforeValidator(validate)


def vector(size: int, low: float = -math.inf, high: float = math.inf) -> BeforeValidator:
    """Return a validator for a list of ``size`` finite numbers in [low, high]."""
    check = _checker(low, high, False, "")

    def validate(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) != size:
            raise problem("", f"must be a list of {size} numbers", value)
        return tuple(check(item, f"[{index}]") for index, item in enumerate(value))

    return BeforeValidator(validate)


def choice(*allowed: str) -> BeforeValidator:
    """Return a validator for one of a few names; a near miss is told the nearest one."""

    def validate(value: Any) -> Any:
        if value not in allowed:
            near = nearest(value, allowed)
            hint = f"; did you mean {near}?" if near else ""
            raise problem("", f"must be one of {', '.join(allowed)}{hint}", value)
        return value

    return BeforeValidator(validate)


def nearest(name: Any, names: Iterable[str]) -> str | None:
    """Return the name that a misspelt one most likely means, or None."""
    folded = {candidate.casefold(): candidate for candidate in names}
    found = difflib.get_close_matches(str(name).casefold(), folded, n=1, cutoff=0.6)
    return folded[found[0]] if found else None


def expand(value: Numbers, size: int) -> NDArray[np.float64]:
    """Return one number per item, shape (size,), from one number for all or one for each."""
    return np.broadcast_to(np.asarray(value, dtype=float), (size,)).copy()


def check_size(value: Numbers, names: Sequence[str], entry: str, what: str) -> None:
    """Raise the error of an entry whose list does not have one number per name."""
    if isinstance(value, tuple) and len(value) != len(names):
        listed = ", ".join(names) if names else "none"
        raise problem(entry, f"must be one number or one per {what}, {len(names)} numbers ({listed})", value)


def _checker(low: float, high: float, above: bool, hint: str) -> Callable[[Any, str], float]:
    def check(value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            raise problem(where, "must be a number", value)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise problem(where, "must be a finite number", value)
        if number < low or (above and number == low):
            raise problem(where, f"must be {'above' if above else 'at least'} {low:g}", value)
        if number > high:
            raise problem(where, f"must be at most {high:g}{hint}", value)
        return number

    return check
