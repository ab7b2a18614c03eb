"""What evaluating a mechanism gives, and how its energies and powers are booked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.mechanism.rows import Rows, RowSignals

#: The powers that a moving base supplies, and what moves objects along paths.
BASE, GUIDED = "palm", "objects"
#: Where the accelerations of coordinates that are moved along paths stand, after the numbers of `laws.palm`.
GUIDES = 27


@dataclass(frozen=True, eq=False)
class Books:
    """Names under which the rows' energies and powers are booked; some tables share a name.

    Attributes:
        stored: Energies.
        powers: Powers, supplied and lost.
        supplies: Those of them that are supplied.
    """

    stored: tuple[str, ...]
    powers: tuple[str, ...]
    supplies: frozenset[str]

    @classmethod
    def of(cls, rows: Sequence[Rows], moved: bool = False, guided: bool = False) -> Books:
        """Collect the names of tables, and those of moved coordinates and of a base that moves."""
        base = ((GUIDED,) if guided else ()) + ((BASE,) if moved else ())
        return cls(
            stored=tuple(dict.fromkeys(table.stored for table in rows)),
            powers=(*dict.fromkeys(name for table in rows for name in table.powers), *base),
            supplies=frozenset(name for table in rows for name in table.powers[: len(table.law.supplies)]) | {*base},
        )


@dataclass(frozen=True, eq=False)
class Touching:
    """What contacts do in space, base frame; zero where they are open. Shapes (..., c, 3).

    Attributes:
        force: On the second body of the pair, N.
        point: Midway between the surfaces, m.
        normal: Unit vector from the second body towards the first.
    """

    force: Array
    point: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything at one state or at many; leading dimensions are kept.

    Attributes:
        books: Names of energies and powers.
        rows: What the rows do, by table.
        torque: Sum of A^T phi, shape (..., N).
        external: J^T F, shape (..., N).
        acceleration: v', shape (..., N).
        rate: Time derivative of the packed state, shape (..., size).
        base_power: That of a base that moves, shape (..., 1), W.
        guided_power: That of what moves coordinates along paths, shape (...,), W.
        booked: Energies and powers in the order of the books, shape (..., books), J and W, where they are known.
        touching: What contacts do in space, where it is known.
    """

    books: Books
    rows: dict[str, RowSignals]
    torque: Array
    external: Array
    acceleration: Array
    rate: Array
    base_power: Array | None = None
    guided_power: Array | None = None
    booked: Array | None = None
    touching: Touching | None = None

    def account(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return the energies that the rows store, J, and their powers, W, by name; shapes (...,)."""
        if self.booked is not None:
            columns = np.moveaxis(self.booked, -1, 0)
            count = len(self.books.stored)
            return (
                dict(zip(self.books.stored, columns[:count], strict=True)),
                dict(zip(self.books.powers, columns[count:], strict=True)),
            )
        nothing = np.zeros(self.rate.shape[:-1])
        energies, powers = dict.fromkeys(self.books.stored, nothing), dict.fromkeys(self.books.powers, nothing)
        for signals in self.rows.values():
            stored, flows = signals.account()
            energies[signals.rows.stored] = energies[signals.rows.stored] + stored
            for name, value in flows.items():
                powers[name] = powers[name] + value
        if self.guided_power is not None:
            powers[GUIDED] = self.guided_power
        if self.base_power is not None:
            powers[BASE] = self.base_power[..., 0]
        return energies, powers
