"""Sweeps: the Dataset, failures with their reasons, executors that break, and going on."""

import importlib
import json
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from types import ModuleType

import numpy as np
import pytest
from planted import DIES_ONCE, GAIN, RAISES, SLOW, STOPS

import finger_pin as fp
from finger_pin.exceptions import StudyError
from finger_pin.studies.metrics import METRICS, Run

RADIUS = "finger.tendons.T3.crossings.medial.radius"
SHORT = {"simulation.duration": 0.02}
TWO = ThreadPoolExecutor(2)


def lines(folder):
    return [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    """A grid with points at which there is no force closure."""
    folder = tmp_path_factory.mktemp("grid")
    seen = []
    over = {"controller.gain": [0.5, 1.0, 2.0], RADIUS: [-0.005, 0.0063]}
    metrics = ["tracking_rms", "tension_peak"]
    result = fp.sweep(
        "reversals", over, metrics=metrics, overrides=SHORT, output=folder, executor=TWO,
        progress=lambda *numbers: seen.append(numbers),
    )  # fmt: skip
    return folder, result, seen


def test_a_grid_has_a_dimension_per_key_and_every_number_is_that_of_its_own_run(grid):
    _, result, _ = grid
    assert result["tracking_rms"].dims == ("controller.gain", RADIUS)
    for gain in (0.5, 1.0, 2.0):
        alone = Run(fp.load_scenario("reversals", {**SHORT, "controller.gain": gain, RADIUS: 0.0063}))
        for name in ("tracking_rms", "tension_peak"):
            found = result[name].sel({"controller.gain": gain, RADIUS: 0.0063})
            assert float(found) == METRICS[name].measure(alone)


def test_points_without_a_scenario_are_nan_with_their_reason(grid):
    folder, result, _ = grid
    failed = result.sel({RADIUS: -0.005})
    assert set(failed["status"].values) == {"failed"}
    assert all("force closure" in reason for reason in failed["reason"].values)
    assert np.isnan(failed["tracking_rms"]).all()
    done = result.sel({RADIUS: 0.0063})
    assert set(done["status"].values) == {"done"}
    assert set(done["reason"].values) == {""}
    assert sorted(line["status"] for line in lines(folder)) == ["done"] * 3 + ["failed"] * 3


def test_variables_and_coordinates_have_units_and_names_and_the_dataset_its_origin(grid):
    _, result, _ = grid
    for name in ("tracking_rms", "tension_peak", "controller.gain", RADIUS):
        assert result[name].attrs["units"] == {"tracking_rms": "rad", "tension_peak": "N", RADIUS: "m"}.get(
            name, "N m/rad"
        )
        assert result[name].attrs["long_name"]
    assert "version_finger_pin" in result.attrs
    assert 'name = "reversals"' in result.attrs["scenario"]


def test_progress_begins_with_what_is_there_and_ends_with_all(grid):
    _, _, seen = grid
    assert seen[0] == (0, 0, 6)
    assert seen[-1] == (6, 3, 6)


def test_the_file_holds_what_was_returned(grid):
    folder, result, _ = grid
    assert fp.load(folder / "sweep.nc").identical(result)


def test_the_same_again_repeats_no_run(grid):
    folder, result, _ = grid
    before = (folder / "runs.jsonl").read_bytes()
    seen = []
    again = fp.sweep(
        "reversals", fp.studies.Grid({"controller.gain": (0.5, 1.0, 2.0), RADIUS: (-0.005, 0.0063)}),
        metrics=["tracking_rms", "tension_peak"], overrides=SHORT, output=folder, executor=TWO,
        progress=lambda *numbers: seen.append(numbers),
    )  # fmt: skip
    assert again.identical(result)
    assert (folder / "runs.jsonl").read_bytes() == before
    assert seen == [(6, 3, 6)]


def test_more_points_in_the_same_folder_cost_only_their_own_runs_whatever_kind_of_number_asks(tmp_path):
    for gains, count in (([1, 2], 2), ([2.0, np.float64(1.0), np.int64(3)], 3)):
        result = fp.sweep(
            "reversals", {"controller.gain": gains}, metrics=[GAIN], overrides=SHORT, output=tmp_path, executor=TWO
        )
        np.testing.assert_array_equal(result["gain"], gains)
        assert len(lines(tmp_path)) == count


def test_samples_have_every_key_as_a_coordinate():
    cube = fp.studies.LatinHypercube(
        {"controller.gain": fp.studies.Range(0.5, 2.0), "environment.fingertip_force[2]": fp.studies.Range(0, 1)}, 3
    )
    result = fp.sweep("reversals", cube, metrics=[GAIN], overrides=SHORT, executor=TWO)
    assert result["gain"].dims == ("sample",)
    np.testing.assert_array_equal(result["gain"], result["controller.gain"])
    assert result["environment.fingertip_force[2]"].dims == ("sample",)


def test_a_run_that_raises_is_reported_in_one_line_and_the_others_go_on():
    result = fp.sweep(
        "reversals", {"controller.gain": [1.0, 2.0, 3.0]}, metrics=[RAISES], overrides=SHORT, executor=TWO
    )
    assert list(result["status"].values) == ["done", "failed", "done"]
    assert result["reason"].values[1] == "ArithmeticError: planted in two lines"
    np.testing.assert_array_equal(result["raises_at_two"], [1.0, np.nan, 3.0])


def test_an_integration_that_fails_is_recorded_with_its_reason():
    result = fp.sweep("reversals", {"controller.gain": [1.0, 2.0]}, metrics=[STOPS], overrides=SHORT, executor=TWO)
    assert list(result["status"].values) == ["done", "failed"]
    assert str(result["reason"].values[1]).startswith("the integration stopped at t = 0.01 s: the step is too small")


def test_a_run_whose_process_was_killed_once_is_done_again_and_the_others_go_on(tmp_path):
    gains = [1.0, 3.0, 2.0, 4.0]
    options = {"metrics": [DIES_ONCE], "overrides": {**SHORT, "title": str(tmp_path)}, "output": tmp_path / "out"}
    with ProcessPoolExecutor(1) as pool:
        result = fp.sweep("reversals", {"controller.gain": gains}, executor=pool, **options)
    assert (tmp_path / "mark").exists()
    np.testing.assert_array_equal(result["dies_once_at_two"], gains)
    assert len(lines(tmp_path / "out")) == 4


def test_a_sweep_whose_runs_all_fail_is_an_error_that_holds_their_reasons(tmp_path):
    with pytest.raises(StudyError, match=r"every run failed; the first one: ArithmeticError: planted") as caught:
        fp.sweep(
            "reversals", {"controller.gain": [2.0]}, metrics=[RAISES], overrides=SHORT, output=tmp_path, executor=TWO
        )
    assert fp.load(tmp_path / "sweep.nc").identical(caught.value.result)


@pytest.mark.slow
def test_names_and_switches_are_swept_like_numbers(tmp_path):
    over = {"simulation.method": ["Rodas4", "Rodas5P"], "controller.gravity_compensation": [True, False]}
    result = fp.sweep("reversals", over, metrics=["tracking_rms"], overrides=SHORT, output=tmp_path, executor=TWO)
    for method in ("Rodas4", "Rodas5P"):
        for switch in (True, False):
            changed = {"simulation.method": method, "controller.gravity_compensation": switch}
            alone = METRICS["tracking_rms"].measure(Run(fp.load_scenario("reversals", SHORT | changed)))
            # A controller written in Python calls libraries that round by their number of threads.
            assert float(result["tracking_rms"].sel(changed)) == pytest.approx(alone, rel=1e-7)
    assert fp.load(tmp_path / "sweep.nc").identical(result)


OWN_METRIC = """
from finger_pin.studies import Metric

FACTOR = {factor}


def measure(run):
    return {sign}FACTOR * run.scenario.controller.gain


OWN = Metric("own", "N m/rad", "one's own", measure)
"""


def test_a_metric_that_was_edited_is_measured_anew_and_one_that_was_not_is_not(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for number, (factor, sign) in enumerate([(2.0, ""), (2.0, ""), (3.0, ""), (3.0, "-")]):
        # A module's own name each time: what other processes have imported stays in them.
        (tmp_path / f"edited{number}.py").write_text(OWN_METRIC.format(factor=factor, sign=sign))
        metric = importlib.import_module(f"edited{number}").OWN
        result = fp.sweep(
            "reversals",
            {"controller.gain": [1.0]},
            metrics=[metric],
            overrides=SHORT,
            output=tmp_path / "o",
            executor=TWO,
        )
        found.append((float(result["own"][0]), len(lines(tmp_path / "o"))))
    assert found == [(2.0, 1), (2.0, 1), (3.0, 2), (-3.0, 3)]


def test_what_depends_on_something_unknown_is_done_anew_and_said(tmp_path):
    numbers = tmp_path / "numbers.txt"
    numbers.touch()
    with numbers.open() as mystery:
        metric = fp.studies.Metric("odd", "1", "odd", lambda run: float(mystery is not None))
        for count in (1, 2):
            with pytest.warns(
                UserWarning, match="the metric odd uses an object of type TextIOWrapper, so its runs are"
            ):
                fp.sweep("reversals", {"controller.gain": [1.0]}, metrics=[metric], output=tmp_path, executor=TWO)
            assert len(lines(tmp_path)) == count


def test_a_law_that_a_scenario_names_counts_by_its_code(tmp_path, monkeypatch):
    name = "laws_of_ones_own:LAW"
    designs = {
        "base": ({"controller.gain": [1.0]}, {"finger.joint_friction.law": name}),
        "varied": ({"finger.joint_friction.law": [name]}, {}),
    }
    for number, count in ((1, 1), (1, 1), (2, 2)):
        module = ModuleType("laws_of_ones_own")
        exec(f"def force(row, p):\n    return {number} * row.speed, 0.0", vars(module))
        module.LAW = fp.Law("own", (), module.force, module.force, module.force)
        monkeypatch.setitem(sys.modules, "laws_of_ones_own", module)
        for folder, (over, more) in designs.items():
            options = {"metrics": [GAIN], "overrides": SHORT | more, "output": tmp_path / folder}
            fp.sweep("reversals", over, executor=TWO, **options)
            assert len(lines(tmp_path / folder)) == count


def test_another_source_of_the_package_does_all_anew(tmp_path, monkeypatch):
    def run():
        fp.sweep("reversals", {"controller.gain": [1.0]}, metrics=[GAIN], output=tmp_path, executor=TWO)

    run()
    monkeypatch.setattr("finger_pin.studies.records.source_digest", lambda: "another")
    run()
    assert len(lines(tmp_path)) == 2


def test_failed_runs_are_repeated_when_asked_for(tmp_path):
    overrides = {**SHORT, "title": str(tmp_path)}

    def run(**options):
        return fp.sweep(
            "reversals", {"controller.gain": [1.0, 2.0]}, metrics=[RAISES], overrides=overrides, output=tmp_path,
            executor=TWO, **options,
        )  # fmt: skip

    run()
    assert len(lines(tmp_path)) == 2
    run()
    assert len(lines(tmp_path)) == 2
    run(retry_failed=True)
    assert [line["point"]["controller.gain"] for line in lines(tmp_path)[2:]] == [2.0]


def test_a_stop_leaves_the_rest_missing_and_the_next_time_does_only_that(tmp_path):
    gains, done = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], []

    def run(stop=None):
        return fp.sweep(
            "reversals", {"controller.gain": gains}, metrics=[SLOW], overrides=SHORT, output=tmp_path, executor=TWO,
            progress=lambda *numbers: done.append(numbers[0]), stop=stop,
        )  # fmt: skip

    first = run(stop=lambda: bool(done) and done[-1] >= 2)
    missing = int((first["status"] == "missing").sum())
    assert 2 <= missing <= 4
    assert np.isnan(first["slow_gain"].values[first["status"].values == "missing"]).all()
    before = (tmp_path / "runs.jsonl").read_bytes()
    second = run()
    np.testing.assert_array_equal(second["slow_gain"], gains)
    assert (tmp_path / "runs.jsonl").read_bytes().startswith(before)
    assert len({line["key"] for line in lines(tmp_path)}) == len(lines(tmp_path)) == 6


@pytest.mark.parametrize(
    ("over", "options"),
    [
        ({"controler.gain": [1.0]}, {}),
        ({"controller.gain": [-1.0]}, {}),
        ({"controller.kind": [1.0]}, {}),
        ({}, {}),
        ({"controller.gain": [1.0]}, {"metrics": ["loses"]}),
        ({"controller.gain": [1.0]}, {"overrides": {"simulation.duration": -1}}),
    ],
)
def test_wrong_input_writes_nothing(tmp_path, over, options):
    with pytest.raises(fp.InputError):
        fp.sweep("reversals", over, output=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_an_entry_that_is_left_out_may_be_swept_and_a_search_says_that_it_has_no_start(tmp_path):
    key, short, path = "finger.tendon_friction.stiffness", {"simulation.duration": 0.01}, tmp_path / "unstated.toml"
    path.write_text('extends = "canal"\n[finger.tendon_friction]\nstiffness = "none"\n')
    study = fp.sweep(path, {key: [1e4, 1e5]}, metrics=["losses"], overrides=short)
    assert np.isfinite(study.losses.values).all()
    with pytest.raises(fp.InputError, match=f"{key}: is left out"):
        fp.optimise(path, [f"{key}=1e4:1e5"], minimise=["losses"], constraints=[], overrides=short)
