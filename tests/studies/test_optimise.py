"""Searches: goals, variables, the front of problems whose front is known, and going on."""

import csv
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from planted import CHEAP, DEAR, GAIN, RAISES

import finger_pin as fp
from finger_pin.exceptions import StudyError
from finger_pin.studies import radii
from finger_pin.studies.search import (
    Constraint,
    Goals,
    Search,
    nondominated,
    parse_constraint,
    parse_variable,
    point_at,
)

SHORT = {"simulation.duration": 0.02}
TWO = ThreadPoolExecutor(2)
FEW = fp.studies.Effort(population=8, generations=3)
RADII = {"T3": (-0.008, -0.006), "T4": (0.006, 0.008)}
ABDUCTION = "finger.tendons.{}.crossings.abduction.radius"


def test_constraints_are_spelt_with_their_sense():
    assert parse_constraint("losses<=0.5") == Constraint("losses", 0.5, 1)
    assert parse_constraint(" losses >= -2e-1 ") == Constraint("losses", -0.2, -1)
    for text in ("losses", "losses<0.5", "losses=0.5", "losses<=x", "<=1", "losses<=nan", "losses<=1<=2"):
        with pytest.raises(fp.InputError) as caught:
            parse_constraint(text)
        assert str(caught.value).isprintable()


def test_a_constraint_is_broken_by_how_far_a_value_lies_beyond_it():
    assert Constraint("a", 2.0, 1).excess(3.0) == pytest.approx(0.5)
    assert Constraint("a", 2.0, -1).excess(3.0) == pytest.approx(-0.5)
    assert Constraint("a", 0.0, -1).excess(-3.0) == pytest.approx(3.0)


def test_a_metric_to_be_made_large_is_turned_round():
    goals = Goals.from_metrics(["losses"], ["fingertip_force"], ["slack_time<=1"])
    np.testing.assert_array_equal(goals.values({"losses": 2.0, "fingertip_force": 3.0}), [2.0, -3.0])
    assert [metric.name for metric in goals.metrics] == ["losses", "fingertip_force", "slack_time"]


@pytest.mark.parametrize(
    ("small", "large", "bounds"),
    [([], [], []), (["losses"], ["losses"], []), (["loses"], [], []), (["losses"], [], ["lozes<=1"])],
)
def test_goals_that_are_none_are_refused(small, large, bounds):
    with pytest.raises(fp.InputError):
        Goals.from_metrics(small, large, bounds)


def test_keys_that_go_together_are_spelt_with_their_signs():
    variable = parse_variable("a,-b , c=1:3")
    assert variable.at(0.5) == {"a": 2.0, "b": -2.0, "c": 2.0}
    assert point_at([variable, parse_variable("d=1:100:log")], [0.0, 0.5]) == pytest.approx(
        {"a": 1.0, "b": -1.0, "c": 1.0, "d": 10.0}
    )
    for text in ("-a=1:2", "a,=1:2", "a,b", "a b=1:2"):
        with pytest.raises(fp.InputError):
            parse_variable(text)


def test_the_radii_of_a_finger_keep_their_signs_fit_its_links_and_stay_mirror_images(ub):
    found = {variable.keys: variable for variable in radii(ub)}
    assert sum(len(keys) for keys in found) == 10
    mirrored = found[ABDUCTION.format("T1"), ABDUCTION.format("T2")]
    assert mirrored.signs == (1, -1)
    assert (mirrored.range.low, mirrored.range.high) == (0.003, 0.009)
    for variable in found.values():
        for key, sign in zip(variable.keys, variable.signs, strict=True):
            _, _, tendon, _, joint, _ = key.split(".")
            radius = ub.tendons[tendon].crossings[joint].radius
            assert sign * variable.range.low * radius > 0.0
            assert max(abs(variable.range.low), abs(variable.range.high)) == 0.5 * ub.joints[joint].link.width


