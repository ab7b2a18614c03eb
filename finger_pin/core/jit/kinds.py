"""Kinds of tables: the fields of one, and their places."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numba import types
from numba.extending import models, register_model
from numpy.typing import NDArray

from finger_pin.typing import Array

#: Bytes of a machine word.
WORD = 8


class Numbers(NamedTuple):
    """An array's numbers and dimensions; it is contiguous."""

    dtype: str
    dimensions: int


Vector = Annotated[Array, Numbers("float64", 1)]
Matrix = Annotated[Array, Numbers("float64", 2)]
Layers = Annotated[Array, Numbers("float64", 3)]
IndexTable = Annotated[NDArray[np.int64], Numbers("int64", 2)]
Indices = Annotated[NDArray[np.int64], Numbers("int64", 1)]


class Kind(types.Type):  # type: ignore[misc]
    """The kind of a table: a NamedTuple whose fields are arrays of the kinds above, numbers, or such tables.

    Attributes:
        fields: By name, the kinds: of numbers ``int``, ``float`` or ``bool``.
        places: By name, how many bytes after the table's beginning each field stands.
    """

    def __init__(self, table: Any) -> None:
        """Read the annotations."""
        super().__init__(name=f"{table.__module__}.{table.__qualname__}")
        self.fields: dict[str, Any] = {}
        self.places: dict[str, int] = {}
        self.words = 0
        for name, hint in get_type_hints(table, include_extras=True).items():
            own = Kind(hint) if hasattr(hint, "_fields") else hint
            self.fields[name] = own if own in (int, float, bool) or isinstance(own, Kind) else hint.__metadata__[0]
            self.places[name] = WORD * self.words
            self.words += _words(self.fields[name])


register_model(Kind)(models.OpaqueModel)


def _words(kind: Any) -> int:
    """Return the number of words of a field; an array's are its address and its sizes."""
    if isinstance(kind, Numbers):
        return 1 + kind.dimensions
    return int(kind.words) if isinstance(kind, Kind) else 1
