"""Axes of tables: every field is declared with its own, and the tables of a part of a mechanism follow from that."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]
_Table = TypeVar("_Table", bound=NamedTuple)


class Along(NamedTuple):
    """The axes of a field.

    Attributes:
        axes: Names, a letter for one that every part has whole, one for each dimension.
        of: The axis whose indices its values are, -1 for none; empty for numbers.
        starts: The axis of entries, of which each place has some: its values are where these begin, and the end.
    """

    axes: tuple[str, ...]
    of: str = ""
    starts: str = ""


def along(*axes: str, of: str = "", starts: str = "") -> Along:
    """Return the axes of a field, to be annotated."""
    return Along(axes, of, starts)


@cache
def _declared(table: type) -> dict[str, Along]:
    """Return the axes of the fields of a table that have some."""
    hints = get_type_hints(table, include_extras=True)
    return {
        name: each for name, hint in hints.items() for each in getattr(hint, "__metadata__", ()) if type(each) is Along
    }


class Subset:
    """A part of tables: the indices kept of every axis.

    Attributes:
        kept: By axis, the indices that are kept, in order.
        new: By axis, the new index of every old one, -1 where it is not kept; then -1, which stands for none.
    """

    def __init__(self) -> None:
        """Start empty."""
        self.kept: dict[str, Indices] = {}
        self.new: dict[str, Indices] = {}

    def keep(self, axis: str, indices: Indices, size: int) -> None:
        """Keep some indices of an axis of a size."""
        self.kept[axis] = indices
        self.new[axis] = np.full(size + 1, -1, dtype=np.int64)
        self.new[axis][indices] = np.arange(len(indices))

    def keep_entries(self, table: NamedTuple, axis: str) -> None:
        """Keep the entries of all kept places, from their beginnings."""
        starts = [(getattr(table, name), each.axes[0]) for name, each in _fields(table) if each.starts == axis]
        ranges = [np.arange(start[k], start[k + 1]) for start, places in starts for k in self.kept[places]]
        self.keep(axis, np.concatenate([np.zeros(0, dtype=np.int64), *ranges]), int(starts[-1][0][-1]))

    def select(self, table: _Table) -> _Table:
        """Return the table of this part; fields without axes stay as they are."""
        fields: dict[str, Any] = {}
        ends: dict[str, int] = {}
        for name, (axes, of, starts) in _fields(table):
            value = getattr(table, name)
            if starts:
                counts = np.diff(value)[self.kept[axes[0]]]
                fields[name] = ends.get(starts, 0) + np.append(0, np.cumsum(counts))
                ends[starts] = int(fields[name][-1])
                continue
            for place, axis in enumerate(axes):
                if axis in self.kept:
                    value = value.take(self.kept[axis], axis=place)
            fields[name] = self.new[of][value] if of else value
        return table._replace(**fields)


def _fields(table: NamedTuple) -> Any:
    return _declared(type(table)).items()
