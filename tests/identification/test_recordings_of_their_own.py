"""Recordings with values and unknowns of their own, fitted together for what they share."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import load_bench
from finger_pin.identification.identify import digest
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.recordings import read_recording
from finger_pin.views.report import summarize_identification

FINGER = """
[finger]
name = "swing"
gravity = [0.0, 0.0, -9.81]
joints.pin = { range = [-1.5, 1.5], link = { length = 0.05, width = 0.01, mass = 0.02 }, spring = { stiffness = 0.05 } }
tendons.T1 = { crossings = { pin = { radius = 0.01 } }, curvature_offset = 1.5 }
tendons.T2 = { crossings = { pin = { radius = -0.01 } }, curvature_offset = 1.5 }
tendon_friction = { coulomb = 0.1 }
joint_friction = { coulomb = 0.0, stiction = 0.0, viscous = 1e-3 }
[controller]
gain = 0.3
minimum_tension = 0.5
[simulation]
rtol = 1e-4
atol_scale = 1e-4
initial = { position = { pin = 0.0 } }
"""
SPRING, MASS, GAIN = "finger.joints.pin.spring.stiffness", "finger.joints.pin.link.mass", "controller.gain"
SHARED = {"finger.tendon_friction.coulomb": 0.13, "finger.joint_friction.viscous": 2e-3}
BOUNDS = {"finger.tendon_friction.coulomb": (0.02, 0.5), "finger.joint_friction.viscous": (2e-4, 2e-2)}
# Spring, mass and gain of every recording.
APART = {"a": (0.03, 0.02, 0.2), "b": (0.06, 0.02, 0.3), "c": (0.10, 0.05, 0.4), "d": (0.15, 0.05, 0.6)}
TIME = np.arange(0.0, 0.61, 0.02)
GOAL = 0.5 * np.sin(8.0 * TIME) * np.minimum(1.0, 4.0 * TIME)


@pytest.fixture
def bench(tmp_path):
    path = tmp_path / "swing.toml"
    path.write_text(FINGER)
    return str(path)


def made(bench, name, noise=1e-3):
    """The motion of one recording, simulated with what is true of it."""
    goal = {"kind": "samples", "times": TIME.tolist(), "values": GOAL.tolist()}
    rates = {"simulation.duration": 0.6, "simulation.sample_rate": 50.0, "reference.joints.pin": goal}
    own = dict(zip((SPRING, MASS, GAIN), APART[name], strict=True))
    run = fp.simulate(fp.load_scenario(bench, {**rates, **SHARED, **own}))
    rng = np.random.default_rng(ord(name))
    return {"t": TIME, "goal": GOAL, "q": run.joint_position.values[:, 0] + rng.normal(0.0, noise, TIME.size)}


def recording(**more):
    return {"time": "t", "inputs": {"joint_reference.pin": "goal"}, "outputs": {"joint_position.pin": "q"}, **more}


@pytest.mark.slow
def test_four_springs_and_a_gain_are_found_together_with_the_friction_they_share(bench):
    """Three gains and two masses are known by recording, the fourth gain is not."""
    data = {name: made(bench, name) for name in APART}
    recordings, truth = {}, dict(SHARED)
    for name, (spring, mass, gain) in APART.items():
        own = {SPRING: (0.01, 0.5)} | ({GAIN: (0.1, 2.0)} if name == "d" else {})
        known = {MASS: mass} | ({} if name == "d" else {GAIN: gain})
        recordings[name] = recording(values=known, parameters=own)
        truth |= {f"recordings.{name}.{key}": {SPRING: spring, GAIN: gain}[key] for key in own}
    both = fp.identify(bench, parameters=BOUNDS, recordings=recordings, data=data, starts=1, refits=False)
    assert both.parameter.values.tolist() == [*truth]
    # By their covariance, as logarithms, errors have a square that is below 18.5 in 99 of 100 cases.
    true, width = np.array([*truth.values()]), np.log(both.linear_upper / both.estimate).values / 1.96
    away = np.log(both.estimate.values / true) / width
    assert away @ np.linalg.solve(both.correlation.values, away) < 18.5 and width.max() < 0.1
    assert both.determined.all()
    assert f"recordings.c.{SPRING}" in summarize_identification(both)
    alone = fp.identify(bench, parameters=BOUNDS, recordings={"a": recordings["a"]}, data={"a": data["a"]}, starts=1)
    # What all four tell of their friction is within what one tells, and narrower.
    assert np.all((alone.lower[:2].values <= both.estimate[:2]) & (both.estimate[:2] <= alone.upper[:2].values))
    assert np.all((both.upper - both.lower)[:2] < 0.8 * (alone.upper - alone.lower)[:2].values)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"values": {"controller.gian": 1.0}}, "identify.recordings.a.values.controller.gian"),
        ({"values": {GAIN: -1.0}}, "identify.recordings.a.values.controller.gain = -1.0"),
        ({"values": {"controller": {"gain": 1.0}}}, "identify.recordings.a.values.controller: must be one value"),
        ({"values": {"finger.tendon_friction.coulomb": 0.1}}, "found or held for all recordings as finger.tendon_"),
        ({"parameters": {"finger.joint_friction.viscous": (1e-3, 1e-2)}}, "a.parameters.finger.joint_friction.viscous"),
        ({"parameters": {"controller.gian": (0.1, 1.0)}}, "identify.recordings.a.parameters.controller.gian"),
        ({"parameters": {GAIN: (1.0, 0.1)}}, "a.parameters.controller.gain = [1.0, 0.1]: the least value"),
        ({"parameters": {MASS: (-1.0, 0.1)}}, "identify.recordings.a.parameters.finger.joints.pin.link.mass = -1.0"),
        ({"parameters": {"joint_position.pin.shift": (0.0, 0.1)}}, "identify.recordings.a.parameters.joint_position"),
    ],
)
def test_wrong_entries_of_one_recording_are_refused_in_one_line_that_names_them(bench, change, said):
    data = {name: {"t": TIME, "goal": GOAL, "q": GOAL} for name in "ab"}
    given = {"parameters": BOUNDS, "recordings": {"a": recording(**change), "b": recording()}, "data": data}
    with pytest.raises(fp.InputError) as refused:
        fp.identify(bench, **given)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_entries_of_one_recording_act_on_it_alone_and_count_for_what_is_resumed(bench):
    data = {"t": TIME, "goal": GOAL, "q": GOAL}
    digests, residuals = [], []
    for change in ({}, {"values": {GAIN: 0.5}}, {"parameters": {GAIN: (0.1, 1.0)}}):
        entries = {"parameters": BOUNDS, "recordings": {"a": recording(**change), "b": recording()}}
        scenario, settings = load_bench(bench, None, entries)
        taken = [read_recording(name, each, data) for name, each in settings.recordings.items()]
        digests.append(digest(scenario, settings, taken))
        problem = fitted_residuals(scenario, settings, taken)
        residuals.append(problem.residuals(problem.parameters.start))
    assert len({*digests}) == 3
    for k, same in ((1, False), (2, True)):
        assert np.array_equal(residuals[k][0], residuals[0][0]) == same
        np.testing.assert_array_equal(residuals[k][1], residuals[0][1])
    slopes = problem.slopes(problem.parameters.start)
    # The last parameter is the gain of a.
    assert np.abs(slopes[0][:, 2]).max() > 1e-3 and not slopes[1][:, 2].any()


def test_one_number_in_two_keys_is_found_once_with_its_factor(bench):
    """Of two cords that turn by 1.5 rad one rubs with half the other's coefficient mu: exp(-1.5 mu), exp(-0.75 mu)."""
    rng, load = np.random.default_rng(3), np.repeat([3.0, 6.0, 9.0, 12.0], 6)
    data = {"in": load, **{name: load * np.exp(-mu * 1.5) for name, mu in (("T1", 0.2), ("T2", 0.1))}}
    data |= {name: data[name] + rng.normal(0.0, 0.02, load.size) for name in ("T1", "T2")}
    key = "finger.tendon_friction.coulomb[0] & 0.5 * finger.tendon_friction.coulomb[1]"
    recording = {"kind": "steady", "speed": 0.05, "inputs": {f"tendon_command.{name}": "in" for name in ("T1", "T2")}}
    recording["outputs"] = {f"tendon_tension.{name}": name for name in ("T1", "T2")}
    friction = {"finger.tendon_friction": {"coulomb": [0.3, 0.3], "viscous": 0.0, "stiction_ratio": 1.0}}
    result = fp.identify(
        bench,
        parameters={key: (0.01, 1.0)},
        recordings={"pull": recording},
        data={"pull": data},
        overrides=friction,
        starts=1,
    )
    found = float(result.estimate[0])
    assert result.sizes["parameter"] == 1 and str(result.units[0].values) == "1"
    assert float(result.lower[0]) < 0.2 < float(result.upper[0]) and found == pytest.approx(0.2, abs=2e-3)
    later = fp.predict(result, {"pull": recording}, data={"pull": data})
    expected = np.concatenate([load * np.exp(-share * 1.5 * found) for share in (1.0, 0.5)])
    np.testing.assert_allclose(later.predicted_value, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ((f"{SPRING} & 0.0 * {MASS}",), "must be one key, or several with a factor from the second on"),
        ((f"2.0 * {SPRING}",), "must be one key, or several with a factor from the second on"),
        ((f"{SPRING} & {SPRING}",), "each once"),
        ((f"{SPRING} & {MASS}", MASS), f"is found for a as {SPRING} & {MASS} too"),
        ((f"{SPRING} & finger.joints.pin.link.mess",), "finger.joints.pin.link.mess"),
        ((f"{SPRING} & 1e6 * {MASS}",), "must be at most"),
        (
            ("recordings.a.A.offset & -1 * recordings.a.B.offset",),
            "ties corrections of columns: only keys of the scenario",
        ),
    ],
)
def test_keys_that_do_not_share_a_number_are_refused_in_one_line(bench, keys, said):
    entries = {"parameters": dict.fromkeys(keys, (0.01, 0.5)), "recordings": {"a": recording()}}
    scenario, settings = load_bench(bench, {}, entries)
    data = {"t": TIME, "goal": GOAL, "q": GOAL}
    with pytest.raises(fp.InputError) as refused:
        fitted_residuals(scenario, settings, [read_recording("a", settings.recordings["a"], data)])
    assert said in str(refused.value) and "\n" not in str(refused.value)
