"""What of a run is kept: variables that are asked for, and pairs of contacts that came near."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.views.summary import summarize

WALL = "solver_wall_time"


@pytest.fixture(scope="module")
def pinched():
    """A hand that pinches a ball: the scenario and its result."""
    scenario = fp.load_scenario("pinch", {"simulation.duration": 0.1})
    return scenario, fp.simulate(scenario)


def test_variables_that_are_asked_for_are_those_of_the_whole_result_which_is_judged_alike(pinched):
    scenario, whole = pinched
    names = ["tendon_tension", "contact_force"]
    few = fp.simulate(scenario, variables=names)
    assert {*few.data_vars} == {*names} and {*few.coords} == {*whole.coords}
    xr.testing.assert_equal(few, whole[names].assign_coords(whole.coords))
    assert {**few.attrs, WALL: 0.0} == {**whole.attrs, WALL: 0.0}


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["joint_positon"], r'variables = "joint_positon": .* did you mean joint_position'),
        ("joint_position", 'variables = "joint_position": must be a list of names'),
    ],
)
def test_a_variable_that_there_is_not_is_refused_before_the_run(names, said):
    with pytest.raises(fp.InputError, match=said):
        fp.simulate(fp.load_scenario("pinch", {"simulation.duration": 1e3}), variables=names)


@pytest.mark.slow
def test_pairs_that_never_came_near_are_not_written_and_a_run_goes_on_from_the_rest(pinched, tmp_path):
    scenario, whole = pinched
    fp.save(whole, tmp_path / "r.nc")
    kept = fp.load(tmp_path / "r.nc")
    touched = whole.contact[(whole.contact_normal_force > 0.0).any("time")].values
    assert {*touched} <= {*kept.contact.values} and len(touched) > 0
    assert kept.attrs["contacts_left_out"] == whole.sizes["contact"] - kept.sizes["contact"] > 0
    for name in whole.data_vars:
        there = whole[name].sel(contact=kept.contact) if "contact" in whole[name].dims else whole[name]
        xr.testing.assert_equal(kept[name], there)
    fp.save(kept, tmp_path / "again.nc")
    assert fp.load(tmp_path / "again.nc").identical(kept)
    xr.testing.assert_equal(*(fp.simulate(scenario, initial=first) for first in (whole, kept)))
    with pytest.raises(fp.InputError, match="a result with other contacts"):
        fp.simulate(scenario, initial=kept.isel(contact=slice(1)))
    assert summarize(kept) == summarize(whole)


def test_a_pair_that_may_have_touched_between_samples_is_written(tmp_path):
    """A ball at 5 m/s is 5 mm away at samples a millisecond apart, and has bounced between two of them."""
    gaps = {
        "bounces": [0.0125, 0.0075, 0.0025, 0.0025, 0.0075],
        "passes": [0.0125, 0.0121, 0.0119, 0.0121, 0.0125],
        "near": [9e-4, 9e-4, 9e-4, 9e-4, 9e-4],
        "unknown": [0.1, np.nan, 0.1, 0.1, 0.1],
        "bent": [0.1, 0.1, 0.1, 0.1, 0.1],
    }
    bend = np.zeros((5, len(gaps), 2))
    bend[0, -1, 0] = 1e-9
    result = xr.Dataset(
        {
            "contact_gap": (("time", "contact"), np.array([*gaps.values()]).T),
            "contact_bend": (("time", "contact", "tangent"), bend),
        },
        {"contact": [*gaps], "time": np.arange(5) * 1e-3},
    )
    fp.save(result, tmp_path / "r.nc")
    kept = fp.load(tmp_path / "r.nc")
    assert kept.contact.values.tolist() == ["bounces", "near", "unknown", "bent"] and kept.contacts_left_out == 1
