"""The benchmark's arithmetic, its bookkeeping and its jobs; not its times."""

import importlib
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp

pytestmark = pytest.mark.slow

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def load():
    """Return a function that imports a module from scripts/."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPTS))
        yield importlib.import_module


@pytest.fixture(scope="module")
def brief():
    return fp.load_scenario("reversals", {"simulation.duration": 0.02})


def test_costs_lie_on_straight_lines_in_log_log_and_are_bounds_beyond_the_ends(load):
    cost_at = load("benchmarks.timing").cost_at
    points = [(1e-2, 0.1), (1e-4, 1.0), (1e-6, 10.0), (float("nan"), 0.001), (0.0, 0.001)]
    assert cost_at(points, 1e-3) == (pytest.approx(10**-0.5), "=")
    assert cost_at(points, 1e-4) == (pytest.approx(1.0), "=")
    assert cost_at(points, 1e-7) == (10.0, ">=")
    assert cost_at(points, 1.0) == (0.1, "<=")
    assert cost_at([(float("nan"), 1.0)], 1e-3) is None


def test_a_run_that_is_both_slower_and_less_accurate_than_another_does_not_count(load):
    cost_at = load("benchmarks.timing").cost_at
    points = [(1e-2, 0.1), (1e-4, 1.0)]
    assert cost_at([*points, (1e-3, 5.0)], 1e-3) == cost_at(points, 1e-3)


@pytest.mark.parametrize(
    "value, relation, sense, passed",
    [
        (6.0, "=", ">=", True),
        (4.0, "=", ">=", False),
        (6.0, ">=", ">=", True),
        (4.0, ">=", ">=", None),
        (6.0, "<=", ">=", None),
        (4.0, "<=", ">=", False),
        (4.0, "=", "<=", True),
        (6.0, ">=", "<=", False),
        (6.0, "?", ">=", None),
        (4.0, "?", ">=", None),
    ],
)
def test_a_bound_passes_or_fails_a_target_only_where_it_decides_it(load, value, relation, sense, passed):
    assert load("benchmarks.targets").target("speed", value, sense, 5.0, "x", relation).passed is passed


def test_a_part_is_measured_once_until_the_code_changes(load, tmp_path, monkeypatch):
    store = load("benchmarks.store")
    measured = []

    def measure():
        measured.append(len(measured))
        return {"value": (len(measured), None)}

    first = store.Store(tmp_path, quick=False).part("part", measure)
    assert first == store.Store(tmp_path, quick=False).part("part", measure) == {"value": [1, None]}
    assert store.Store(tmp_path, quick=True).part("part", measure) == {"value": [2, None]}
    assert store.Store(tmp_path, quick=False, fresh=True).part("part", measure) == {"value": [3, None]}
    monkeypatch.setattr(store, "digest", lambda: "other")
    assert store.Store(tmp_path, quick=False).part("part", measure) == {"value": [4, None]}


def test_measurements_made_while_the_code_changed_are_not_kept(load, tmp_path, monkeypatch):
    store = load("benchmarks.store")
    opened = store.Store(tmp_path, quick=False)
    monkeypatch.setattr(store, "digest", lambda: "other")
    assert opened.part("part", lambda: 1) == 1
    assert not list(tmp_path.rglob("*.json"))


def test_a_stage_that_does_not_exist_is_named(load, capsys):
    assert load("benchmark").main(["--only", "joints,mujocco"]) == 2
    assert "mujocco: no such stage" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["Rodas5P", "Rodas4"])
def test_the_compiled_job_is_what_simulate_integrates(load, brief, method):
    runs = load("benchmarks.runs")
    found, statistics = runs.compiled(brief, method, 1e-6)()
    result = fp.simulate(runs.settled(brief, method=method, rtol=1e-6, atol_scale=1e-6))
    np.testing.assert_array_equal(found, result["joint_position"].values)
    assert statistics.steps == result.attrs["solver_steps"]


def test_the_textbook_job_comes_to_the_same_motion(load, brief):
    runs = load("benchmarks.runs")
    exact, agreement = runs.truth(brief)
    assert agreement["worst"] < 1e-9
    assert runs.point("BDF", 1e-6, runs.textbook(brief, "BDF", 1e-6), exact).error < 1e-6


def test_a_run_that_fails_has_no_error_and_costs_nothing(load):
    runs = load("benchmarks.runs")

    def job():
        raise runs.Failed("too stiff")

    assert runs.point("BDF", 1e-3, job, np.zeros((1, 4))).error is None


@pytest.mark.parametrize("joints", [1, 2, 8])
def test_generated_chains_have_one_tendon_more_than_joints_and_follow_their_reference(load, joints):
    scenario = load("benchmarks.chains").chain(joints, 0.05)
    assert len(scenario.finger.tendons) == joints + 1
    closure = fp.Finger(scenario.finger).routing.force_closure()
    np.testing.assert_allclose(closure.tension, 1.0, rtol=1e-9)
    result = fp.simulate(scenario)
    assert abs(result["tracking_error"]).max() < 0.3


@pytest.mark.parametrize("links", [1, 4])
def test_hanging_chains_without_friction_move_as_in_mujoco(load, links):
    pytest.importorskip("mujoco")
    growth, settled = load("benchmarks.growth"), load("benchmarks.runs").settled
    spent = []
    scenario = settled(growth.chain(links, 0.1, "none", amplitude=0.0), rtol=1e-9, atol_scale=1e-10)
    path = load("benchmarks.equal_error").simulated(scenario, spent)()
    assert abs(path).max() > 4e-3 and spent[0][1] > 0
    np.testing.assert_allclose(path, growth.stepped(links, 0.1, 1e-4, "RK4")(), rtol=0.0, atol=1e-8)


def test_mujoco_s_step_at_our_error_is_the_longest_halved_one_that_errs_no_more(load):
    pytest.importorskip("mujoco")
    equal = load("benchmarks.equal_error")
    scenario = load("benchmarks.growth").chain(1, 0.3, "none", amplitude=0.0)
    exact = equal.simulated(load("benchmarks.runs").settled(scenario, rtol=1e-9, atol_scale=1e-9), [])()
    aim = equal.worst(equal.simulated(scenario, [])() - exact)
    for share, step, relation in ((0.9, 2e-3 / 4, "="), (0.1, 2e-3, "<="), (1e6, 2e-3 / 2**8, ">=")):
        # That share of our error at 0.5 ms, and in proportion to the step.
        slope = share * aim / 5e-4
        (row,) = equal.equal_error(scenario, lambda dt, _name, by=slope: lambda: exact + by * dt, ("none",))
        assert (row["step"], row["relation"]) == (step, relation)


def test_mujoco_s_own_loop_repeats_the_python_loop(load, brief):
    pytest.importorskip("mujoco")
    compared = load("benchmarks.mujoco_loop")
    start = fp.simulate(brief)["joint_position"].values[0]
    for step, samples in ((2.5e-4, 21), (1e-3, 21), (2e-3, 11)):
        model = compared._model(brief, True, "implicitfast", start, step)
        loop = compared.Loop(brief, model, step)
        path = loop.run()
        assert path.shape == (samples, 4)
        np.testing.assert_array_equal(loop.rollout(), path)


@pytest.fixture
def stages():
    """Results of all stages, made up."""
    points = [
        {"method": method, "rtol": rtol, "error": rtol, "worst": rtol, "integration": cost * rtol**-0.2}
        | {"whole": None if method == "BDF" else 2.0 * cost * rtol**-0.2, "steps": 10, "evaluations": 80}
        for method, cost in (("Rodas5P", 0.001), ("BDF", 0.1))
        for rtol in (1e-3, 1e-6)
    ]
    costs = {"Rodas5P": {"integration": [0.01, "="], "whole": [0.02, "="]}, "BDF": {"integration": [1.0, "="]}}
    study = {"duration": 8.0, "target": 1e-5, "agreement": {"rms": 1e-10}, "points": points, "at_target": costs}
    row = {"measure": "worst", "integrator": "Euler", "massless": False, "step": 1e-5, "error": 1e-4}
    row |= {"rollout_error": 1e-4, "ours": 0.01, "loop": 0.5, "rollout": 0.1, "loop_over_ours": 50.0}
    compared = {"version": "3", "scenario": "reversals", "duration": 8.0, "limit": 1e-3}
    compared |= {"ours": {"worst": {"method": "Rodas4", "rtol": 0.1}}, "rows": [row | {"rollout_over_ours": 10.0}]}
    joint = {"states": 5, "wall_time": 0.1, "real_time_factor": 20.0, "steps": 9, "time_per_step": 1e-5}
    spent = ("integration", "run", "simulate", *(f"short {each}" for each in ("steps", "run", "changed", "simulate")))
    runs = {"reversals": dict.fromkeys((*spent, "load"), 1e-3)}
    chain = {"links": 64, "friction": "none", "motion": 0.25, "whole": 0.2, "steps": 124, "step": 6e-4, "mujoco": 6e-5}
    chain |= {"dataset": 2e6, "file": 1e6}
    equal = {"RK4": {"step": 1e-3, "time": 0.015, "relation": ">=", "over_whole": 0.75, "over_steps": 5.0}}
    precision = {"links": 8, "motion": 1.0, "aim": "rtol 0.0001", "equal": equal}
    precision |= {"points": [["rtol 0.0001", 1e-7, 0.02, 3e-3]]}
    reached = {"name": "64 links", "friction": "none", "motion": 0.25, "error": 1e-6, "whole": 0.05, "inside": 0.02}
    reached |= {"integrator": "RK4", "apart": 1e-9, "time": 0.1, "relation": ">=", "step": 1e-5, "finest": 2e-6}
    simulator = {"times": {"varied slowly": 7e-5}, "errors": {"varied slowly": 9e-4}}
    prepared = {"runs": runs, "simulator": simulator}
    job = {"options": [], "first": 31.0, "first_processor_time": 30.0, "first_memory": 2**20}
    return {
        "work-precision": {"reversals": study, "stick_slip": study},
        "step-interface": {"duration": 8.0, "period": 1e-3, "whole": 0.5, "stepping": 0.2, "real_time_factor": 16.0}
        | {"real_time_factor_stepping": 40.0, "error": 1e-5, "worst": 1e-4},
        "joints": {"duration": 2.0, "rtol": 1e-5, "exponent": 1.5}
        | {"rows": [{"joints": n, "time_per_textbook_evaluation": 2e-4, **joint} for n in (1, 2, 3)]},
        "growth": {"rows": [chain], "precision": precision, "equal": [reached], "control": {"none": 0.003}},
        "hand": {"duration": 4.0, "joints": 20, "tendons": 25, "fingers": 5}
        | {
            "cores": {
                n: {kind: {"hand": 1.0 / int(n), "fingers": 0.9} for kind in ("integration", "whole")} for n in "12"
            }
        },
        "contact": {
            "scenarios": {"press": study},
            "mujoco": [compared],
            "crowded": {"pour": {"duration": 1.5, "contacts": 496, "integration": 1.0, "whole": 3.0}},
        },
        "mujoco": compared,
        "mujoco-friction": {
            "version": "4.0.0",
            "hands": {
                "Shadow hand": {
                    "time": {"plain": 2e-5, "tendons": 2.5e-5},
                    "counts": {"plain": {"frictions": 0, "rows": 24}, "tendons": {"frictions": 44, "rows": 32}},
                }
            },
        },
        "mujoco-warp-friction": {
            "version": "4.0.0",
            "device": "cpu",
            "times": {"256": {"plain": 0.02, "all tendons": 0.024}},
            "frictions": {"plain": 0, "all tendons": 44},
        },
        "learning": {
            "worlds": 8,
            "kinds": {"smooth": {"times": {"one": 1.1e-4, "alone": 1e-4, "many": 5e-5}, "errors": {"one": 1e-4}}},
            "reset": {"Reach": 2e-3},
        },
        "prepared": prepared,
        "identification": {
            "slopes": {"run": 0.01, "1": 0.02, "3": 0.018, "6": 0.04},
            "fit": {"duration": 8.0, "wall": 12.0, "processor": 20.0, "searches": 3, "searches_alike": 2},
        },
        "many-runs": {"duration": 8.0, "cores": 2, "times": {"9 runs, 1 processes": 3.0}, "speed_up": 1.9}
        | {"speed_up_without_start": None},
        "main-job": job | {"later": 3.0, "later_processor_time": 3.0, "later_memory": 2**21},
    }


def test_the_report_judges_every_target_and_the_figures_are_written(load, stages, tmp_path, monkeypatch, capsys):
    script = load("benchmark")

    class Stage:
        def __init__(self, name):
            self.measure = lambda store: stages[name]

    monkeypatch.setattr(script, "stage", Stage)
    assert script.main(["--output", str(tmp_path)]) == 0
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"benchmark.json", "benchmark.txt", "work_precision.png", "joints.png"}
    verdicts = {
        each["name"]: each["passed"] for each in json.loads((tmp_path / "benchmark.json").read_text())["targets"]
    }
    assert verdicts["reversals at 1e-05 rad, integration: real-time factor"] is True
    assert verdicts["reversals at 1e-05 rad, integration: over the textbook"] is True
    assert verdicts["stick_slip at 1e-05 rad, whole simulate(): over the textbook"] is False
    assert verdicts["step interface at 1 kHz, steps"] is True
    assert verdicts["step interface at 1 kHz, with controller"] is False
    assert verdicts["MuJoCo, lumped mass, worst error 0.001 rad: Python loop"] is True
    assert verdicts["pour, whole simulate()"] is False
    assert verdicts["hand over one finger, integration"] is False
    assert verdicts["hand, two threads, integration"] is True
    assert verdicts["prepared run of 10 ms with another number, beside its steps, at most"] is True
    assert verdicts["a simulator's step of 20 ms, tensions varied slowly"] is False
    assert verdicts["its error, at most"] is True
    assert verdicts["six numbers of reversals identified from three starts"] is True
    assert verdicts["slopes by 3 numbers, in runs"] is True and verdicts["slopes by 6 numbers, in runs"] is False
    assert verdicts["main job, first run"] is False
    output = capsys.readouterr().out
    assert "pass" in output and "FAIL" in output and "Rodas5P" in output
    assert "600.0 us  60.0 us   10.0" in output and "step <= 1e+03 us" in output
    assert ">= 0.75 of simulate(), 5 of its steps" in output
    assert "all tendons         24.00 ms  +20 %, 44 frictions" in output
    assert "2 of 3 searches end at the best" in output and "2 for 1, 1.8 for 3, 4 for 6 numbers" in output


def test_worlds_of_mujoco_warp_are_stepped_with_and_without_friction(load):
    for name in ("mujoco_warp", "gymnasium_robotics"):
        pytest.importorskip(name)
    found = load("benchmarks.mujoco_warp_friction").study((2,), 1, 1)
    assert found["frictions"] == {"plain": 0, "driven tendons": 32, "all tendons": 44, "and all joints": 68}
    assert found["times"]["2"].keys() == found["frictions"].keys() and min(found["times"]["2"].values()) > 0.0


def test_a_stage_whose_needs_are_missing_is_left_out(load, tmp_path, monkeypatch, capsys):
    script = load("benchmark")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert script.main(["--only", "mujoco", "--output", str(tmp_path)]) == 0
    assert "mujoco: left out" in capsys.readouterr().err
