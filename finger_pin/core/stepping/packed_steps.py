"""Steps of an island with contacts, kept without the bristles that are never bent: most pairs never touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.stepping.island_stepper import Record
from finger_pin.core.tables.structure import Structure
from finger_pin.typing import Array, Indices


class PackedSteps:
    """Steps whose states have the numbers alone that were ever other than zero, and all but bristles of contacts.

    Attributes:
        stored: Of the numbers of the state those that are stored, shape (size,).
    """

    def __init__(self, structure: Structure, start: Array) -> None:
        """Begin with no steps, from a state, shape (size,)."""
        first = 2 * len(structure.prescribed)
        self.stored: NDArray[np.bool_] = np.ones(len(start), dtype=bool)
        self.stored[first : first + structure.contact_rows - structure.contact_rows // structure.contact_arms] = False
        self.stored |= start != 0.0
        self._records: list[tuple[Indices, Record]] = []

    def add(self, record: Record) -> None:
        """Add the next steps, a copy."""
        self.stored |= record.states.any(axis=0) | record.dense.any(axis=(0, 1))
        columns, branches = np.flatnonzero(self.stored), record.branches
        kept = Record(
            times=record.times.copy(),
            states=record.states[:, columns],
            attitudes=record.attitudes.copy(),
            dense=record.dense[..., columns],
            shares=record.shares.copy(),
            branches=np.subtract(branches > 0.0, branches < 0.0, dtype=np.int8),
        )
        self._records.append((columns, kept))

    def joined(self) -> Record:
        """Return all steps, of which there must be a record, with the numbers that are stored at last."""
        width = int(np.count_nonzero(self.stored))
        records = []
        for columns, record in self._records:
            places = np.cumsum(self.stored)[columns] - 1
            wide = {name: np.zeros((*getattr(record, name).shape[:-1], width)) for name in ("states", "dense")}
            for name, values in wide.items():
                values[..., places] = getattr(record, name)
            records.append(vars(replace(record, **wide)).values())
        return Record(*(np.concatenate(parts) for parts in zip(*records, strict=True)))
