"""Identification from motions: frictions that made-up recordings hide, how sure they are, clear refusals."""

import re

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.identification.residuals.models import windows
from finger_pin.identification.residuals.recordings import read_recording
from finger_pin.laws.spring import JOINT_SPRING

COULOMB, DRAG = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag"
BOUNDS = {COULOMB: (0.005, 1.0), DRAG: (0.0, 3.0)}
# Where the estimate alone is asked for.
QUICK = {"starts": 1, "profiles": False, "refits": False}


def ramp(rng, coulomb, drag, correlation=0.0, rate=100.0):
    """The scenario canal drawn in evenly, in closed form: k theta + c theta' = r f, f by the capstan law and a drag.

    Bristles follow friction F that grows later: F' = s v (1 - F / level) leaves F F' / (s v (1 + d)), where
    d = tanh(mu phi / 2).
    """
    turn, radius, stiffness, viscous, rise, bristles = np.pi / 2.0, 0.02, 0.2, 2e-3, 4.0, 5e4
    time = np.arange(0.5, 3.0, 1.0 / rate)
    pull = 3.0 + rise * time
    passing, share = np.exp(-coulomb * turn), np.tanh(coulomb * turn / 2.0)
    out = pull * passing - drag / (1.0 + share)
    sliding = radius**2 * rise * passing / stiffness
    out += (pull - out) * rise * (1.0 - passing) / (bristles * sliding * (1.0 + share))
    angle = (radius * out - viscous * radius * rise * passing / stiffness) / stiffness
    noise = np.zeros((2, time.size))
    for k, fresh in enumerate(rng.normal(size=(time.size, 2))):
        noise[:, k] = correlation * noise[:, k - 1] + np.sqrt(1.0 - correlation**2) * fresh
    return {"t": time, "in": pull, "f": out + 0.03 * noise[0], "q": np.degrees(angle + 2e-3 * noise[1])}


TURNED = {"column": "q", "unit": "deg"}
MOTION = {
    "time": "t",
    "start": "recorded",
    "settle": 0.2,
    "inputs": {"tendon_command.T1": "in"},
    "outputs": {"tendon_tension.T1": "f", "joint_position.drum": TURNED},
}


@pytest.mark.slow
@pytest.mark.parametrize("more", [{}, {"window": 1.0}, {"start": "found"}], ids=["whole", "windows", "start found"])
def test_a_recorded_motion_gives_the_friction_that_it_was_made_with(more):
    truth = {COULOMB: 0.15, DRAG: 0.5}
    data = ramp(np.random.default_rng(4), *truth.values())
    recordings = {"pull": {**MOTION, **more}}
    result = fp.identify("canal", parameters=BOUNDS, recordings=recordings, data={"pull": data}, **QUICK)
    np.testing.assert_allclose(result.estimate, list(truth.values()), rtol=0.05)
    np.testing.assert_allclose(result.noise, [0.03, 2e-3], rtol=0.2)
    assert result.parameter.size == 2 and result.signal.size == 2


@pytest.mark.slow
def test_a_finger_of_ones_own_is_identified_with_the_rows_that_it_has():
    """Half of the drum's spring is a row of its own: the motion is the same, and so is the friction found in it."""
    truth, half = {COULOMB: 0.15, DRAG: 0.5}, {"finger.joints.drum.spring.stiffness": 0.1}
    spring = fp.Rows("drum_spring", JOINT_SPRING, ("drum",), [[0.1], [0.0], [0.0]], np.ones((1, 1)))
    finger = fp.Finger(fp.load_scenario("canal", half).finger, rows=[spring])
    data = {"pull": ramp(np.random.default_rng(4), *truth.values())}
    result = fp.identify("canal", parameters=BOUNDS, recordings={"pull": MOTION}, data=data, finger=finger, **QUICK)
    np.testing.assert_allclose(result.estimate, list(truth.values()), rtol=0.05)
    np.testing.assert_allclose(result.noise, [0.03, 2e-3], rtol=0.2)


