"""Motions that were wrong in silence: starts beside the recording, failing steps, inputs that nothing reads, noise."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from intervals import COULOMB, DRAG, MOTION, TURN, motion

import finger_pin as fp
from finger_pin.description.loading import load_bench
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.validation import validate
from finger_pin.exceptions import ScenarioWarning
from finger_pin.identification.residuals import motions
from finger_pin.identification.residuals.models import fitted_residuals, recording_models
from finger_pin.identification.residuals.recordings import read_recording

BENT = {"finger.tendons.T1.curvature_offset": TURN, DRAG: 0.4}


def problem(data, **more):
    entries = {"parameters": {COULOMB: (0.05, 0.5)}, "recordings": {"pull": {**MOTION, "settle": 0.2, **more}}}
    scenario, settings = load_bench("canal", BENT, entries)
    return fitted_residuals(scenario, settings, [read_recording("pull", settings.recordings["pull"], data)])


@pytest.mark.slow
@pytest.mark.parametrize("failing", ["all", "the changed one"])
def test_slopes_where_the_steps_of_a_run_do_not_bear_other_numbers_are_those_of_runs(monkeypatch, failing):
    data = motion(np.random.default_rng(2), 0.15, 0.4, 0.0)
    asked = problem(data)
    expected = np.concatenate(asked.slopes(asked.parameters.start))
    repeat_steps = motions.repeat_steps

    def failed(trajectory, others):
        """Return runs of which some have ended early, and tell nothing."""
        runs = repeat_steps(trajectory, others)
        ended = [replace(each, failure="singular", interpolate=_nothing(each)) for each in runs]
        return ended if failing == "all" else [runs[0], *ended[1:]]

    monkeypatch.setattr(motions, "repeat_steps", failed)
    slopes = np.concatenate(problem(data).slopes(asked.parameters.start))
    assert np.sqrt(np.mean((slopes - expected) ** 2)) < 0.03 * np.sqrt(np.mean(expected**2))


def _nothing(trajectory):
    return lambda times: np.full_like(trajectory.interpolate(times), 1e53)


@pytest.mark.parametrize("late", [0.0, 0.1])
def test_a_recorded_start_is_that_of_a_joint_whose_column_has_a_wrong_zero(late):
    """The drum turns at 0.2 rad/s; its camera tells 0.3 rad too much, late: to its column -0.3 rad is to be added."""
    data = motion(np.random.default_rng(2), 0.15, 0.4, 0.0)
    data["angle"] = 0.5 + 0.2 * (data["t"] - late) + 0.3
    columns = {"joint_position.drum": {"column": "angle", "delay": late}}
    asked = problem(data, outputs=columns, start="recorded", settle=0.0)
    model = asked.models[0]
    key = "recordings.pull.joint_position.drum"
    for nuisance, angle in (
        ({}, 0.8),
        ({f"{key}.offset": -0.3}, 0.5),
        ({f"{key}.offset": -1.1, f"{key}.scale": 2.0}, 0.5),
    ):
        initial = model._with_nuisance(model.scenario, nuisance).simulation.initial
        assert initial.position["drum"] == pytest.approx(angle, abs=1e-9)
        assert initial.velocity["drum"] == pytest.approx(0.2 * nuisance.get(f"{key}.scale", 1.0), abs=1e-9)


@pytest.mark.slow
def test_a_start_far_from_the_first_row_of_a_recording_is_warned_of():
    data = motion(np.random.default_rng(2), 0.15, 0.4, 0.0)
    table = {name: values[:60] for name, values in data.items()}
    given = {
        "parameters": {COULOMB: (0.1, 0.2)},
        "starts": 1,
        "profiles": False,
        "refits": False,
        "data": {"pull": table},
    }
    columns = {"tendon_tension.T1": "out", "joint_position.drum": "angle"}
    recordings = {"pull": {**MOTION, "start": "rest", "outputs": columns, "settle": 0.2}}
    with pytest.warns(ScenarioWarning, match=r"drum begins at .* rad, and the scenario starts at 0\.9 rad"):
        fp.identify(
            "canal", recordings=recordings, overrides={**BENT, "simulation.initial.position.drum": 0.9}, **given
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScenarioWarning)
        fp.identify("canal", recordings=recordings, overrides=BENT, **given)


@pytest.mark.parametrize(
    ("bench", "inputs", "said"),
    [
        ("servo_bench", {"spool_angle.M1": "a", "motor_voltage.M1": "b"}, "is of the same motor as motor_voltage.M1"),
        ("canal", {"joint_reference.drum": "a", "tendon_command.T1": "b"}, "joint_reference.drum: is read by nobody"),
    ],
)
def test_inputs_of_which_one_would_be_dropped_are_refused(bench, inputs, said):
    data = {"t": np.linspace(0.0, 1.0, 20), "a": np.linspace(0.0, 0.1, 20), "b": np.linspace(1.0, 2.0, 20)}
    output = "motor_position.M1" if bench == "servo_bench" else "joint_position.drum"
    recordings = {"pull": {"time": "t", "inputs": inputs, "outputs": {output: "a"}}}
    key = "finger.joint_friction.viscous"
    with pytest.raises(fp.InputError) as refused:
        fp.identify(bench, parameters={key: (1e-5, 1e-2)}, recordings=recordings, data={"pull": data}, starts=1)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("angle", "is beyond the range of drum, "),
        ("angle_deg", 'column angle_deg seems to be in deg; write { column = "angle_deg", unit = "deg" }'),
    ],
)
def test_degrees_that_nothing_says_are_degrees_are_asked_about(column, said):
    """9.6 degrees are less than two turns of radians, and more than the drum turns."""
    data = motion(np.random.default_rng(2), 0.15, 0.4, 0.0)
    data[column] = np.linspace(0.0, 9.6, len(data["t"]))
    with pytest.raises(fp.InputError, match=said.replace("{", r"\{")):
        problem(data, outputs={"joint_position.drum": column})
    asked = problem(data, outputs={"joint_position.drum": {"column": column, "unit": "deg"}})
    assert np.max(asked.signals[0].measured) == pytest.approx(np.deg2rad(9.6))


@pytest.mark.parametrize("jitter", [0.0, 2e-3])
def test_a_spline_that_follows_the_noise_is_warned_of_with_the_smoothing_that_avoids_it(jitter):
    """The angle's noise is that of its encoder, and speed times the error of its times; uneven times alone are none."""
    rng, time = np.random.default_rng(4), np.arange(0.0, 5.0, 0.01)
    late = rng.normal(0.0, jitter, time.size)
    even = np.sort(time + rng.uniform(-2e-3, 2e-3, time.size))
    angle = np.sin(2.0 * (even + late)) + rng.normal(0.0, 3e-4, even.size)
    data = {"t": even, "q": angle, "tau": np.zeros(even.size)}
    noise = np.hypot(3e-4, jitter * 2.0 / np.sqrt(2.0))

    def said(smoothing):
        entries = {"time": "t", "settle": 0.1, "outputs": {"joint_effort.drum": "tau"}}
        entries["inputs"] = {"joint_position.drum": {"column": "q", "smoothing": smoothing}}
        settings = validate(RecordingSettings, entries, ())
        models, _ = recording_models(
            fp.load_scenario("canal"), [read_recording("log", settings, data)], None, [np.ones(even.size, dtype=bool)]
        )
        return [each for each in models[0].warnings([]) if "follows the noise" in each]

    (told,) = said(1e-4)
    assert float(told.split("readings scatter by ")[1].split()[0]) == pytest.approx(noise, rel=0.15)
    assert said(0.0) and not said(noise)
