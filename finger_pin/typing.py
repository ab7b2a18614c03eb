"""Types of arrays that all rooms share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Floats of double precision.
Array = NDArray[np.float64]
#: Places in arrays.
Indices = NDArray[np.intp]
