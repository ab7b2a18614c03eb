"""What of a run is kept: variables that are asked for, and pairs of contacts that came near."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.simulation.contact_variables import without_far_pairs
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


@pytest.fixture(scope="module")
def all_pairs(pinched):
    """The same run by `fp.prepare`, with all pairs of contacts."""
    scenario, result = pinched
    return fp.prepare(scenario, record=[*result.data_vars]).run().dataset()


def test_pairs_that_never_came_near_are_left_out_and_exert_nothing(pinched, all_pairs):
    result = pinched[1]
    assert result.contacts_left_out == all_pairs.sizes["contact"] - result.sizes["contact"] > 0
    far = all_pairs.drop_sel(contact=result.contact)
    assert float(far.contact_gap.min()) > 1e-3
    for name in ("force", "normal_force", "friction", "level", "slip", "bend"):
        assert not far[f"contact_{name}"].values.any()
    for name in result.data_vars:
        there = all_pairs[name].sel(contact=result.contact) if "contact" in result[name].dims else all_pairs[name]
        xr.testing.assert_equal(result[name], there)


def test_a_result_keeps_no_memory_beside_its_variables(pinched):
    result = pinched[1]
    owners = {}
    for variable in result.variables.values():
        values = variable.values
        while isinstance(values.base, np.ndarray):
            values = values.base
        owners[id(values)] = values.nbytes
    assert sum(owners.values()) <= result.nbytes


@pytest.mark.slow
def test_a_result_is_read_as_it_was_written_and_a_run_goes_on_from_it_as_from_all_pairs(pinched, all_pairs, tmp_path):
    scenario, result = pinched
    fp.save(result, tmp_path / "r.nc")
    kept = fp.load(tmp_path / "r.nc")
    xr.testing.assert_equal(kept, result)
    assert kept.attrs["contacts_left_out"] == result.contacts_left_out
    xr.testing.assert_equal(*(fp.simulate(scenario, initial=first) for first in (all_pairs, kept)))
    with pytest.raises(fp.InputError, match="a result with other contacts"):
        fp.simulate(scenario, initial=kept.isel(contact=slice(1)))
    assert summarize(kept) == summarize(result)


def test_what_is_mostly_zero_takes_next_to_no_room_in_a_file(tmp_path):
    zeros = np.zeros((1000, 100))
    zeros[400:600, 7] = np.random.default_rng(1).normal(size=200)
    fp.save(xr.Dataset({"force": (("time", "contact"), zeros)}, {"time": np.arange(1000.0)}), tmp_path / "r.nc")
    assert (tmp_path / "r.nc").stat().st_size < 0.05 * zeros.nbytes
    np.testing.assert_array_equal(fp.load(tmp_path / "r.nc").force, zeros)


def test_a_pair_that_may_have_touched_between_samples_is_kept():
    """A ball at 5 m/s is 5 mm away at samples a millisecond apart, and has bounced between two of them."""
    gaps = {
        "bounces": [0.0125, 0.0075, 0.0025, 0.0025, 0.0075],
        "passes": [0.0125, 0.0121, 0.0119, 0.0121, 0.0125],
        "falls, then stands": [0.1000, 0.0900, 0.0850, 0.0849, 0.0849],
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
    kept = without_far_pairs(result)
    assert kept.contact.values.tolist() == ["bounces", "near", "unknown", "bent"] and kept.contacts_left_out == 2
