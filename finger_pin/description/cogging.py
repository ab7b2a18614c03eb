"""Cogging of a motor as data."""

from __future__ import annotations

from typing import Annotated

from finger_pin.description.validation import Description, quantity, real


class Cogging(Description):
    """The torque of magnets on teeth, -A sin(n theta_m + phi), seen at the spool: A goes with the gear ratio, n too."""

    amplitude: Annotated[float, real(0.0, 1e4)] = quantity(..., unit="N m", source="fit", doc="A, largest torque.")
    per_turn: Annotated[float, real(0.0, 1e6, above=True)] = quantity(
        ..., unit="1", source="design", doc="n, periods a turn of the spool: those of the rotor times the gear ratio."
    )
    phase: Annotated[float, real(-100.0, 100.0, hint=" rad (is it in degrees?)")] = quantity(
        0.0, unit="rad", source="fit", doc="phi, of the torque at theta_m = 0."
    )
