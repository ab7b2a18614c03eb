"""Types of arrays that all rooms share."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

#: Floats of double precision.
Array = NDArray[np.float64]
#: Places in arrays.
Indices = NDArray[np.intp]
#: A number, or an array of numbers: functions of laws take and give either, by the same text.
Number: TypeAlias = float | NDArray[np.floating[Any]]
#: The same in functions that give an array for arrays alone.
Numeric = TypeVar("Numeric", Array, Number)
#: Numbers side by side: what a law returns, or its signals.
Numbers: TypeAlias = tuple[Number, ...]
#: Floats in memory, by index: an address to compiled code.
Pointer: TypeAlias = MutableSequence[float]
#: A law's parameters in the order of their names, each a number or one of every row.
Parameters: TypeAlias = Sequence[Number] | Array
