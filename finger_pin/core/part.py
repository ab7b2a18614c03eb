"""One island under way: bound to compiled code, with the memory that a continued integration needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core import rosenbrock as core
from finger_pin.core.binding import bound
from finger_pin.core.charts import place_all
from finger_pin.core.control import Control
from finger_pin.core.drives import DRIVEN, Driven, Drives, advance_driven
from finger_pin.core.islands import Island
from finger_pin.core.model import BoundModel
from finger_pin.core.tableaus import Tableau
from finger_pin.core.tables import Tables
from finger_pin.core.work import build_work
from finger_pin.description.routing import Array
from finger_pin.laws.law import ContactLaw, Law

FIRST_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Record:
    """Room for the steps of one island, at most m.

    Attributes:
        times: Ends of the steps, shape (m,), s.
        states: States there, before the angles of free bodies begin anew, shape (m, size).
        attitudes: Quaternions after that, shape (m, f, 4).
        dense: What the steps' interpolants are made of, shape (m, rows, size).
    """

    times: Array
    states: Array
    attitudes: Array
    dense: Array

    @classmethod
    def of(cls, count: int, size: int, free: int, rows: int) -> Record:
        """Make room."""
        return cls(np.zeros(count), np.zeros((count, size)), np.zeros((count, free, 4)), np.zeros((count, rows, size)))

    def first(self, count: int) -> Record:
        """Return a copy of the first steps."""
        return Record(*(part[:count].copy() for part in vars(self).values()))


class Part:
    """One island under way.

    Attributes:
        island: What it has of the whole.
        tables: Its tables.
        control: Its inputs.
        tableau: The method.
        x: Its packed state, shape (size,); the angles of free bodies since the last step.
        attitude: Quaternions of its free bodies, shape (f, 4).
        atol: Absolute tolerances, shape (size,).
        memory: Time, step size, error history and counters.
        drives: Loops of motors in position drive, which sample on the way; None for none.
    """

    drives: Drives | None = None

    def __init__(
        self,
        island: Island,
        laws: Sequence[Law | ContactLaw],
        tables: Tables,
        control: Control,
        x: Array,
        attitude: Array,
        tableau: Tableau,
        rtol: float,
        atol: Array,
        memory: Array,
    ) -> None:
        """Bind everything; arrays are taken as they are, not copied."""
        self.island, self._laws = island, laws
        # The block holds addresses: what it was made of lives as long as it does, and is not replaced.
        self.work = build_work(tables, laws, len(control.tension))
        self.model = BoundModel(tables, control, self.work)
        self._bound = core.Integration(
            model=self.model.address,
            tableau=tableau,
            x=x,
            attitude=attitude,
            rtol=rtol,
            atol=atol,
            memory=memory,
            k=np.zeros((len(tableau.nodes), len(x))),
            start=np.zeros(len(x)),
            r=np.zeros(len(x) + 1),
            drift=np.zeros(len(x)),
            kinks=np.zeros(len(tables.state)),
        )
        self._block = bound(self._bound, core.INTEGRATION)
        place_all(tables, attitude)
        self.tables, self.control, self.tableau = tables, control, tableau
        self.x, self.attitude, self.atol, self.memory = x, attitude, atol, memory
        self._nothing, self._taken = self.room(0), np.zeros(1, dtype=np.int64)
        # A record and loops, the blocks that hold them for compiled code, and the address of what it is given.
        self._placed: tuple[Record | None, Drives | None, list[NDArray[np.uint8]], int] = (None, None, [], 0)

    def room(self, count: int) -> Record:
        """Return room for so many steps."""
        return Record.of(count, len(self.x), len(self.attitude), len(self.tableau.dense))

    @property
    def time(self) -> float:
        """Time reached, s."""
        return float(self.memory[core.TIME])

    def advance(self, end: float, record: Record | None = None) -> tuple[int, int]:
        """Integrate to a time, or until a record is full; return the status and the number of recorded steps."""
        into = self._nothing if record is None else record
        self._taken[0] = 0
        status = (core.advance if self.drives is None else advance_driven)(self._place(into), end)
        return status, int(self._taken[0])

    def _place(self, record: Record) -> int:
        """Return where compiled code finds a record, with the loops of motors if any run."""
        if self._placed[0] is not record or self._placed[1] is not self.drives:
            room = (record.times, record.states, record.attitudes, record.dense)
            block = bound(core.Stretch(self._block.ctypes.data, *room, self._taken), core.STRETCH)
            blocks = [block]
            if self.drives is not None:
                driven = Driven(self.drives, block.ctypes.data, core.advance.address)
                blocks.append(bound(driven, DRIVEN))
            self._placed = record, self.drives, blocks, int(blocks[-1].ctypes.data)
        return self._placed[-1]

    def restart(self, x: Array, attitude: Array) -> None:
        """Go on from another state at the same time, with no memory of earlier steps."""
        self.x[:], self.attitude[:] = x, attitude
        self.work.paths.asleep[:] = 0
        place_all(self.tables, self.attitude)
        self.memory[[core.LAST_STEP, core.LAST_ERROR, core.CULPRIT, core.HELD_STEP]] = 0.0
        self.memory[core.STEP] = FIRST_STEP

    def with_loads(self, loaded: bool) -> Part:
        """Return the same part that minds forces at the tips, or not."""
        bound = self._bound
        return Part(
            self.island,
            self._laws,
            self.tables._replace(loaded=loaded),
            self.control,
            bound.x,
            bound.attitude,
            bound.tableau,
            bound.rtol,
            bound.atol,
            bound.memory,
        )

    def copy(self) -> Part:
        """Return an independent part that goes on bit by bit alike."""
        bound = self._bound
        tables = self.tables._replace(tip_force=self.tables.tip_force.copy(), bodies=self.tables.bodies.copy())
        return Part(
            self.island,
            self._laws,
            tables,
            self.control._replace(tension=self.control.tension.copy()),
            bound.x.copy(),
            bound.attitude.copy(),
            bound.tableau,
            bound.rtol,
            bound.atol,
            bound.memory.copy(),
        )


def failure(part: Part, status: int, names: list[str]) -> str:
    """Say what the status of an island means; empty if nothing failed."""
    culprit = names[max(int(part.memory[core.CULPRIT]), 0)]
    if status == core.UNDERFLOW:
        return f"the step size fell below the resolution of time; the error is largest in {culprit}"
    if status == core.CREEPING:
        return (
            f"the last {core.WINDOW} steps advanced by less than {core.LEAST_MEAN_STEP:g} s each; "
            f"the error is largest in {culprit}"
        )
    if status == core.NOT_FINITE:
        return f"the rate of {culprit} is not finite"
    if status == core.RUNAWAY:
        return f"{culprit} is beyond {core.FASTEST:g} rad/s (or m/s): the motion has left every physical range"
    return ""
