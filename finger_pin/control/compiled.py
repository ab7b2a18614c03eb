"""Controllers and signals as arrays for the compiled core."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from finger_pin.core.compiled_finger import CompiledFinger
from finger_pin.core.control import Control, held_control
from finger_pin.core.evaluation import time_functions as signal_core
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.description.routing import Array
from finger_pin.mechanism.finger import Finger
from finger_pin.references.signal import Signal

if TYPE_CHECKING:
    from finger_pin.control.closed_loop import ClosedLoop


@dataclass(eq=False)
class Bindings:
    """Compiled code bound to one finger after the other, kept if they differ in numbers alone.

    Of each finger the work is done when the next one comes.

    Attributes:
        dynamics: Evaluator of the finger.
        stepper: Its stepper.
    """

    dynamics: CompiledFinger | None = None
    stepper: Stepper | None = None

    def evaluating(self, finger: Finger) -> CompiledFinger:
        """Return the compiled evaluator of a finger."""
        if self.dynamics is None or not self.dynamics.renew(finger):
            self.dynamics = CompiledFinger(finger)
        return self.dynamics

    def stepping(
        self,
        finger: Finger,
        control: Control,
        x: Array,
        force: Array | None = None,
        *,
        method: str,
        rtol: float,
        atol_scale: float,
        judged: bool = False,
    ) -> Stepper:
        """Return the stepper of a finger under inputs, from a packed state on.

        Args:
            finger: The finger.
            control: Its inputs.
            x: Packed state, shape (size,).
            force: At the tips, shape (3,) or (t, 3), N, base frame.
            method: One of `TABLEAUS`.
            rtol: Relative tolerance.
            atol_scale: Absolute tolerance over the scale of each kind of state.
            judged: Whether the error will be asked for; of one finger after the other it is always, or never.
        """
        given = finger.mechanism, control, x, TABLEAUS[method](), rtol, atol_scale * finger.layout.scales(), force
        if self.stepper is None or not self.stepper.renew(*given):
            self.stepper = Stepper(*given, judged=judged)
        return self.stepper


def compiled_control(loop: ClosedLoop) -> Control | None:
    """Return a loop's controller, reference and varying force as arrays, or None if the first two are Python."""
    if len(loop.finger.actuators.positioned) == loop.finger.mechanism.channels:
        # Nothing of what the controller plans goes to the finger at once.
        return sampled_control(loop)
    control = loop.controller.as_control(loop.reference, loop.finger)
    return None if control is None else with_force(control, loop)


def sampled_control(loop: ClosedLoop) -> Control:
    """Return inputs that hold the commands of a sampled controller, with the loop's varying force."""
    mechanism = loop.finger.mechanism
    return with_force(held_control(mechanism.channels, mechanism.coordinates), loop)


def with_force(control: Control, loop: ClosedLoop) -> Control:
    """Return inputs with the path of the palm and the force at the fingertip, its varying and its constant part."""
    if loop.palm is not None:
        control = control._replace(palm=core_signal(loop.palm.signal))
    if loop.guides is not None:
        control = control._replace(guide=core_signal(loop.guides.signal))
    if loop.varying_force is None:
        return control
    force = core_signal(loop.varying_force)
    force.harmonics[:, 0] += loop.fingertip_force.ravel()
    return control._replace(force=force)


def core_signal(signal: Signal) -> signal_core.SignalTable:
    """Return a signal as arrays of the core's own; polynomials that are zero are left out."""
    harmonics = np.array(signal.harmonics, dtype=float)
    if signal.is_harmonic:
        return signal_core.SignalTable(harmonics, np.zeros(0), np.zeros((6, 0, len(harmonics))))
    return signal_core.SignalTable(harmonics, signal.knots.copy(), signal.coefficients.copy())