@pytest.mark.slow
def test_estimates_from_motions_scatter_about_the_truth_as_their_intervals_say():
    truth, rows = np.array([0.15, 0.5]), []
    for seed in range(100, 108):
        data = ramp(np.random.default_rng(seed), *truth)
        found = fp.identify("canal", parameters=BOUNDS, recordings={"pull": MOTION}, data={"pull": data}, starts=1)
        rows.append([found.estimate.values, found.lower.values, found.upper.values])
    estimate, lower, upper = np.array(rows).transpose(1, 0, 2)
    # Of 16, each with 95 %: fewer than 12 happen once in a thousand times. A mean of 8 beyond 3 / sqrt(8) likewise.
    assert np.sum((lower <= truth) & (truth <= upper)) >= 12
    away = (estimate - truth) / ((upper - lower) / 3.92)
    assert np.all(np.abs(away.mean(axis=0)) < 3.0 / np.sqrt(8.0))


@pytest.mark.slow
def test_two_recordings_with_gaps_share_the_friction_and_go_on_after_an_interruption(tmp_path):
    """A third of the samples is missing in one; the other is another pull of the same canal."""
    rng, truth, asked, before = np.random.default_rng(12), [0.15, 0.5], [], []
    data = {name: ramp(rng, *truth) for name in ("one", "two")}
    missing = rng.uniform(size=data["one"]["t"].size) < 1.0 / 3.0
    data["one"]["f"] = np.where(missing, np.nan, data["one"]["f"])
    given = {"parameters": BOUNDS, "recordings": dict.fromkeys(data, MOTION), "data": data, "starts": 1}
    whole = fp.identify("canal", **given, stop=lambda: bool(before.append(0)))
    np.testing.assert_allclose(whole.estimate, truth, rtol=0.03)
    later = data["one"]["t"] - data["one"]["t"][0] >= MOTION["settle"]
    samples = dict(zip(whole.signal.values, whole.signal_samples.values, strict=True))
    assert samples["one.tendon_tension.T1"] == np.sum(later & ~missing)
    assert samples["two.tendon_tension.T1"] == np.sum(later)

    def stop():
        asked.append(0)
        return len(asked) == len(before) - 2

    part = fp.identify("canal", **given, output=tmp_path, stop=stop)
    assert "unfinished" in part.attrs and len(asked) == len(before) - 2
    again = fp.identify("canal", **given, output=tmp_path)
    assert "unfinished" not in again.attrs and again.attrs["evaluations"] < whole.attrs["evaluations"]
    for name in ("estimate", "lower", "upper"):
        np.testing.assert_allclose(again[name], whole[name], rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"start": "recorded", "outputs": {"joint_position.drum": TURNED}}, "cannot be reached: drum begins at"),
        ({"start": "recorded", "outputs": {"tendon_tension.T1": "f"}}, "needs joint_position among the outputs"),
        ({"inputs": {"motor_current.M1": "f"}}, "a motion is given tendon_command, spool_angle"),
        ({"inputs": {"joint_position.drum": TURNED}}, "drum.smoothing: is missing"),
        ({"time": "f"}, "times must increase"),
        ({"start": "rest", "outputs": {"joint_position.wheel": "f"}}, "there is no wheel; there are drum"),
        ({"start": "rest", "outputs": {"joint_positon.drum": "f"}}, "did you mean joint_position?"),
    ],
)
def test_wrong_recordings_of_motions_are_refused_in_one_line(change, said):
    recordings = {"pull": {**MOTION, **change}}
    data = ramp(np.random.default_rng(1), 0.15, 0.5)
    data["f"][3:5] = data["f"][3]
    data["q"] = data["q"] + 500.0
    with pytest.raises(fp.InputError) as refused:
        fp.identify("canal", parameters=BOUNDS, recordings=recordings, data={"pull": data}, starts=1)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.slow
