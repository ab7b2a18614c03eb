"""Motions that are given and efforts that are compared, against Newton and Euler by Pinocchio and closed forms."""

import warnings

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.validation import validate
from finger_pin.identification.residuals.models import recording_models
from finger_pin.identification.residuals.recorded_inputs import without_commands
from finger_pin.identification.residuals.recordings import read_recording

LENGTH, WIDTH, MASS = (
    {"shoulder": 0.3, "elbow": 0.25},
    {"shoulder": 0.04, "elbow": 0.03},
    {"shoulder": 1.2, "elbow": 0.7},
)
ARM = """
[finger]
name = "arm"
gravity = [9.81, 0.0, 0.0]
joints.shoulder = { range = [-3.0, 3.0], link = { length = 0.3, width = 0.04, mass = 1.2 } }
joints.elbow = { range = [-3.0, 3.0], link = { length = 0.25, width = 0.03, mass = 0.7 } }
tendons.cord.crossings.elbow.radius = 0.01
tendon_friction = { coulomb = 0.0, viscous = 0.0 }
joint_friction = { coulomb = 0.0, stiction = 0.0, viscous = 0.0 }
[controller]
kind = "tensions"
minimum_tension = 0.0
"""


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.toml").write_text(ARM)
    return str(tmp_path / "arm.toml")


def recording(joints, smoothing=0.0, **more):
    """A recording of joints' angles and efforts, by columns q and e with their names."""
    inputs = {f"joint_position.{name}": {"column": f"q_{name}", "smoothing": smoothing} for name in joints}
    return {"time": "t", "inputs": inputs, "outputs": {f"joint_effort.{name}": f"e_{name}" for name in joints}} | more


def efforts(bench, overrides, data, settings, nuisance=None):
    """The computed outputs of all windows of a recording, in a row."""
    read = read_recording("log", validate(RecordingSettings, settings, ()), data)
    models, _ = recording_models(
        fp.load_scenario(bench, overrides), [read], None, [np.ones(len(read.time), dtype=bool)]
    )
    parts = [model.compute(model.scenario, nuisance or {}) for model in models]
    return np.concatenate(parts, axis=1)


def two_rods():
    """The arm as a model of Pinocchio: two cylinders along x, turned about z."""
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    for name, length in LENGTH.items():
        axial, across = MASS[name] * WIDTH[name] ** 2 / 8.0, MASS[name] * (WIDTH[name] ** 2 / 16.0 + length**2 / 12.0)
        parent = model.addJoint(parent, pin.JointModelRZ(), place, name)
        body = pin.Inertia(MASS[name], np.array([length / 2.0, 0.0, 0.0]), np.diag([axial, across, across]))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.gravity.linear[:] = [9.81, 0.0, 0.0]
    return model


def swings(time):
    """Angles, speeds and accelerations of two joints, shape (3, 2, m)."""
    angle = [0.8 * np.sin(2.0 * time) - 0.3, 0.6 * np.cos(3.0 * time)]
    speed = [1.6 * np.cos(2.0 * time), -1.8 * np.sin(3.0 * time)]
    return np.array([angle, speed, [-3.2 * np.sin(2.0 * time), -5.4 * np.cos(3.0 * time)]])


@pytest.mark.parametrize(("window", "late"), [(None, 0.0), (1.0, 0.013)])
def test_efforts_without_friction_are_those_of_newton_and_euler(arm, window, late):
    """Also where the angles come late by what is known and by what is found, and in windows."""
    time = np.arange(0.0, 4.0, 0.01)
    model = two_rods()
    data = model.createData()
    wanted = np.transpose([pin.rnea(model, data, *each) for each in np.transpose(swings(time), (2, 0, 1))])
    columns = dict(zip(("q_shoulder", "q_elbow"), swings(time - late)[0], strict=True))
    settings = recording(LENGTH, window=window)
    for each in settings["inputs"].values():
        each["delay"] = late / 2.0
    found = {f"recordings.log.joint_position.{name}.delay": late / 2.0 for name in LENGTH}
    given = efforts(arm, {}, {"t": time, **columns, "e_shoulder": 0.0 * time, "e_elbow": 0.0 * time}, settings, found)
    # The spline's acceleration errs by some (h w)^4 of 5.4 rad/s2 within, and by more in its first and last pieces.
    inside = slice(6, -6)
    np.testing.assert_allclose(given[:, inside], wanted[:, inside], atol=2e-6)
    assert np.ptp(wanted, axis=1).min() > 1.0


