"""Rows: tables of all force elements; their arms and indices are the wiring of (18).

A row acts along its arm, tau = arm^T phi. What it sees of other rows is linear: its input and its load are sums of
their forces, and its reading is a sum of their states. Rows that share a law stand together in one table. States are
known before any force is: tables may read those of any other, their own too. Forces are evaluated in the order in which
tables read them, whatever the order in which tables are listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.exceptions import InputError
from finger_pin.laws.law import ContactLaw, Law
from finger_pin.mechanism.path_elements import Paths
from finger_pin.typing import Array

STORED, SUPPLIED, LOST = "stored", "supplied", "lost"


class Energy(NamedTuple):
    """Stored energy, J, or supplied or lost power, W; tables may share one.

    Attributes:
        name: In a result it follows ``energy_`` or ``power_``.
        label: A few words for people.
        kind: `STORED`, `SUPPLIED` or `LOST`; a table of rows takes it from its law.
    """

    name: str
    label: str
    kind: str = STORED


def energy(entry: Energy | str) -> Energy:
    """Return an energy, made from its name, which is then its label, if need be."""
    return Energy(entry, entry.replace("_", " ")) if isinstance(entry, str) else entry


#: The powers that a moving base supplies, and what moves objects along paths.
BASE, PRESCRIBED = Energy("palm", "motion of the palm", SUPPLIED), Energy("objects", "motion of objects", SUPPLIED)


@dataclass(frozen=True, eq=False)
class Energies:
    """The energies and powers of all rows, each once.

    Attributes:
        stored: Energies.
        powers: Powers, supplied and lost.
    """

    stored: tuple[Energy, ...]
    powers: tuple[Energy, ...]

    @classmethod
    def from_rows(cls, rows: Sequence[Rows], moved: bool = False, prescribed: bool = False) -> Energies:
        """Collect the energies and powers of tables, of moved coordinates and of a base that moves."""
        base = ((PRESCRIBED,) if prescribed else ()) + ((BASE,) if moved else ())
        return cls(
            _unique(table.stored for table in rows), (*_unique(p for table in rows for p in table.powers), *base)
        )


def _unique(energies: Iterable[Energy]) -> tuple[Energy, ...]:
    by_name: dict[str, Energy] = {}
    for entry in energies:
        by_name.setdefault(entry.name, entry)
    return tuple(by_name.values())


class Source(NamedTuple):
    """Where the first parameters of a table's law come from.

    Attributes:
        part: Attribute of `Finger`: a part that names an ``ENTRY`` of its description, of which they are the numbers.
        numbers: Gives them, shape (at most all, k), of that part.
    """

    part: str
    numbers: Callable[[Any], Array]


@dataclass(frozen=True, eq=False)
class Rows:
    """A table of rows that share a law; k rows, N coordinates.

    A contact has three rows: along its normal, and along two tangents; or four, the last about its normal. The
    parameters are then those of a third or a fourth of k.

    Attributes:
        group: Name of the table, by which later ones refer to it.
        law: The law.
        names: Names of the rows.
        parameters: The law's numbers, shape (len(law.parameters), k).
        arm: Shape (k, N), torque per force.
        measure: dl/dq, shape (k, N), for rows whose length is not measured along their arm; by default the arm.
        offset: Length at q = 0, shape (k,).
        channels: For rows with an input from outside, its indices, shape (k,); -1 for none.
        inputs: By group of other rows, weights of shape (k, rows there) with which their forces are the input.
        loads: By group of other rows, weights of shape (k, rows there) with which their forces are the load.
        readings: By group of any rows but contacts, weights of shape (k, rows there) with which their states are
            `Row.reading`.
        pins: For rows that are loaded as the pin of a joint (17), the joint's index, shape (k,): the load pulls along
            the link before the joint, and forces at the tips beyond it add.
        bends: Shape (k, N), how much |q| adds to the curvature (15).
        curvature_offset: Shape (k,), rad.
        paths: For every row what pieces of paths through space add to its length, arm and curvature.
        stored: The energy that the rows store, or its name; by default the group's.
        powers: The law's powers, supplies first, or their names; by default the group's name and the law's. Tables that
            give the same name share an entry of the account.
        unit: Of the rows' length, ``m`` or ``rad``; SI by default.
        pulls: For drives, the names of the tendons that they pull, one for each row: its force is a tension at the
            canal's entrance, its arm the tendon's. What several exert on one tendon adds up.
        source: Of numbers that change with a description's while all else of the table stays.
    """

    group: str
    law: Law | ContactLaw
    names: tuple[str, ...]
    parameters: Array
    arm: Array
    # What is left out is filled in below.
    measure: Array = None  # type: ignore[assignment]
    offset: Array = None  # type: ignore[assignment]
    channels: NDArray[np.int64] = None  # type: ignore[assignment]
    inputs: Mapping[str, Array] = field(default_factory=dict)
    loads: Mapping[str, Array] = field(default_factory=dict)
    readings: Mapping[str, Array] = field(default_factory=dict)
    pins: NDArray[np.int64] = None  # type: ignore[assignment]
    bends: Array = None  # type: ignore[assignment]
    curvature_offset: Array = None  # type: ignore[assignment]
    paths: Paths = ()
    stored: Energy = None  # type: ignore[assignment]
    powers: tuple[Energy, ...] = ()
    unit: str = ""
    pulls: tuple[str, ...] = ()
    source: Source | None = None

    def __post_init__(self) -> None:
        """Fill in defaults, and check the sizes."""
        count, width = self.count, np.shape(self.arm)[-1]
        shapes: dict[str, tuple[Any, tuple[int, ...], Any]] = {
            "parameters": (self.parameters, (len(self.law.parameters), len(self.names)), None),
            "arm": (self.arm, (count, width), None),
            "measure": (self.measure, (count, width), self.arm),
            "offset": (self.offset, (count,), 0.0),
            "channels": (self.channels, (count,), -1),
            "pins": (self.pins, (count,), -1),
            "bends": (self.bends, (count, width), 0.0),
            "curvature_offset": (self.curvature_offset, (count,), 0.0),
        }
        for name, (value, shape, default) in shapes.items():
            array = np.asarray(value) if value is not None or default is None else np.full(shape, default)
            if array.shape != shape:
                raise InputError(f"rows.{self.group}.{name}", f"must have shape {shape}, not {array.shape}")
            object.__setattr__(self, name, array)
        object.__setattr__(self, "paths", tuple(self.paths) or ((),) * count)
        if len(self.paths) != count:
            raise InputError(f"rows.{self.group}.paths", f"must be {count}, not {len(self.paths)}")
        if self.pulls and len(self.pulls) != count:
            raise InputError(f"rows.{self.group}.pulls", f"must be {count} tendons, not {len(self.pulls)}")
        if self.readings and not self.law.reads_states:
            raise InputError(f"rows.{self.group}.readings", f"law {self.law.name} reads no states (reads_states)")
        object.__setattr__(self, "stored", energy(self.stored or self.group))
        object.__setattr__(self, "powers", self._named_powers())

    def _named_powers(self) -> tuple[Energy, ...]:
        """Return the powers with their kinds, from the law."""
        law = self.law
        kinds = dict.fromkeys(law.supplies, SUPPLIED) | dict.fromkeys(law.losses, LOST)
        powers = [energy(each) for each in self.powers or [f"{self.group}_{name}" for name in kinds]]
        if len(powers) != len(kinds):
            names = [each.name for each in powers]
            raise InputError(f"rows.{self.group}.powers", f"must be {', '.join(kinds) or 'none'}", names)
        return tuple(each._replace(kind=kind) for each, kind in zip(powers, kinds.values(), strict=True))

    @property
    def count(self) -> int:
        """Number of arms."""
        return len(self.names) * self.law.arms

    @property
    def states(self) -> int:
        """Number of states."""
        return 0 if self.law.scale is None else len(self.names) * self.law.states

    @property
    def routed(self) -> bool:
        """Return whether paths through space belong to any row."""
        return any(self.paths)

    @cached_property
    def structure_key(self) -> tuple[Any, ...]:
        """All that does not change with numbers that stay zero or stay other than zero, to be compared by value."""
        wiring = self.inputs, self.loads, self.readings
        weighted = [(*each, *((matrix != 0.0).tobytes() for matrix in each.values())) for each in wiring]
        arrays = (self.arm != 0.0) | (self.measure != 0.0), self.bends != 0.0, self.channels, self.pins
        named = (self.group, self.law, self.paths, self.stored, self.powers)
        return (*named, *self.arm.shape, *weighted, *(each.tobytes() for each in arrays))

    def embed_coordinates(self, places: NDArray[np.int64], width: int) -> Rows:
        """Return the same rows with their coordinates at some places among more."""

        def wide(matrix: Array) -> Array:
            wider = np.zeros((len(matrix), width))
            wider[:, places] = matrix
            return wider

        return replace(self, arm=wide(self.arm), measure=wide(self.measure), bends=wide(self.bends))

    def with_parameters(self, parameters: Array | None) -> Rows:
        """Return the same rows with other first parameters of the law, shape (at most all, k); itself without any."""
        if parameters is None:
            return self
        rows = object.__new__(Rows)
        vars(rows).update(vars(self), parameters=np.vstack([parameters, self.parameters[len(parameters) :]]))
        return rows

    def __getitem__(self, name: str) -> Array:
        """Return a parameter of the law by its name, shape (k,); of contacts that of each."""
        numbers: Array = self.parameters[self.law.parameters.index(name)]
        return numbers

    def signal(self, name: str) -> int:
        """Return the index of a signal of the law by its name."""
        return self.law.signals.index(name)


@dataclass(frozen=True, eq=False)
class RowSignals:
    """Signals of the rows of one table; every array has shape (..., k).

    Attributes:
        rows: The table.
        row: Arguments of the law, a `Row`, or a `Touch` for contacts.
        force: phi.
        rate: z'.
        signals: Signals of the law, in its order.
    """

    rows: Rows
    row: Any
    force: Array
    rate: Array
    signals: tuple[Array, ...]

    def __getitem__(self, name: str) -> Array:
        """Return a signal of the law by its name."""
        return self.signals[self.rows.signal(name)]

    def field(self, name: str) -> Array:
        """Return a signal of the law, "force", "rate", or an argument of the law by its name."""
        if name in self.rows.law.signals:
            return self[name]
        return np.asarray(getattr(self if name in ("force", "rate") else self.row, name))

    def account(self) -> tuple[Array, dict[str, Array]]:
        """Return the stored energy of all rows together, J, and their powers by the names of the table, W."""
        rows = self.rows
        stored, *powers = rows.law.energy_terms(self.row, rows.parameters, self.force, self.rate, self.signals)
        return np.sum(stored, axis=-1), {
            each.name: np.sum(power, axis=-1) for each, power in zip(rows.powers, powers, strict=True)
        }


def weighted_sum(force: Array, weights: Array) -> Array:
    """Return sums of forces, shape (..., k), by weights of shape (k, n): shape (..., n).

    Of one state they have the same bits as of many, which a product of matrices does not promise.
    """
    return np.asarray(np.einsum("...k,kn->...n", force, weights))


def state_scales(rows: Sequence[Rows]) -> tuple[tuple[str, float], ...]:
    """Return name and scale of every state of tables of rows."""
    scales: list[tuple[str, float]] = []
    for table in rows:
        if table.law.scale is not None:
            for name in table.names:
                scales += [(f"{table.group}[{name}]", table.law.scale)] * table.law.states
    return tuple(scales)
