"""Elementary functions of compiled frictions."""

import numba
import numpy as np

from finger_pin.mujoco.vector_functions import angle, exponential


def test_the_exponential_is_numpy_s_to_the_last_digits_and_nothing_or_not_a_number_where_numpy_s_is():
    values = -np.concatenate([np.linspace(0.0, 1.0, 1001), np.geomspace(1e-20, 690.0, 2000), [1e3, np.inf, np.nan]])
    with np.errstate(invalid="ignore"):
        found = numba.vectorize(exponential.py_func)(values)
    np.testing.assert_allclose(found[:-3], np.exp(values[:-3]), rtol=5e-16)
    assert 0.0 <= found[-3] < 1e-300 and 0.0 <= found[-2] < 1e-300 and np.isnan(found[-1])


def test_angles_are_numpy_s_to_the_last_digits_in_the_upper_half_plane():
    angles, sizes = np.meshgrid(np.r_[np.geomspace(1e-9, 1.0, 50), np.linspace(0.0, np.pi, 501)], [1e-60, 1.0, 1e60])
    real, imaginary = sizes * np.cos(angles), sizes * np.sin(angles)
    found = numba.vectorize(angle.py_func)(real, imaginary)
    np.testing.assert_allclose(found, np.arctan2(imaginary, real), rtol=1e-15)
