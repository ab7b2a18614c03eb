"""Summary and figure of an observation, against the Dataset that they are made of."""

import re

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import InputError
from finger_pin.views.observation_text import summarize_observed
from finger_pin.views.plots import plot_observed


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.load_scenario("wound", {"simulation.duration": 0.05}))


@pytest.fixture(scope="module")
def observed(run):
    """An observation of 50 rows, with times of steps that are known."""
    columns = {f"motor_{name}.servo": run[f"motor_{name}"].values[:, 0] for name in ("position", "current")}
    result = fp.observe("wound", (run.time.values, columns))
    # Of 49 steps behind the first one 7 take two milliseconds, the others half of one: 35 ms.
    result["step_time"][:] = np.where(np.arange(50) % 7 == 1, 2e-3, 0.5e-3)
    return result


def changed(observed, **values):
    """Return a copy with other values of some variables from row 20 to row 29."""
    copy = observed.copy(deep=True)
    for name, value in values.items():
        copy[name][20:30] = value
    return copy


def row(result, title, name):
    block = next(each for each in summarize_observed(result).split("\n\n") if each.startswith(title))
    (line,) = (line for line in block.splitlines() if line.startswith(f"  {name} "))
    return [float(each) for each in line.split()[1:]]


def sentence(result, start):
    text = re.sub(r"\n  (?=\S)", " ", summarize_observed(result).split("\n\n")[-1])
    (line,) = (line for line in text.splitlines() if line.startswith(start))
    return line


def test_the_summary_tells_range_and_half_band_of_every_joint_in_degrees(observed):
    result = changed(observed, joint_position=0.5, joint_position_low=0.25, joint_position_high=0.75)
    angle = np.rad2deg(result.joint_position.sel(joint="pip"))
    width = np.rad2deg(result.joint_position_high - result.joint_position_low).sel(joint="pip")
    expected = [float(angle.min()), 28.65, 0.5 * float(width.mean())]
    np.testing.assert_allclose(row(result, "Joint angles, deg", "pip"), expected, atol=5.1e-3)


@pytest.mark.parametrize(("title", "name"), [("Tension behind all", "tendon"), ("Tension at the canal", "spool")])
def test_the_summary_tells_range_and_half_band_of_every_tension(observed, title, name):
    result = observed.copy(deep=True)
    for end, value in (("", 3.0), ("_low", 2.0), ("_high", 5.0)):
        result[f"{name}_tension{end}"][:] = value
    assert row(result, title, "flexor") == [3.0, 3.0, 1.5]


def test_the_summary_tells_when_a_tip_is_touched_and_how_hard(observed):
    assert sentence(observed, "Touched") == "Touched: no touch was seen"
    result = changed(observed, touched=True, fingertip_force=[0.3, 0.0, -0.4])
    assert sentence(result, "Touched") == "Touched: from 0.021 s to 0.030 s, up to 0.50 N"
    result["touched"][40:] = True
    assert sentence(result, "Touched").endswith("0.50 N; from 0.041 s to the end, up to 0.00 N")


def test_touches_of_several_tips_are_told_and_drawn_by_their_names(observed):
    parts = {name: each for name, each in observed.items() if name == "touched" or name.startswith("fingertip_force")}
    many = {name: each.expand_dims(fingertip=["thumb", "index"], axis=1).copy() for name, each in parts.items()}
    result = observed.drop_vars(list(parts)).assign(many)
    result["touched"].loc[{"time": slice(0.0105, 0.0205), "fingertip": "index"}] = True
    assert sentence(result, "Touched") == "Touched: index from 0.011 s to 0.020 s, up to 0.00 N"
    axes = {each.get_ylabel(): each for each in plot_observed(result).axes}
    assert [len(axes[f"{name} force\n(N)"].patches) for name in ("thumb", "index")] == [0, 1]


def test_the_summary_judges_the_consistency_in_words(observed):
    assert sentence(observed, "Consistency").endswith("(limit 3): the readings do not contradict the model")
    said = sentence(changed(observed, consistency=3.0), "Consistency")
    assert said.startswith("Consistency 3 at most, ")
    assert (
        "does not fit its readings, beyond the limit in 20 % of the time, first at 0.021 s: something touches" in said
    )
    # Of 50 rows 5 are a tenth, 6 more: what was skipped is not in the consistency.
    few, many = (observed.assign_attrs(skipped=[f"motor_position.servo: {count}"]) for count in (5, 6))
    assert sentence(few, "Consistency").endswith("the readings do not contradict the model")
    assert sentence(many, "Consistency").endswith("12 % of motor_position.servo was missing or too far off to fit")
    alone = observed.copy(deep=True)
    alone["consistency"][:] = 1.0
    assert sentence(alone, "Consistency").startswith("Consistency: no reading beside the inputs was used")


def test_the_summary_tells_what_was_dropped_and_how_fast_it_was_also_from_a_file(observed, tmp_path):
    result = observed.copy(deep=True)
    result.attrs |= {"skipped": ["motor_position.servo: 3", "motor_current.servo: 1"], "left_out": ["temperature"]}
    fp.save(result, tmp_path / "observed.nc")
    for each in (result, fp.load(tmp_path / "observed.nc")):
        assert sentence(each, "Skipped") == "Skipped readings: motor_position.servo: 3, motor_current.servo: 1"
        assert sentence(each, "Left out") == "Left out: temperature"
        assert sentence(each, "Failed") == "Failed integrations: none"
        # 49 ms in 35 ms, and 42 of 49 steps.
        said = sentence(each, "Real-time factor")
        assert said == "Real-time factor 1.4 (observed over wall time); 85.71 % of steps took less than 1 ms"
    assert max(map(len, summarize_observed(result).splitlines())) <= 80


def test_the_figure_shows_bands_touches_and_the_limit_of_consistency(observed, run):
    result = changed(observed, touched=True)
    axes = {each.get_ylabel(): each for each in plot_observed(result, run).axes}
    assert list(axes) == ["mcp (°)", "pip (°)", "dip (°)", "flexor (N)", "force (N)", "consistency"]
    line, truth = axes["dip (°)"].get_lines()
    np.testing.assert_allclose(line.get_ydata(), np.rad2deg(result.joint_position.sel(joint="dip")))
    np.testing.assert_allclose(truth.get_ydata(), np.rad2deg(run.joint_position.sel(joint="dip")[1:]))
    (band,) = axes["dip (°)"].collections
    low, high = (np.rad2deg(result[f"joint_position_{end}"].sel(joint="dip")) for end in ("low", "high"))
    np.testing.assert_allclose(band.get_datalim(axes["dip (°)"].transData).intervaly, [low.min(), high.max()])
    (span,) = axes["force (N)"].patches
    np.testing.assert_allclose(
        span.get_extents().transformed(axes["force (N)"].transData.inverted()).intervalx, [0.021, 0.03]
    )
    consistency, limit = axes["consistency"].get_lines()
    np.testing.assert_array_equal(consistency.get_ydata(), result.consistency)
    assert set(limit.get_ydata()) == {3.0}
    assert [len(each.get_lines()) for each in plot_observed(result).axes] == [1, 1, 1, 2, 3, 2]


def test_a_run_is_no_observation(run):
    for function in (plot_observed, summarize_observed):
        with pytest.raises(InputError, match=r"result.consistency: is missing; give the result of fp.observe"):
            function(run)
