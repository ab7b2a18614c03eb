"""Identification from the motion of a finger under control: frictions of tendons and joints, slopes and intervals."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import ParametrisedScenario, load_bench
from finger_pin.identification.parameters.scenarios import Limits, ScenarioPart
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.recordings import read_recording

COULOMB = "finger.tendon_friction.coulomb"
JOINT_COULOMB, JOINT_STICTION = "finger.joint_friction.coulomb", "finger.joint_friction.stiction"
TOLERANCES = "simulation.rtol", "simulation.atol_scale"
# What is seen of reversals, by variable, label and column, and its noise.
SEEN = [("joint_position", "proximal", 1), ("joint_position", "medial", 2), ("tendon_tension", "T3", 2)]
NOISE = {"joint_position": 1e-3, "tendon_tension": 0.02}


def under_control(duration):
    """A recording of reversals, and the entries of what is to be found in it; two numbers are wrong at the start."""
    keys = {COULOMB: (0.02, 0.5), "finger.joint_friction.viscous": (1e-4, 1e-2)}
    seen = {"simulation.duration": duration, "simulation.sample_rate": 200.0}
    made = fp.prepare(fp.load_scenario("reversals", seen), list(keys), tuple(NOISE)).run()
    rng = np.random.default_rng(6)
    data = {f"{v}.{label}": made[v][:, k] + rng.normal(0.0, NOISE[v], len(made.time)) for v, label, k in SEEN}
    recordings = {"motion": {"time": "t", "settle": 0.1, "outputs": {name: name for name in data}}}
    return {"parameters": keys, "recordings": recordings}, {"motion": {"t": made.time, **data}}


@pytest.mark.slow
def test_slopes_that_searches_ask_for_know_what_bends_and_bends_back():
    """Twice another tension takes the lead in (22), for less than a hundredth of a second."""
    entries, data = under_control(0.7)
    posed, tight = {"simulation.initial.position.medial": 0.2}, dict.fromkeys(TOLERANCES, 1e-11)
    found, exact = (
        fitted_residuals(scenario, settings, [read_recording("motion", settings.recordings["motion"], data["motion"])])
        for scenario, settings in (load_bench("reversals", posed | more, entries) for more in ({}, tight))
    )
    slopes = found.slopes(found.parameters.start)
    for k in range(2):
        change = 1e-5 * (np.arange(2) == k)
        ends = [exact.residuals(exact.parameters.start + way * change) for way in (1.0, -1.0)]
        for own, later, sooner in zip(slopes, *ends, strict=True):
            expected = (later - sooner) / 2e-5
            assert np.sqrt(np.mean((own[:, k] - expected) ** 2)) < 0.02 * np.sqrt(np.mean(expected**2))


@pytest.mark.slow
def test_what_a_finger_under_control_tells_to_a_hundredth_has_nearly_the_intervals_of_its_slopes():
    entries, data = under_control(1.0)
    changed = {COULOMB: 0.16, "finger.joint_friction.viscous": 1.5e-3}
    result = fp.identify("reversals", **entries, data=data, overrides=changed, starts=1, refits=False)
    truth, width = np.array([0.11, 1e-3]), (result.upper - result.lower).values
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and np.all(width < 0.02 * truth)
    np.testing.assert_allclose(result.noise.values, [NOISE[v] for v, _, _ in SEEN], rtol=0.2)
    for end, line in ((result.lower, result.linear_lower), (result.upper, result.linear_upper)):
        assert np.all(np.abs(end - line).values < 0.1 * width)


@pytest.mark.slow
def test_profiles_follow_a_likelihood_that_errors_of_runs_do_not_make_jump():
    """Every run has steps of its own; over a part of an interval so small the likelihood is a straight line."""
    entries, data = under_control(4.0)
    scenario, settings = load_bench("reversals", None, entries)
    taken = [read_recording(name, each, data[name]) for name, each in settings.recordings.items()]
    problem, jumps = fitted_residuals(scenario, settings, taken), []
    for each in (problem, problem.with_accuracy("fine")):
        along = [problem.parameters.start + 1e-6 * k for k in range(9)]
        met = [problem.likelihood.minus_twice_log(each.residuals(z)) for z in along]
        jumps.append(np.max(np.abs(np.diff(met, 2))))
    # What is a four-hundredth of the 3.84 that ends an interval is rounding, and may be as large either way.
    assert jumps[1] < max(0.5 * jumps[0], 0.01)


@pytest.mark.slow
def test_coulomb_and_stiction_of_joints_are_found_together_though_their_bounds_overlap():
    base = fp.load_scenario("reversals", {"simulation.duration": 1.0, "simulation.sample_rate": 100.0})
    truth = {JOINT_COULOMB: 4e-4, JOINT_STICTION: 7e-4}
    run, rng = fp.simulate(fp.load_scenario(base, truth)), np.random.default_rng(3)
    data, joints = {"t": run.time.values}, ("proximal", "medial")
    for joint in joints:
        data[joint] = run.joint_position.sel(joint=joint).values + rng.normal(0.0, 1e-5, run.time.size)
    swing = {"time": "t", "outputs": {f"joint_position.{joint}": joint for joint in joints}}
    # No stiction within its bounds goes with the greatest Coulomb coefficient.
    bounds = {JOINT_COULOMB: (1e-4, 1.5e-3), JOINT_STICTION: (1e-4, 1.2e-3)}
    found = fp.identify(
        base, parameters=bounds, recordings={"swing": swing}, data={"swing": data}, starts=2, refits=False
    )
    true = list(truth.values())
    assert found.estimate.values == pytest.approx(true, rel=5e-3)
    assert np.all((found.lower.values <= true) & (true <= found.upper.values)) and found.determined.all()
    for wrong, said in [
        ({JOINT_COULOMB: (1e-3, 2e-3), JOINT_STICTION: (1e-4, 5e-4)}, "must be at least the Coulomb coefficient"),
        ({**bounds, JOINT_COULOMB: (-1e-4, 1e-3)}, r"joint_friction.coulomb = -0.0001: must be"),
    ]:
        with pytest.raises(fp.InputError, match=said):
            fp.identify(base, parameters=wrong, recordings={"swing": swing}, data={"swing": data})


def test_values_that_do_not_go_together_are_brought_to_where_they_do_and_those_that_are_held_stay():
    family = ParametrisedScenario(fp.load_scenario("reversals"), (JOINT_COULOMB, JOINT_STICTION))
    part = ScenarioPart(family, np.arange(2), np.ones(2))
    limits = Limits([part], family.keys, np.array([1e-4, 1e-4]), np.array([1e-3, 2e-3]))
    for given, free, nearest in [
        ((3e-4, 5e-4), (True, True), (3e-4, 5e-4)),
        ((9e-4, 5e-4), (True, False), (5e-4, 5e-4)),
        ((9e-4, 5e-4), (False, True), (9e-4, 9e-4)),
    ]:
        np.testing.assert_allclose(limits.nearest_allowed(np.array(given), np.array(free)), nearest, atol=1e-11)
