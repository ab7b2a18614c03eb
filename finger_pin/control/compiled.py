"""The paper's controller and a reference of sinusoids as arrays for the compiled core."""

from __future__ import annotations

import numpy as np

from finger_pin.control.proportional import ProportionalController
from finger_pin.control.reference import SignalReference
from finger_pin.core.plant import Control


def build_control(controller: ProportionalController, reference: SignalReference, actuated: int) -> Control:
    """Read the paper's controller and a reference of sinusoids into arrays; steps, ramps and samples are left out."""
    return Control(
        held=False,
        tension=np.zeros(actuated),
        gain=controller.gain,
        minimum=controller.minimum,
        inverse=np.ascontiguousarray(controller.inverse),
        internal=controller.internal,
        reference=np.ascontiguousarray(reference.signal.harmonics),
        coupling=reference.coupling.matrix,
        offset=reference.coupling.offset,
    )
