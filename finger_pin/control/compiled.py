"""The paper's controller and a harmonic reference as arrays for the compiled core."""

from __future__ import annotations

import numpy as np

from finger_pin.control.proportional import ProportionalController
from finger_pin.control.reference import HarmonicReference
from finger_pin.core.plant import Control


def build_control(controller: ProportionalController, reference: HarmonicReference, actuated: int) -> Control:
    """Read the paper's controller and a harmonic reference into arrays."""
    return Control(
        held=False,
        tension=np.zeros(actuated),
        gain=controller.gain,
        minimum=controller.minimum,
        inverse=np.ascontiguousarray(controller.inverse),
        internal=controller.internal,
        reference=np.column_stack([reference.offset, reference.amplitude, reference.frequency, reference.phase]),
        coupling=reference.coupling.matrix,
        offset=reference.coupling.offset,
    )