def test_no_other_design_is_better_than_one_that_is_not_dominated():
    values = np.array([[1.0, 5.0], [2.0, 2.0], [2.0, 2.0], [5.0, 1.0], [3.0, 3.0], [2.0, 6.0], [1.0, 5.5]])
    assert nondominated(values).tolist() == [True, True, True, True, False, False, False]


@pytest.mark.slow
def test_a_search_finds_the_front_of_a_problem_whose_front_is_known():
    # Binh and Korn, 1997: minimise 4 x^2 + 4 y^2 and (x - 5)^2 + (y - 5)^2 for x in [0, 5], y in [0, 3], within two
    # circles. Its front is x = y up to 3, and y = 3 beyond.
    search = Search(2, 2, 40, 1, None)
    kept = []
    for _ in range(40):
        x, y = search.ask().T * np.array([[5.0], [3.0]])
        values = np.stack([4 * x**2 + 4 * y**2, (x - 5) ** 2 + (y - 5) ** 2], axis=1)
        excesses = np.stack([(x - 5) ** 2 + y**2 - 25.0, 7.7 - (x - 8) ** 2 - (y + 3) ** 2], axis=1)
        search.tell(values, excesses)
        kept += [(a, b, *f) for a, b, f, g in zip(x, y, values, excesses, strict=True) if (g <= 0.0).all()]
    found = np.array(kept)
    front = found[nondominated(found[:, 2:])]
    assert len(front) >= 30
    x = np.where(front[:, 2] <= 72.0, np.sqrt(front[:, 2] / 8.0), np.sqrt(np.maximum(front[:, 2] - 36.0, 0.0) / 4.0))
    best = (x - 5.0) ** 2 + (np.minimum(x, 3.0) - 5.0) ** 2
    assert (front[:, 3] >= best - 1e-9).all()
    # The second objective goes from 50 to 4.
    assert (front[:, 3] - best).max() < 1.0
    assert front[:, 3].max() > 47.0
    assert front[:, 3].min() < 4.5


def test_a_search_that_is_told_the_same_takes_the_same_course():
    courses = []
    for seed in (1, 1, 2):
        search = Search(3, 2, 8, seed, None)
        asked = []
        for _ in range(4):
            designs = search.ask()
            asked.append(designs)
            search.tell(designs[:, :2] ** 2, designs[:, 2:] - 0.5)
        courses.append(np.concatenate(asked))
    np.testing.assert_array_equal(courses[0], courses[1])
    assert (courses[0] != courses[2]).any()


def search_gain(folder=None, **options):
    """Search where the front is known: cheap is the gain, dear is its inverse, so every gain is on the front."""
    settings = {"minimise": [CHEAP, DEAR], "constraints": [], "effort": FEW, "overrides": SHORT, "executor": TWO}
    return fp.optimise("reversals", ["controller.gain=0.5:2"], output=folder, **(settings | options))


def test_the_front_is_of_designs_that_keep_the_bounds_and_is_numbered_by_the_first_objective(tmp_path):
    result = search_gain(tmp_path, constraints=["cheap<=1.5"])
    gain = result["controller.gain"].values
    np.testing.assert_array_equal(result["feasible"], gain <= 1.5)
    np.testing.assert_array_equal(np.unique(gain[gain <= 1.5]), np.sort(gain[result["front"].values > 0]))
    numbered = [gain[result["front"].values == number].item() for number in range(1, 1 + int(result["front"].max()))]
    assert numbered == sorted(numbered)
    assert gain[0] == 1.0
    assert result.sizes["sample"] == 25
    assert fp.load(tmp_path / "optimise.nc").equals(result)


