"""The exponential of compiled frictions."""

import numba
import numpy as np

from finger_pin.mujoco.exponential import exponential


def test_it_is_numpy_s_to_the_last_digits_and_nothing_or_not_a_number_where_numpy_s_is():
    values = -np.concatenate([np.linspace(0.0, 1.0, 1001), np.geomspace(1e-20, 690.0, 2000), [1e3, np.inf, np.nan]])
    with np.errstate(invalid="ignore"):
        found = numba.vectorize(exponential.py_func)(values)
    np.testing.assert_allclose(found[:-3], np.exp(values[:-3]), rtol=5e-16)
    assert 0.0 <= found[-3] < 1e-300 and 0.0 <= found[-2] < 1e-300 and np.isnan(found[-1])
