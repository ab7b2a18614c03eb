"""Many runs at once: the same results as one by one, stacked, with failures kept apart."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import IntegrationError, StudyError
from finger_pin.studies import batch

SHORT = {"simulation.duration": 0.05, "simulation.sample_rate": 200.0}


def scenarios(*gains: float) -> list[fp.Scenario]:
    return [fp.load_scenario("reversals", {**SHORT, "controller.gain": gain}) for gain in gains]


def test_runs_at_once_are_bit_by_bit_the_runs_one_by_one() -> None:
    runs = scenarios(0.8, 0.9, 1.0, 1.1)
    seen: list[tuple[int, int]] = []
    stacked = fp.simulate_many(runs, workers=2, progress=lambda done, total: seen.append((done, total)))
    assert stacked.sizes["run"] == 4
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    for index, run in enumerate(runs):
        alone = fp.simulate(run)
        assert set(alone.data_vars) <= set(stacked.data_vars)
        for name in alone.data_vars:
            np.testing.assert_array_equal(stacked[name].values[index], alone[name].values, err_msg=str(name))
        assert stacked.scenario.values[index] == fp.to_toml(run)
    assert set(stacked.failure.values) == {""}


def test_runs_that_a_broken_pool_has_not_done_are_nan_and_say_why() -> None:
    with ProcessPoolExecutor(1) as pool:
        with pytest.raises(BrokenProcessPool):
            pool.submit(os._exit, 1).result()
        with pytest.raises(StudyError, match="BrokenProcessPool"):
            fp.simulate_many(scenarios(1.0), executor=pool)


def test_runs_that_all_fail_are_an_error_that_holds_what_was_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    real = batch.simulate

    def failing(scenario: fp.Scenario, **options: object) -> None:
        raise IntegrationError(0.02, "planted", "nothing", real(scenario).isel(time=slice(0, 5)))

    monkeypatch.setattr(batch, "simulate", failing)
    with pytest.raises(StudyError, match=r"every run failed; the first one: .*planted") as caught:
        fp.simulate_many(scenarios(1.0, 2.0), workers=1)
    assert np.isfinite(caught.value.result.joint_position.values[:, :5]).all()


@pytest.mark.slow
def test_what_only_some_runs_have_is_nan_in_the_others_and_said() -> None:
    names = ("reversals", "servo", "press")
    runs = [fp.load_scenario(name, {"simulation.duration": 5e-3, "simulation.sample_rate": 1e3}) for name in names]
    ball = {"ball": {"shape": "sphere", "radius": 0.01, "mass": 0.01, "position": [0.0, 0.2, 0.0395]}}
    more = runs[2].model_dump(exclude_none=True)
    more["environment"]["objects"] |= ball
    more["controller"] = {"kind": "tensions", "minimum_tension": 2.0}
    runs.append(fp.Scenario.model_validate(more))
    stacked = fp.simulate_many(runs, workers=1)
    for index, run in enumerate(runs):
        alone = fp.simulate(run)
        for name in stacked.data_vars:
            if "time" in stacked[name].dims and name in alone:
                own = (
                    stacked[name]
                    .isel(run=index)
                    .sel({dim: alone[dim] for dim in alone[name].dims if dim in alone.coords})
                )
                np.testing.assert_array_equal(own.values, alone[name].values, err_msg=str(name))
            elif "time" in stacked[name].dims:
                assert np.isnan(stacked[name].values[index]).all()
                assert str(index) in stacked[name].attrs["comment"]
    kept = fp.simulate_many(runs, workers=1, variables=["motor_voltage"]).motor_voltage
    np.testing.assert_array_equal(kept.values, stacked.motor_voltage.values)
    assert stacked.sizes["motor"] == 4 and len(stacked.contact) > len(fp.simulate(runs[2]).contact)
    assert np.isnan(stacked.self_locking_margin.values[3]) and set(stacked.failure.values) == {""}


def test_only_the_chosen_variables_are_kept() -> None:
    stacked = fp.simulate_many(scenarios(1.0, 1.2), workers=1, variables=["tracking_error"])
    assert "tracking_error" in stacked
    assert "joint_position" not in stacked


def test_scenarios_are_taken_by_path(tmp_path: Path) -> None:
    file = tmp_path / "short.toml"
    file.write_text('extends = "reversals"\n[simulation]\nduration = 0.01\n')
    alone = fp.simulate(file)
    assert (fp.simulate_many([file, str(file)], workers=1).joint_position == alone.joint_position).all()


def test_a_failing_run_is_nan_from_where_it_stopped_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = scenarios(1.0, 2.0)
    real = batch.simulate

    def failing(scenario: fp.Scenario, **options: object) -> object:
        result = real(scenario)
        if scenario.controller.gain == 2.0:
            raise IntegrationError(0.02, "planted", "nothing", result.isel(time=slice(0, 5)))
        return result

    monkeypatch.setattr(batch, "simulate", failing)
    stacked = fp.simulate_many(runs, workers=1)
    assert "planted" in str(stacked.failure.values[1])
    assert np.isfinite(stacked.joint_position.values[0]).all()
    assert np.isfinite(stacked.joint_position.values[1, :5]).all()
    assert np.isnan(stacked.joint_position.values[1, 5:]).all()


@pytest.mark.parametrize(
    ("runs", "options", "entry"),
    [
        ([], {}, "scenarios"),
        (scenarios(1.0), {"workers": 0}, "workers"),
        (scenarios(1.0), {"variables": ["joint_positon"], "workers": 1}, "variables"),
        ([*scenarios(1.0), fp.load_scenario("reversals")], {}, "scenarios[1].simulation.duration"),
        (
            [*scenarios(1.0), fp.load_scenario("stick_slip", {**SHORT, "simulation.sample_rate": 100.0})],
            {},
            "scenarios[1].simulation.sample_rate",
        ),
    ],
)
def test_runs_that_cannot_be_stacked_are_named(runs: list[fp.Scenario], options: dict, entry: str) -> None:
    with pytest.raises(fp.InputError) as caught:
        fp.simulate_many(runs, **options)
    assert caught.value.entry == entry