def test_a_slow_sweep_takes_gravity_and_dry_friction_with_the_sign_of_its_speed(arm):
    """Gravity m g c sin q + tau_c sign v for each joint beyond the millirads by which bristles turn round."""
    time = np.arange(0.0, 40.0, 0.02)
    angle, speed = np.sin(0.3 * time), 0.3 * np.cos(0.3 * time)
    drag = [0.3, 0.05]
    data = {"t": time, "q_shoulder": angle, "q_elbow": 0.0 * time, "e_shoulder": 0.0 * time, "e_elbow": 0.0 * time}
    given = efforts(arm, {"finger.joint_friction.drag": drag}, data, recording(LENGTH))
    weight = 9.81 * (MASS["shoulder"] * 0.15 + MASS["elbow"] * (0.3 + 0.125))
    inertia = sum(
        MASS[name] * (WIDTH[name] ** 2 / 16.0 + LENGTH[name] ** 2 / 12.0 + way**2)
        for name, way in (("shoulder", 0.15), ("elbow", 0.425))
    )
    wanted = weight * np.sin(angle) - inertia * 0.09 * np.sin(0.3 * time) + drag[0] * np.sign(speed)
    slides = (np.abs(speed) > 0.06) & (time > 0.1)
    np.testing.assert_allclose(given[0, slides], wanted[slides], atol=3e-5)
    assert np.mean(slides) > 0.8 and {*np.sign(speed[slides])} == {-1.0, 1.0}
    # The elbow rests: its bristles carry nothing, and its effort holds its weight.
    at_rest = 9.81 * MASS["elbow"] * 0.125 * np.sin(angle)
    np.testing.assert_allclose(given[1], at_rest - given_inertia_of_elbow(angle), atol=3e-5)


def given_inertia_of_elbow(angle):
    """What the turning of the upper arm at 0.3 rad/s, q'' = -0.09 q, asks of an elbow at zero."""
    across = MASS["elbow"] * (WIDTH["elbow"] ** 2 / 16.0 + LENGTH["elbow"] ** 2 / 12.0)
    return 0.09 * angle * (across + MASS["elbow"] * 0.125 * (0.125 + 0.3))


def noisy_log(seed):
    """A pendulum's log, written out: 1.2 kg on 0.15 m, bristles and viscous friction, encoder and torque noisy.

    Dry friction is 0.3 N m to greater angles, 0.2 N m to smaller ones.
    """

    def fast(time):
        return 0.72 * np.cos(0.8 * time) + 0.92 * np.cos(2.3 * time)

    def bending(time, friction):
        return 500.0 * (fast(time) - friction * np.abs(fast(time)) / (0.3 if fast(time) > 0.0 else 0.2))

    time, rng = np.arange(0.0, 9.0, 0.02), np.random.default_rng(seed)
    options = {"t_eval": time, "method": "LSODA", "rtol": 1e-9, "atol": 1e-12, "max_step": 0.01}
    dry = solve_ivp(bending, (0.0, time[-1]), [0.0], **options).y[0]
    angle, speed = 0.9 * np.sin(0.8 * time) + 0.4 * np.sin(2.3 * time), fast(time)
    rate = -0.576 * np.sin(0.8 * time) - 2.116 * np.sin(2.3 * time)
    inertia = MASS["shoulder"] * (0.15**2 + 0.04**2 / 16.0 + 0.3**2 / 12.0)
    effort = inertia * rate + 9.81 * MASS["shoulder"] * 0.15 * np.sin(angle) + dry + 0.08 * speed
    # A column that comes 40 ms late, with a zero of its own.
    late = 0.9 * np.sin(0.8 * (time - 0.04)) + 0.4 * np.sin(2.3 * (time - 0.04)) - 0.05
    return {
        "t": time,
        "q_shoulder": late + rng.normal(0.0, 2e-4, time.size),
        "e_shoulder": effort + rng.normal(0.0, 0.02, time.size),
    }


