"""Everything that finger_pin raises on purpose, under one root."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


class FingerPinError(Exception):
    """Root of the project's exceptions."""


class InputError(FingerPinError, ValueError):
    """An entry of the input is wrong; the message is one line that a person can act on.

    Attributes:
        entry: Dotted name of the entry, such as ``controller.gain``.
        value: What was given; None where the entry is missing or unknown.
        allowed: What would be accepted.
    """

    def __init__(self, entry: str, allowed: str, value: Any = None) -> None:
        """Name the entry, what it may be and what it was."""
        self.entry = entry
        self.allowed = allowed
        self.value = value
        text = "" if value is None else f" = {_short(value)}"
        super().__init__(f"{entry}{text}: {allowed}")


class IntegrationError(FingerPinError, RuntimeError):
    """The integrator could not reach the end of the simulation.

    Attributes:
        time: Simulated time reached, s.
        reason: What the integrator reported.
        advice: What to try.
        result: Everything up to ``time``, or None if nothing was computed.
    """

    def __init__(self, time: float, reason: str, advice: str, result: xr.Dataset | None = None) -> None:
        """Say until when, why, and what to try."""
        self.time = time
        self.reason = reason
        self.advice = advice
        self.result = result
        super().__init__(f"the integration stopped at t = {time:.6g} s: {reason}; try {advice}")


class Interrupted(FingerPinError):
    """The simulation was asked to stop before its end.

    Attributes:
        time: Simulated time reached, s.
        result: Everything up to ``time``, or None if nothing was computed.
    """

    def __init__(self, time: float, result: xr.Dataset | None = None) -> None:
        """Keep what was computed."""
        self.time = time
        self.result = result
        super().__init__(f"interrupted at t = {time:.6g} s")


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:77] + "..."
