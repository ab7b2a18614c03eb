"""The energy account: where the energy is, where it enters and where it goes.

    d/dt (kinetic + gravity + what the rows store) = supplied by rows + fingertip force - lost in rows

It closes to the integrator's tolerance, or a sign somewhere is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.mechanism.evaluation import Books
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.kinematics import Kinematics, Motion

#: The power that the fingertip force supplies.
FINGERTIP = "fingertip"


@dataclass(frozen=True, eq=False)
class Flows:
    """Powers, W, or their integrals, J, by name.

    Slack is the difference that cutting a tension at zero makes: (f^a - f^f) v where f = 0. What the micro-damping
    takes while the bristles follow the motion it may return in part while they spring back.

    Attributes:
        values: By name, shape (..., f).
        names: f names.
        supplies: Those that come in; the others are lost.
    """

    values: Array
    names: tuple[str, ...]
    supplies: frozenset[str]

    @classmethod
    def of(cls, books: Books, rows: Array, fingertip: Array) -> Flows:
        """Join the powers of the rows, shape (..., powers), and that of the fingertip force, shape (...,)."""
        values = np.concatenate([rows, np.asarray(fingertip)[..., None]], axis=-1)
        return cls(values, (*books.powers, FINGERTIP), books.supplies | {FINGERTIP})

    def __getitem__(self, name: str) -> Array:
        """Return one of them, shape (...,)."""
        value: Array = self.values[..., self.names.index(name)]
        return value

    @property
    def net(self) -> Array:
        """Supplied less lost, shape (...,)."""
        return np.asarray(self.values @ [1.0 if name in self.supplies else -1.0 for name in self.names])


def energies(finger: Finger, signals: FingerSignals, motion: Motion | Kinematics) -> dict[str, Array]:
    """Return the stored energies at the given signals by name, shape (...,), J."""
    state, (stored, _) = signals.state, signals.mechanism.account()
    lumps = 0.5 * np.sum(finger.tendons.mass * state.passive_velocity**2, axis=-1)
    found = {"kinetic": motion.kinetic_energy + lumps, "gravity": motion.potential_energy, **stored}
    if finger.actuators.names and state.motor_velocity is not None:
        found["rotors"] = 0.5 * np.sum(finger.actuators.inertia * state.motor_velocity**2, axis=-1)
    if isinstance(motion, Motion) and motion.objects is not None:
        found["objects_kinetic"], found["objects_gravity"] = motion.objects
    return found


def stored_names(finger: Finger) -> tuple[str, ...]:
    """Return the names of the stored energies of a finger."""
    rotors = ("rotors",) if finger.actuators.names else ()
    objects = () if finger.surroundings is None else ("objects_kinetic", "objects_gravity")
    return ("kinetic", "gravity", *finger.mechanism.books.stored, *rotors, *objects)


def powers(signals: FingerSignals) -> Flows:
    """Return the powers supplied and lost at the given signals."""
    found = signals.mechanism
    if found.booked is not None:
        rows = found.booked[..., len(found.books.stored) :]
    else:
        rows = np.stack(list(found.account()[1].values()), axis=-1)
    return Flows.of(found.books, rows, np.sum(signals.external_torque * signals.state.velocity, axis=-1))
