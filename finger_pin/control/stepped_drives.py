"""Loops of motors in position drive for a caller that steps a finger, such as with `Simulator`."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from finger_pin.control.interface import ControlSignals
from finger_pin.control.position_drive import build_drives, sampled_voltages
from finger_pin.core.stepping.drives import sample
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

# What loops keep of every sample; and samples that there is room for at the start of a motion that is stepped.
_HISTORIES = ("goals", "prescribed_voltages", "supply", "voltages", "errors", "integrals")
_FIRST_SAMPLES = 64


class SteppedDrives:
    """The same loops for a caller that steps a finger by their period, such as with `Simulator`.

    Attributes:
        period: s.
    """

    def __init__(self, finger: Finger) -> None:
        """Read the motors of a finger in position drive, m of them."""
        self._holds, self._nominal = (
            finger.actuators.holds,
            np.array([each.motor.voltage for each in finger.description.actuators.values()]),
        )
        self._drives = build_drives(finger, np.zeros((1, int(self._holds.sum()))))
        self.period, self._tension = self._drives.period, np.zeros(finger.mechanism.channels)

    def reset(self) -> None:
        """Forget all samples."""
        self._drives.sample_count[:], self._drives.integral[:] = 0, 0.0

    def voltages(self, time: float, x: Array, goals: Array, supplies: Mapping[int, Signal] = {}) -> Array:
        """Return the voltages of a sample, shape (m,), V, at a packed state, for goals of spools, shape (m,), rad."""
        self._drives.goals[0] = goals
        self._drives.supply[0] = sampled_voltages(supplies, np.array([time]), 0.0, self._nominal)[0, self._holds]
        sample(self._drives, time, x, self._tension)
        return np.array(self._drives.voltages[0])


class SteppedGoals:
    """The same loops within a motion that a caller steps, such as with `Simulator`: it holds their goals over steps.

    Attributes:
        channels: The inputs that are their voltages.
        compiled: The loops as arrays, with room for the samples so far and some more.
    """

    def __init__(self, finger: Finger, time: float = 0.0) -> None:
        """Create the loops of a finger's motors in position drive, m of them, that sample from a time on, s."""
        self.channels = finger.actuators.voltages
        room = np.zeros((_FIRST_SAMPLES, len(self.channels)))
        self.compiled = build_drives(finger, room)._replace(first=time)

    def hold(self, stepper: Stepper, goals: Array, end: float) -> None:
        """Hold goals, shape (m,), rad, from the next sample on; have room for those of a stepper until a time, s."""
        missing = int(self.compiled.latest(end)) + 2 - len(self.compiled.goals)
        if missing > 0:
            self._lengthen(max(missing, len(self.compiled.goals)))
            for part in stepper.parts:
                if part.drives is not None:
                    part.drives = part.drives._replace(**self._histories)
        # A sample at this instant has been taken already, but not at the start.
        begun = stepper.time > self.compiled.first
        self.compiled.goals[int(self.compiled.latest(stepper.time)) + 1 if begun else 0 :] = goals

    @property
    def _histories(self) -> dict[str, Any]:
        return {name: getattr(self.compiled, name) for name in _HISTORIES}

    def _lengthen(self, rows: int) -> None:
        """Make room for further samples, whose goals are the last ones."""
        longer: dict[str, Any] = {}
        longer |= {
            name: np.concatenate([each, np.tile(each[-1:], (rows, 1))]) for name, each in self._histories.items()
        }
        self.compiled = self.compiled._replace(**longer)

    def copy(self, stepper: Stepper) -> SteppedGoals:
        """Return a copy of the loops that a stepper runs, which goes on by itself."""
        twin = copy.copy(self)
        count = max(int(part.drives.sample_count[0]) for part in stepper.parts if part.drives is not None)
        arrays: dict[str, Any] = {}
        arrays |= {name: getattr(self.compiled, name).copy() for name in (*_HISTORIES, "integral", "last")}
        twin.compiled = self.compiled._replace(sample_count=np.array([count]), **arrays)
        return twin

    def repeating(self, later: SteppedGoals) -> SteppedGoals:
        """Return loops that go on from the samples of these to the goals of later ones; they share no memory."""
        twin = copy.copy(self)
        arrays: dict[str, Any] = {}
        arrays |= {name: getattr(self.compiled, name).copy() for name in ("sample_count", "integral", "last")}
        twin.compiled = self.compiled._replace(**arrays)
        # At least one row, so that all histories are copies.
        twin._lengthen(len(later.compiled.goals) - len(self.compiled.goals) + 1)
        twin.compiled.goals[:-1] = later.compiled.goals
        return twin

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands as they are recorded: no tensions are planned for goals that are given."""
        return control

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages held at one time, shape (m,), or at times (k,), shape (k, m), V."""
        return self.compiled.zero_order_hold(self.compiled.voltages, time)
