"""Evaluations of a mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.mechanism.rows import BASE, PRESCRIBED, Energies, RowSignals
from finger_pin.typing import Array

#: What an evaluation is wanted for: all, all but accelerations, or the rows' forces. It may give more than that.
Outputs = Literal["all", "no_acceleration", "row_forces"]


def check_outputs(outputs: str) -> None:
    """Refuse unknown outputs."""
    if outputs not in get_args(Outputs):
        raise InputError("outputs", f"must be one of {', '.join(get_args(Outputs))}", outputs)


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contacts in space, base frame; zero for open ones. Shapes (..., c, 3).

    Attributes:
        force: On the second body of the pair, N.
        point: Midway between the surfaces, m.
        normal: Gradient of the gap, from the second body towards the first: a unit vector but deep in an edge.
    """

    force: Array
    point: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything at one state or at many; leading dimensions are kept.

    Attributes:
        energies: Its energies and powers.
        rows: Signals of the rows, by table.
        torque: Sum of A^T phi, shape (..., N).
        tendon_torque: The part of tables of tendons in it, (11), shape (..., N).
        external: J^T F, shape (..., N).
        acceleration: v', shape (..., N).
        rate: Time derivative of the packed state, shape (..., size).
        base_power: Power of a base that moves, shape (..., 1), W.
        prescribed_power: Power of the guides that move coordinates along paths, shape (...,), W.
        energy_terms: Energies and powers in the order of `Energies`, shape (..., energies), J and W, if known.
        touching: Contacts in space, where they are known.
    """

    energies: Energies
    rows: dict[str, RowSignals]
    torque: Array
    tendon_torque: Array
    external: Array
    acceleration: Array
    rate: Array
    base_power: Array | None = None
    prescribed_power: Array | None = None
    energy_terms: Array | None = None
    touching: ContactPoints | None = None

    def account(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the energies that the rows store, J, and their powers, W, by name; shapes (...,)."""
        stored, flows = ([each.name for each in entries] for entries in (self.energies.stored, self.energies.powers))
        if self.energy_terms is not None:
            columns = np.moveaxis(self.energy_terms, -1, 0)
            return (
                dict(zip(stored, columns[: len(stored)], strict=True)),
                dict(zip(flows, columns[len(stored) :], strict=True)),
            )
        nothing = np.zeros(self.rate.shape[:-1])
        energies, powers = dict.fromkeys(stored, nothing), dict.fromkeys(flows, nothing)
        for signals in self.rows.values():
            energy, exchanged = signals.account()
            energies[signals.rows.stored.name] = energies[signals.rows.stored.name] + energy
            for name, value in exchanged.items():
                powers[name] = powers[name] + value
        if self.prescribed_power is not None:
            powers[PRESCRIBED.name] = self.prescribed_power
        if self.base_power is not None:
            powers[BASE.name] = self.base_power[..., 0]
        return energies, powers