@pytest.mark.slow
def test_mass_and_frictions_come_back_from_a_noisy_log_with_what_the_encoder_errs_by(tmp_path):
    lines = [line for line in ARM.splitlines() if not line.startswith("joints.elbow")]
    (tmp_path / "one.toml").write_text("\n".join(lines).replace("crossings.elbow", "crossings.shoulder"))
    truths = {
        "finger.joints.shoulder.link.mass": MASS["shoulder"],
        "finger.joint_friction.drag": 0.25,
        "finger.joint_friction.drag_asymmetry": 0.2,
        "finger.joint_friction.viscous": 0.08,
        "recordings.log.joint_position.shoulder.offset": 0.05,
        "recordings.log.joint_position.shoulder.delay": 0.04,
    }
    bounds = [(0.3, 4.0), (0.02, 2.0), (-1.0, 1.0), (0.002, 1.0), (-0.3, 0.3), (-0.1, 0.1)]
    found = fp.identify(
        str(tmp_path / "one.toml"),
        parameters=dict(zip(truths, bounds, strict=True)),
        recordings={"log": recording(["shoulder"], smoothing=2e-4)},
        data={"log": noisy_log(3)},
        overrides={"finger.joint_friction.stiffness": 500.0},
        starts=1,
    )
    error = np.abs(found.estimate.values - [*truths.values()])
    width = 0.5 * (found.upper - found.lower).values
    # Six intervals of 95 % are asked for at once: 1.5 of their widths, three standard deviations.
    assert np.all(error < 1.5 * width)
    assert np.all(width < [0.005, 0.006, 0.05, 0.01, 0.01, 0.002])
    assert found.attrs["ringing"] == ""


def test_the_tension_of_a_winch_follows_from_the_joint_that_is_given(arm):
    """K (w - r q) - K_d r q' of a cord on a winch, whatever moves the joint."""
    time = np.arange(0.0, 2.0, 0.01)
    wound, angle, speed = 0.004 + 0.0 * time, 0.1 * np.sin(3.0 * time), 0.3 * np.cos(3.0 * time)
    settings = recording(LENGTH, outputs={"spool_tension.cord": "T"})
    settings["inputs"]["tendon_winding.cord"] = "w"
    data = {"t": time, "q_shoulder": 0.5 * angle, "q_elbow": angle, "w": wound, "T": wound}
    winch = {"stiffness": 5000.0, "damping": 20.0}
    given = efforts(arm, {"finger.tendons.cord.winch": winch}, data, settings)[0]
    taut = 5000.0 * (wound + 0.01 * angle) + 20.0 * 0.01 * speed
    slack = 5000.0 * (wound - 0.01 * angle) - 20.0 * 0.01 * speed
    np.testing.assert_allclose(given, taut if np.ptp(given - taut) < np.ptp(given - slack) else slack, atol=1e-3)


ANGLES = {f"joint_position.{name}": {"column": "q", "smoothing": 0.0, "unit": "rad"} for name in LENGTH}
ELBOW = "joint_position.elbow"


@pytest.mark.parametrize(
    ("change", "rows", "said"),
    [
        ({"inputs": {ELBOW: ANGLES[ELBOW]}}, 100, "inputs: lack joint_position of shoulder"),
        ({"inputs": ANGLES | {"joint_position.wrist": ANGLES[ELBOW]}}, 100, "no such joint; there are shoulder, elbow"),
        ({"inputs": ANGLES | {ELBOW: "q"}}, 100, "elbow.smoothing: is missing"),
        ({"inputs": ANGLES | {ELBOW: {"column": "q", "smoothing": 9.0}}}, 100, "smoothing = 9.0: must be below 0.7"),
        ({"inputs": {"joint_reference.elbow": "q"}}, 100, "elbow: is there where joint_position of every joint is an"),
        ({"start": "recorded"}, 100, 'start = "recorded": is for motions that are computed'),
        ({"outputs": {ELBOW: "q"}}, 100, "outputs.joint_position.elbow: cannot be compared"),
        ({"outputs": {"joint_effort.elbow": {"column": "q", "smoothing": 0.1}}}, 100, "smoothing = 0.1: is for inputs"),
        ({"kind": "steady", "time": None, "speed": 1.0}, 100, "smoothing = 0.0: is for inputs joint_position of mo"),
        ({"inputs": ANGLES | {ELBOW: {"column": "far", "smoothing": 0.0, "unit": "rad"}}}, 100, "stops of elbow"),
        ({}, 5, "time: has 5 rows"),
    ],
)
def test_motions_that_are_not_given_are_refused_in_one_line(arm, change, rows, said):
    time = np.arange(0.0, 1.0, 0.01)[:rows]
    data = {"t": time, "q": np.sin(6.0 * time), "far": 4.0 * np.sin(6.0 * time)}
    settings = {"time": "t", "inputs": ANGLES, "outputs": {"joint_effort.elbow": "q"}} | change
    with pytest.raises(fp.InputError) as error:
        efforts(arm, {}, data, {name: each for name, each in settings.items() if each is not None})
    assert said in str(error.value) and "\n" not in str(error.value)


