"""Hysteresis of springs, a table beside that of the springs themselves."""

from __future__ import annotations

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.laws.hysteresis import HYSTERESIS, STIFFER
from finger_pin.mechanism.energies import Energy
from finger_pin.mechanism.rows import Rows

#: Least levels of what tendons, N, and joints' springs, N m, hold, as those of their friction.
OF_TENDONS, OF_JOINTS = 1e-4, 1e-7


def hysteresis_rows(group: str, springs: Rows, shares: Array, floor: float, lost: Energy) -> list[Rows]:
    """Return the table of springs' hysteresis, of those that have some; no table without any.

    Args:
        group: Its name.
        springs: The table of the springs; its law has a ``stiffness``.
        shares: h, shape (k,).
        floor: Least level of their bristles.
        lost: Entry of the account that its losses go to.
    """
    stiffness = springs.parameters[springs.law.parameters.index("stiffness")]
    held = np.flatnonzero(shares * stiffness)
    if not held.size:
        return []
    return [
        Rows(
            group=group,
            law=HYSTERESIS,
            names=tuple(springs.names[k] for k in held),
            parameters=np.array([shares[held], STIFFER * stiffness[held], np.full(len(held), floor)]),
            arm=springs.arm[held],
            loads={springs.group: np.eye(springs.count)[held]},
            stored=springs.stored,
            powers=(lost,),
            pulls=tuple(springs.pulls[k] for k in held if springs.pulls),
        )
    ]
