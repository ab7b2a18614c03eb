"""The exceptions and warnings of finger_pin, under one root."""

from __future__ import annotations

import copyreg
import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


class _Whole:
    """Exceptions whose attributes go with them when they are copied, or sent by another process."""

    args: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]


class FingerPinError(_Whole, Exception):
    """Root of the project's exceptions."""


class ScenarioWarning(UserWarning):
    """Root of the project's warnings: a scenario that runs, but not as its author may expect."""


class MicroDampingWarning(ScenarioWarning):
    """The micro-damping of a law (9) is more than its viscous friction covers: friction can drive motion."""


class AccuracyWarning(ScenarioWarning):
    """Warning about a result that shows finer detail than its tolerances support."""


class LeftOutWarning(ScenarioWarning):
    """Something of a model that moves or carries anything was not carried over."""


class StartWarning(ScenarioWarning):
    """A run starts beyond the range of a joint or cord, whose stop throws it back."""


class SlowRunWarning(ScenarioWarning):
    """A run that takes far longer than what it simulates."""


class ClosureWarning(ScenarioWarning):
    """A finger whose tendons run along paths loses force closure somewhere in its range."""


class PathJumpWarning(ScenarioWarning):
    """A cord whose length jumps within the range of a joint: what pulls it against that place cannot go on."""


class SelfLockingWarning(ScenarioWarning):
    """A scenario comes close to the joint friction at which its finger locks itself, or exceeds it."""


class InputError(FingerPinError, ValueError):
    """An entry of the input is wrong; the message is one line that a person can act on.

    Attributes:
        entry: Dotted name of the entry, such as ``controller.gain``.
        value: The value given; None where the entry is missing or unknown.
        allowed: The values that are accepted, in words.
    """

    def __init__(self, entry: str, allowed: str, value: Any = None) -> None:
        """Name the entry, the values allowed and the value given."""
        self.entry = entry
        self.allowed = allowed
        self.value = value
        text = "" if value is None else f" = {toml_like(value)}"
        super().__init__(_one_line(f"{_shorten(entry, 200)}{text}: {allowed}"))


class IntegrationError(FingerPinError, RuntimeError):
    """The integrator could not reach the end of the simulation.

    Attributes:
        time: Simulated time reached, s.
        reason: Report of the integrator.
        advice: A remedy to try.
        result: Everything up to ``time``, or None if nothing was computed.
    """

    def __init__(self, time: float, reason: str, advice: str, result: xr.Dataset | None = None) -> None:
        """Name the time of the failure, its reason and a remedy."""
        self.time = time
        self.reason = reason
        self.advice = advice
        self.result = result
        super().__init__(f"the integration stopped at t = {time:.6g} s: {reason}; try {advice}")


class Interrupted(_Whole, KeyboardInterrupt):
    """A simulation or a study ended before its end: after Ctrl-C, or because ``stop`` said so.

    It is no `Exception`: nothing that takes errors takes it for one.

    Attributes:
        time: Simulated time reached, s; NaN where there are several runs.
        result: Everything up to then, or None if nothing was computed.
    """

    def __init__(self, time: float, result: xr.Dataset | None = None, reached: str = "") -> None:
        """Keep the computed part and its end time."""
        self.time = time
        self.result = result
        super().__init__(f"interrupted {reached or f'at t = {time:.6g} s'}")


class StudyError(FingerPinError):
    """Every run of a study failed.

    Attributes:
        result: The study's usual result, with the reason of every run.
    """

    def __init__(self, reason: str, result: xr.Dataset) -> None:
        """Name the reason of the first run's failure, and keep the partial result."""
        self.result = result
        super().__init__(_one_line(f"every run failed; the first one: {reason}"))


def toml_like(value: Any) -> str:
    """Return a value as a person would write it in a TOML file, shortened if long."""
    return _shorten(_toml_like(value, 4), 80)


def _toml_like(value: Any, depth: int) -> str:
    if isinstance(value, Mapping):
        return "{ ... }" if value else "{}"
    if isinstance(value, list | tuple):
        if depth == 0:
            return "[...]"
        return f"[{', '.join(_toml_like(item, depth - 1) for item in value[:20])}{', ...' if len(value) > 20 else ''}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 256:
        return f"an integer of {math.ceil(value.bit_length() * math.log10(2.0))} digits"
    if isinstance(value, str):
        return json.dumps(value[:200], ensure_ascii=False)
    return str(value)


def _shorten(text: str, size: int) -> str:
    return text if len(text) <= size else f"{text[: size - 3]}..."


def _one_line(text: str) -> str:
    """Return text with line breaks and other characters that would disturb a terminal spelt out."""
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)