DRUM = {
    "time": "t",
    "settle": 0.1,
    "inputs": {"joint_position.drum": {"column": "q", "smoothing": 1e-4}},
    "outputs": {"joint_effort.drum": "tau"},
}
STIFFNESS = "finger.joints.drum.spring.stiffness"


def drum_log():
    """Angles of a drum on a spring of 0.2 N m/rad that is turned slowly, and its efforts; the bearing's 2e-3 N m s."""
    time = np.arange(0.0, 5.0, 0.01)
    angle, speed = np.sin(2.0 * time), 2.0 * np.cos(2.0 * time)
    # A square rod of 40 mm and 20 g that is turned about its end, as a cylinder of 20 mm.
    inertia = 0.02 * (0.04**2 / 3.0 + 0.02**2 / 16.0)
    return {"t": time, "q": angle, "tau": 0.2 * angle + 2e-3 * speed - 4.0 * inertia * angle}


def test_a_controller_and_a_minimum_tension_that_no_recording_gives_are_dropped_and_named(arm):
    time = np.arange(0.0, 1.0, 0.01)
    settings = validate(RecordingSettings, recording(LENGTH), ())
    read = read_recording("log", settings, dict.fromkeys(("q_shoulder", "q_elbow", "e_shoulder", "e_elbow", "t"), time))

    def dropped(overrides, bench=arm):
        scenario, names = without_commands(fp.load_scenario(bench, overrides), read)
        assert scenario.controller.kind == "tensions" and not np.any(scenario.controller.minimum_tension)
        return names

    assert dropped({}) == []
    assert dropped({"controller.minimum_tension": 2.0}) == ["controller.minimum_tension"]
    assert dropped({"controller.tensions.cord.offset": 2.0}) == ["tendon_command.cord"]
    assert dropped({}, "reversals") == [f"tendon_command.T{k}" for k in (1, 2, 3, 4)]


@pytest.mark.parametrize(("values", "pull"), [({}, 0.0), ({"controller.tensions.T1.height": 3.0}, 3.0)])
def test_only_commands_that_a_recording_gives_pull_where_efforts_are_compared(values, pull):
    """The scenario's ramp of 18 N is dropped and named; one among the recording's values stays."""
    data = drum_log()
    # 20 mm of drum; a canal that does not rub.
    data["tau"] = data["tau"] - 0.02 * pull * np.clip((data["t"] - 0.2) / 3.0, 0.0, 1.0)
    overrides = {"finger.tendon_friction.coulomb": 0.0}
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        found = fp.identify(
            "canal",
            parameters={STIFFNESS: (0.05, 1.0)},
            recordings={"log": DRUM | {"values": values}},
            data={"log": data},
            overrides=overrides,
            starts=1,
            profiles=False,
            refits=False,
        )
    said = [str(each.message) for each in seen if "of the scenario is zero here" in str(each.message)]
    assert float(found.estimate[0]) == pytest.approx(0.2, rel=2e-4)
    assert len(said) == (0 if values else 1) and all("log: tendon_command.T1 of" in each for each in said)


def test_a_goal_that_a_position_drive_has_from_the_scenario_alone_is_asked_for():
    time = np.arange(0.0, 1.0, 0.01)
    settings = {"time": "t", "inputs": {"joint_position.drum": {"column": "q", "smoothing": 0.0}}}
    settings["outputs"] = {"joint_effort.drum": "q"}
    servo = {"finger.actuators.M1.drive": "position", "controller.tensions": "none"}
    servo["controller.spool_angle.M1.offset"] = 0.5
    with pytest.raises(fp.InputError, match=r"inputs: lack spool_angle\.M1, the goal of a position drive"):
        efforts("servo_bench", servo, {"t": time, "q": 0.1 * time}, settings)