def test_a_number_that_nothing_recorded_of_a_motion_feels_is_refused_by_its_key():
    recordings = {"pull": {**MOTION, "start": "rest", "outputs": {"tendon_command.T1": "f"}}}
    given = {"parameters": {COULOMB: BOUNDS[COULOMB]}, "recordings": recordings, "starts": 1}
    with pytest.raises(fp.InputError, match=f"{COULOMB}: no output"):
        fp.identify("canal", **given, data={"pull": ramp(np.random.default_rng(1), 0.15, 0.5)})


@pytest.mark.slow
def test_windows_of_one_motion_are_held_out_in_turn_where_laws_are_compared():
    data = ramp(np.random.default_rng(5), 0.15, 0.5)
    result = fp.identify(
        "canal",
        parameters=BOUNDS,
        recordings={"pull": {**MOTION, "window": 1.0}},
        compare={"capstan": {DRAG: 0.0}},
        data={"pull": data},
        starts=1,
    )
    own, capstan = result.law_held_out.values
    # What was not seen is met as well as noise allows; without the drag it is not.
    assert 0.8 < own < 1.2
    assert capstan > 1.5


@pytest.mark.parametrize("wrong", [{"finger.nothing": 1.0}, {DRAG: (0.5, 0.1)}])
def test_a_law_to_compare_that_is_wrong_is_refused_before_any_search(wrong):
    begun = []
    with pytest.raises(fp.InputError, match=r"identify\.compare\.other"):
        fp.identify(
            "canal",
            parameters=BOUNDS,
            recordings={"pull": MOTION},
            compare={"other": wrong},
            data={"pull": ramp(np.random.default_rng(5), 0.15, 0.5)},
            progress=lambda *words: begun.append(words),
        )
    assert not begun


@pytest.mark.slow
def test_windows_begin_before_what_is_compared_so_that_no_sample_but_the_first_is_lost():
    data = ramp(np.random.default_rng(4), 0.15, 0.5)
    settings = RecordingSettings.model_validate({**MOTION, "window": 1.0})
    recording = read_recording("pull", settings, data)
    parts = [recording.time[rows] for rows in windows(recording)]
    np.testing.assert_allclose([part[0] for part in parts], [0.0, 0.8, 1.8], atol=1e-9)
    np.testing.assert_allclose([part[-1] for part in parts], [0.99, 1.99, 2.49], atol=1e-9)
    given = {"recordings": {"pull": {**MOTION, "window": 1.0}}, "data": {"pull": data}, **QUICK}
    result = fp.identify("canal", parameters=BOUNDS, **given)
    assert result.signal_samples.values.tolist() == [230, 230]


@pytest.mark.slow
def test_residuals_that_follow_each_other_count_as_fewer():
    """With a correlation of 0.9 between neighbours, one sample in 19 is independent (Bartlett)."""
    given = {"parameters": BOUNDS, "recordings": {"pull": MOTION}, **QUICK}
    white, red = (
        fp.identify("canal", data={"pull": ramp(np.random.default_rng(8), 0.15, 0.5, rho)}, **given)
        for rho in (0.0, 0.9)
    )
    assert white.independent_share.values == pytest.approx([1.0, 1.0], abs=0.15)
    assert red.independent_share.values == pytest.approx([1 / 19, 1 / 19], rel=0.6)
    width = [float(each.upper[1] - each.lower[1]) for each in (white, red)]
    assert 2.5 < width[1] / width[0] < 8.0


@pytest.mark.slow
def test_an_offset_and_a_delay_of_an_output_are_found():
    data = ramp(np.random.default_rng(6), 0.15, 0.5)
    data["f"] = np.interp(data["t"] - 0.05, data["t"], data["f"]) + 0.2
    key = "recordings.pull.tendon_tension.T1"
    parameters = {COULOMB: (0.005, 1.0), f"{key}.offset": (-1.0, 1.0)}
    columns = {**MOTION["outputs"], "tendon_tension.T1": {"column": "f", "delay": 0.05}}
    recordings = {"pull": {**MOTION, "outputs": columns}}
    given = {"data": {"pull": data}, "overrides": {DRAG: 0.5}, **QUICK}
    result = fp.identify("canal", parameters=parameters, recordings=recordings, **given)
    np.testing.assert_allclose(result.estimate, [0.15, -0.2], rtol=0.05)
    assert result.units.values.tolist() == ["1", "N"]
    with pytest.raises(fp.InputError, match="must be a key of the scenario, or variable"):
        wrong = {**parameters, f"{key}.gain": (0.1, 2.0)}
        fp.identify("canal", parameters=wrong, recordings=recordings, **given)


