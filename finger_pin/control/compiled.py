"""The paper's controller and a harmonic reference as arrays for the compiled core."""

from __future__ import annotations

import numpy as np

from finger_pin.control.proportional import ProportionalController
from finger_pin.control.reference import HarmonicReference
from finger_pin.core.inputs import Control, Signal, planned_control
from finger_pin.description.routing import Array, Routing


def build_control(controller: ProportionalController, reference: HarmonicReference, routing: Routing) -> Control:
    """Return controller and reference as inputs of a finger's mechanism, whose coordinates are (theta, p)."""
    tendons = np.arange(len(routing.tendons))

    def padded(values: Array) -> Array:
        return np.concatenate([values, np.zeros((*values.shape[:-1], routing.passive))], axis=-1)

    return planned_control(
        routing.actuated,
        gain=padded(controller.gain),
        minimum=controller.minimum,
        inverse=padded(controller.inverse),
        internal=controller.internal,
        channel=np.where(tendons < routing.actuated, tendons, -1),
        reference=Signal(
            np.column_stack([reference.offset, reference.amplitude, reference.frequency, reference.phase]),
            np.zeros(0),
            np.zeros((1, 0, len(routing.joints))),
        ),
        coupling=np.concatenate([reference.coupling.matrix, np.zeros((routing.passive, len(routing.joints)))]),
        offset=padded(reference.coupling.offset),
    )
