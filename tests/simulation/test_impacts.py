"""The error that runs with impacts estimate of themselves; hundreds of them by `scripts/impacts.py`."""

import numpy as np
import pytest
from impacts import judge
from validation.impact_scenarios import at_tolerance, impact_scenario

import finger_pin as fp
from finger_pin.views.summary import summarize


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), [("drops", 11), ("pinch", 9)])
def test_the_estimate_carries_what_an_impact_multiplies(family, seed):
    """Nearly all of their error comes from kinks: contacts that close and open, stick and slip."""
    found = judge(family, seed)
    assert 1.0 / 3.0 < found.ratio < 100.0


def test_a_motion_in_which_impacts_multiply_errors_beyond_bounds_says_that_it_cannot_be_judged():
    # It drops on a floor, spinning, and rattles to rest.
    scenario = at_tolerance(impact_scenario("drops", 30), 1e-3)
    result = fp.simulate(scenario)
    assert "error of the run was not judged: small errors grow" in result.attrs["accuracy"]
    assert "estimated_error" not in result.attrs
    assert "was not judged" in summarize(result).replace("\n", " ")
    assert np.isfinite(result.object_position).all()
