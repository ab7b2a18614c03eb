"""The energy account: energies stored, supplied and lost, by name.

    d/dt (kinetic + gravity + what the rows store) = supplied by rows + fingertip force - lost in rows

It closes to the integrator's tolerance, or a sign somewhere is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.rows import SUPPLIED, Energies, Energy
from finger_pin.mechanism.state import Kinematics, Motion
from finger_pin.typing import Array

FINGERTIP = Energy("fingertip", "fingertip force", SUPPLIED)
_KINETIC, _GRAVITY = Energy("kinetic", "kinetic"), Energy("gravity", "gravity")
_ROTOR_TERM = Energy("rotors", "rotors")
_OBJECT_TERMS = Energy("objects_kinetic", "objects, kinetic"), Energy("objects_gravity", "objects, gravity")


@dataclass(frozen=True, eq=False)
class Flows:
    """Powers, W, or their integrals, J, by name.

    Slack is the difference that cutting a tension at zero makes: (f^a - f^f) v where f = 0. Micro-damping may return
    part of the energy that it takes while the bristles spring back.

    Attributes:
        values: By name, shape (..., f).
        energy_terms: Energies and powers of the f of them.
    """

    values: Array
    energy_terms: tuple[Energy, ...]

    @classmethod
    def from_rows(cls, energies: Energies, rows: Array, fingertip: Array) -> Flows:
        """Join the powers of the rows, shape (..., powers), and that of the fingertip force, shape (...,)."""
        values = np.concatenate([rows, np.asarray(fingertip)[..., None]], axis=-1)
        return cls(values, flow_terms(energies))

    def __getitem__(self, name: str) -> Array:
        """Return one energy or power by name, shape (...,)."""
        value: Array = self.values[..., [each.name for each in self.energy_terms].index(name)]
        return value

    @property
    def net(self) -> Array:
        """Supplied less lost, shape (...,)."""
        return np.asarray(self.values @ [1.0 if each.kind == SUPPLIED else -1.0 for each in self.energy_terms])


def energies(finger: Finger, signals: FingerSignals, motion: Motion | Kinematics) -> dict[str, Array]:
    """Return the stored energies at the given signals by name, shape (...,), J."""
    state, (stored, _) = signals.state, signals.mechanism.account()
    lumps = 0.5 * np.sum(finger.tendons.mass * state.passive_velocity**2, axis=-1)
    energy_by_name = {_KINETIC.name: motion.kinetic_energy + lumps, _GRAVITY.name: motion.potential_energy, **stored}
    if finger.actuators.names and state.motor_velocity is not None:
        rotor_velocity = np.concatenate([state.spool_velocity, state.motor_velocity], axis=-1)
        energy_by_name[_ROTOR_TERM.name] = 0.5 * np.sum(finger.actuators.inertias * rotor_velocity**2, axis=-1)
    if isinstance(motion, Motion) and motion.objects is not None:
        energy_by_name |= dict(zip((each.name for each in _OBJECT_TERMS), motion.objects, strict=True))
    return energy_by_name


def flow_terms(energies: Energies) -> tuple[Energy, ...]:
    """Return the entries of a mechanism's powers, with that of the fingertip force."""
    return (*energies.powers, FINGERTIP)


def stored_terms(finger: Finger) -> tuple[Energy, ...]:
    """Return the entries of a finger's stored energies."""
    rotors = (_ROTOR_TERM,) if finger.actuators.names else ()
    objects = () if finger.scene is None else _OBJECT_TERMS
    return (_KINETIC, _GRAVITY, *finger.mechanism.energies.stored, *rotors, *objects)


def powers(signals: FingerSignals) -> Flows:
    """Return the powers supplied and lost at the given signals."""
    evaluation = signals.mechanism
    if evaluation.energy_terms is not None:
        rows = evaluation.energy_terms[..., len(evaluation.energies.stored) :]
    else:
        rows = np.stack(list(evaluation.account()[1].values()), axis=-1)
    return Flows.from_rows(evaluation.energies, rows, np.sum(signals.external_torque * signals.state.velocity, axis=-1))


def account_entries(result: xr.Dataset, *kinds: str) -> dict[str, xr.Variable]:
    """Return the energies in a result's account, J, that are of some kinds: stored, supplied or lost.

    Args:
        result: Dataset of `simulate`.
        kinds: `STORED`, `SUPPLIED` or `LOST`, of `mechanism.rows`.

    Returns:
        By the name of the variable; ``label`` among its attributes says in words what it is.
    """
    return {
        str(name): values
        for name, values in result.variables.items()
        if values.attrs.get("account") in kinds and values.attrs["units"] == "J"
    }
