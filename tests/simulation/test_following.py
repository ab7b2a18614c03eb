"""What is evaluated in a second thread while a motion is integrated."""

import itertools

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import Interrupted


def assert_same(one, other):
    """Every variable of two results agrees to rounding, as multiples of its largest value, or of all energies."""
    assert set(one.data_vars) == set(other.data_vars)
    sizes = {name: np.nanmax(np.abs(values.values), initial=0.0) for name, values in one.data_vars.items()}
    energy = max(size for name, size in sizes.items() if name.startswith("energy_"))
    for name, values in one.data_vars.items():
        largest = energy if name.startswith("energy_") else sizes[name]
        assert np.allclose(other[name].values, values.values, rtol=0.0, atol=1e-12 * largest, equal_nan=True), name


@pytest.mark.parametrize("name", ["fig6", "servo", "press", "pinch"])
def test_a_result_is_the_same_evaluated_beside_its_integration_or_after_it(name):
    """Who watches a run evaluates it on the way: then nothing is evaluated in a second thread."""
    scenario = fp.load_scenario(name, {"simulation.duration": 0.8})
    assert_same(fp.simulate(scenario), fp.simulate(scenario, observe=lambda time, signals: None))


def test_what_is_interrupted_is_the_begin_of_the_whole():
    looks = itertools.count()
    scenario = fp.load_scenario("fig6", {"simulation.duration": 2.0})
    with pytest.raises(Interrupted) as said:
        fp.simulate(scenario, stop=lambda: next(looks) == 3)
    found = said.value.result
    assert 0.0 < float(found.time[-1]) < 2.0
    assert_same(fp.simulate(scenario).isel(time=slice(found.sizes["time"])), found)