def test_the_motion_that_tells_coulomb_from_drag_is_proposed():
    """At one load they cannot be told apart; a load that varies tells them."""
    steady = {"kind": "ramp", "time": 0.0, "duration": 0.2, "height": 8.0}
    rising = {"kind": "ramp", "time": 0.0, "duration": 1.0, "height": 16.0}
    candidates = {name: {"controller.tensions.T1": each} for name, each in (("held", steady), ("rising", rising))}
    overrides = {"simulation.duration": 1.0}
    given = {"parameters": {COULOMB: (0.05, 0.2), DRAG: (0.0, 1.0)}, "outputs": {"tendon_tension.T1": 0.05}}
    found = fp.propose("canal", candidates, **given, overrides=overrides)
    assert found.candidate.values[0] == "rising"
    assert (found.deviation[0] < found.deviation[1]).all() and (found.deviation < [0.0375, 0.25]).all()
    with pytest.raises(fp.InputError, match="at least one"):
        fp.propose("canal", {}, **given)
    for entry, value, named in (
        ("outputs", {}, "outputs"),
        ("outputs", {"tendon_tension.T1": 0.0}, "outputs.tendon_tension.T1"),
        ("outputs", {"tendon_tension.T1": "small"}, "outputs.tendon_tension.T1"),
        ("parameters", {COULOMB: (0.2, 0.05)}, f"parameters.{COULOMB}"),
        ("parameters", {COULOMB: 0.2}, f"parameters.{COULOMB}"),
        ("prior", {DRAG: 0.1, "finger.mass": 1.0}, "prior.finger.mass"),
    ):
        with pytest.raises(fp.InputError, match=f"^{re.escape(named)}"):
            fp.propose("canal", candidates, **{**given, entry: value}, overrides=overrides)


def test_columns_of_a_recording_have_the_unit_of_their_header_and_are_asked_about_degrees_and_milliseconds():
    pulled, turned = {"tendon_command.T1": "in (gf)"}, {"joint_position.medial": "q [deg]"}
    entries = {"time": "t (ms)", "inputs": pulled, "outputs": turned}
    data = {"t (ms)": [0.0, 50e3, 100e3], "in (gf)": [0.0, 100.0, 200.0], "q [deg]": [0.0, 90.0, 180.0]}
    recording = read_recording("pull", RecordingSettings.model_validate(entries), data)
    np.testing.assert_allclose(recording.time, [0.0, 50.0, 100.0])
    np.testing.assert_allclose(recording.inputs["tendon_command.T1"], [0.0, 0.980665, 1.96133])
    np.testing.assert_allclose(recording.outputs["joint_position.medial"], [0.0, np.pi / 2.0, np.pi])
    bare = {name.partition(" ")[0]: values for name, values in data.items()}
    change = {"time": "t", "inputs": {"tendon_command.T1": "in"}, "outputs": {"joint_position.medial": "q"}}
    for more, said in [
        ({}, r'recordings.pull.time = "t": names no unit, and its 3 rows take 0.1 s in us or 100000 s in s: write {'),
        (
            {"time": {"column": "t", "unit": "ms"}},
            r"medial = 180.0: angles must be at most 12.5 rad \(is it in degrees",
        ),
    ]:
        settings = RecordingSettings.model_validate({**change, **more})
        with pytest.raises(fp.InputError, match=said):
            read_recording("pull", settings, bare)
