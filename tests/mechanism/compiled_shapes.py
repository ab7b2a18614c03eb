"""Functions of spans and gaps as the core compiles and calls them, whose code is kept on disk."""

from ctypes import CFUNCTYPE, c_void_p

import numpy as np

from finger_pin.core.addresses.shape_code import shape_address


def fill_rows(function, size, y, p):
    """Return what a function fills for each row of y and p, shape (m, size)."""
    call = CFUNCTYPE(None, c_void_p, c_void_p, c_void_p)(shape_address(function))
    arrays = [np.ascontiguousarray(y, float), np.ascontiguousarray(p, float), np.zeros((len(y), size))]
    places = [(each.ctypes.data, each.strides[0]) for each in arrays]
    for k in range(len(y)):
        call(*(first + k * step for first, step in places))
    return arrays[-1]