def test_every_design_of_the_front_is_a_scenario_that_gives_its_numbers(tmp_path):
    result = search_gain(tmp_path)
    with (tmp_path / "front.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == int(result["front"].max()) == len(list((tmp_path / "front").glob("*.toml")))
    for row in rows:
        scenario = fp.load_scenario(tmp_path / "front" / f"{row['design']}.toml")
        assert scenario.controller.gain == float(row["controller.gain (N m/rad)"])
        assert float(row["dear (N m/rad)"]) == 1.0 / scenario.controller.gain
        assert scenario.name == f"reversals_front_{row['design']}"


def test_designs_that_cannot_be_run_do_not_count_and_are_recorded_with_their_reason():
    radius = "finger.tendons.T3.crossings.medial.radius"
    result = fp.optimise(
        "reversals", [f"{radius}=-0.005:0.008"], minimise=["self_locking_margin"], constraints=[], effort=FEW,
        overrides=SHORT, executor=TWO,
    )  # fmt: skip
    negative = result[radius].values < 0.0
    assert negative.any()
    assert not result["feasible"].values[negative].any()
    assert all("force closure" in reason for reason in result["reason"].values[negative])
    assert result["feasible"].values[~negative].all()


def test_radii_that_have_force_closure_only_together_are_searched():
    # With its sign turned, either leaves the other tendons slack; with both turned, T3 pulls against T4 again.
    over = {f"finger.tendons.{name}.crossings.medial.radius": ends for name, ends in RADII.items()}
    for key, (low, high) in over.items():
        for radius in (low, 0.5 * (low + high), high):
            with pytest.raises(fp.InputError, match="force closure"):
                fp.load_scenario("reversals", {key: radius})
    result = fp.optimise(
        "reversals", [f"{key}={low}:{high}" for key, (low, high) in over.items()], minimise=["self_locking_margin"],
        constraints=[], effort=FEW, overrides=SHORT, executor=TWO,
    )  # fmt: skip
    assert result["feasible"].all()


def test_a_search_whose_designs_all_fail_is_an_error_that_holds_their_reasons():
    with pytest.raises(StudyError, match="every run failed; the first one: TypeError") as caught:
        search_gain(minimise=[fp.studies.Metric("none", "1", "none", lambda run: None)])
    assert not caught.value.result["feasible"].any()


def test_what_is_best_is_found_though_some_designs_raise():
    result = search_gain(minimise=[], maximise=[GAIN, RAISES], effort=fp.studies.Effort(population=8, generations=8))
    assert result["controller.gain"].values[result["front"].values == 1] > 1.9


def test_a_search_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path):
    whole = search_gain()
    done = []

    def stopped():
        return bool(done) and done[-1] >= 11

    part = search_gain(tmp_path, progress=lambda *n: done.append(n[0]), stop=stopped)
    assert 9 < part.sizes["sample"] < 25
    before = (tmp_path / "runs.jsonl").read_text().splitlines()
    again = search_gain(tmp_path)
    assert again.identical(whole)
    after = (tmp_path / "runs.jsonl").read_text().splitlines()
    assert after[: len(before)] == before
    keys = [json.loads(line)["key"] for line in after]
    assert len(set(keys)) == len(keys)


def test_progress_counts_the_designs_of_all_generations():
    seen = []
    search_gain(progress=lambda *numbers: seen.append(numbers))
    assert seen[0] == (0, 0, 25)
    assert seen[-1] == (25, 0, 25)
    assert [numbers[0] for numbers in seen] == sorted(numbers[0] for numbers in seen)


@pytest.mark.parametrize(
    ("over", "options"),
    [
        ([], {}),
        (["controler.gain=1:2"], {}),
        (["controller.gain=2:1"], {}),
        (["controller.gain=1:2", "controller.gain=1:3"], {}),
        (["controller.gain=-2:-1"], {}),
        (["controller.gain=1:2"], {"minimise": ["loses"]}),
        (["controller.gain=1:2"], {"constraints": ["losses"]}),
    ],
)
def test_wrong_input_writes_nothing(tmp_path, over, options):
    with pytest.raises(fp.InputError):
        fp.optimise("reversals", over, output=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("numbers", [{"population": 3}, {"generations": 0}, {"seed": -1}])
def test_an_effort_that_is_none_is_refused(numbers):
    with pytest.raises(fp.InputError):
        fp.studies.Effort(**numbers)
