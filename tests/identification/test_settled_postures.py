"""Settled postures as readings: springs and canal friction from tables of pulls and angles, against closed forms."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import settled_posture
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.validation import validate
from finger_pin.identification.residuals.recordings import read_recording
from finger_pin.identification.residuals.steady_data import SteadyReadings

THREE = """
[finger]
name = "three"
gravity = [0.0, 0.0, 0.0]
joints.mcp = { range = [0.0, 1.6], spring = { stiffness = 0.5 }, link = { length = 0.05, width = 0.01, mass = 0.015 } }
joints.pip = { range = [0.0, 1.6], spring = { stiffness = 0.5 }, link = { length = 0.03, width = 0.01, mass = 0.008 } }
joints.dip = { range = [0.0, 1.6], spring = { stiffness = 0.5 }, link = { length = 0.02, width = 0.01, mass = 0.004 } }
tendons.flexor.crossings = { mcp = { radius = 0.010 }, pip = { radius = 0.008 }, dip = { radius = 0.006 } }
[controller]
kind = "tensions"
minimum_tension = 0.0
"""
RADIUS = {"mcp": 0.010, "pip": 0.008, "dip": 0.006}
SPRING = {"mcp": 0.30, "pip": 0.20, "dip": 0.10}
STIFFNESS, COULOMB, TURN = "finger.joints.drum.spring.stiffness", "finger.tendon_friction.coulomb", np.pi / 2.0


def drum(**more):
    """A recording of the drum of the canal."""
    columns = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"joint_position.drum": "q"}}
    return {"settled": {"kind": "steady", "speed": {"column": "way", "scale": 0.01}, **columns, **more}}


@pytest.mark.slow
def test_springs_come_from_settled_postures_as_linear_regression_has_them(tmp_path):
    """Joints whose friction is that of the defaults, shaken: k q = r T, with angles left out here and there."""
    (tmp_path / "three.toml").write_text(THREE)
    pull = np.repeat([3.0, 6.0, 9.0, 12.0], 2)
    noise = np.random.default_rng(8).normal(0.0, 2e-3, (3, pull.size))
    data = {name: RADIUS[name] * pull / SPRING[name] + e for name, e in zip(RADIUS, noise, strict=True)}
    data["pip"][3] = np.nan
    columns = {
        "inputs": {"tendon_command.flexor": "pull"},
        "outputs": {f"joint_position.{name}": {"column": name, "unit": "deg"} for name in RADIUS},
    }
    result = fp.identify(
        str(tmp_path / "three.toml"),
        parameters={f"finger.joints.{name}.spring.stiffness": (0.05, 1.0) for name in RADIUS},
        recordings={"settled": {"kind": "steady", **columns}},
        data={"settled": {"pull": pull, **{name: np.degrees(each) for name, each in data.items()}}},
        starts=1,
        refits=False,
    )
    seen = {name: np.isfinite(each) for name, each in data.items()}
    expected = [
        RADIUS[name] * pull[seen[name]] @ pull[seen[name]] / (pull[seen[name]] @ data[name][seen[name]])
        for name in RADIUS
    ]
    np.testing.assert_allclose(result.estimate, expected, rtol=1e-4)
    assert np.all((result.lower.values < [*SPRING.values()]) & ([*SPRING.values()] < result.upper.values))


@pytest.mark.slow
def test_drawn_in_and_let_out_tell_the_spring_and_the_friction_of_the_canal():
    """The drum rests at k q = r T exp(-mu phi) after drawing in and r T exp(mu phi) after letting out, written out."""
    pull, way = np.tile([2.0, 4.0, 6.0], 2), np.repeat([1.0, -1.0], 3)
    exact = 0.02 * pull * np.exp(-0.15 * way * TURN) / 0.3
    data = {"in": pull, "way": way, "q": exact + np.random.default_rng(4).normal(0.0, 1e-3, 6)}
    parameters = {STIFFNESS: (0.1, 1.0), COULOMB: (0.01, 1.0)}
    result = fp.identify(
        "canal", parameters=parameters, recordings=drum(), data={"settled": data}, starts=1, refits=False
    )
    np.testing.assert_allclose(result.estimate, [0.3, 0.15], rtol=0.01)
    assert np.all((result.lower.values < [0.3, 0.15]) & (result.upper.values > [0.3, 0.15]))


@pytest.mark.parametrize("speed", [None, 0.01, -0.01])
@pytest.mark.parametrize("near", [0.1, 1.2])
def test_a_posture_at_rest_is_found_from_near_and_far(speed, near):
    finger = fp.Finger(fp.load_scenario("canal", {COULOMB: 0.15}).finger)
    found = settled_posture(finger, np.array([4.0]), speed, np.array([near]), np.zeros(3))
    assert found == pytest.approx([0.02 * 4.0 * np.exp(-0.15 * TURN * np.sign(speed or 0.0)) / 0.2], rel=1e-6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_each_bend_of_a_cord_takes_its_part_before_the_joints_behind_it(tmp_path, way):
    """k_j q_j = r_j T exp(-mu sum of the turns up to j), drawn in, and with the other sign let out."""
    text = THREE.replace("radius =", "bends = true, radius =").replace(
        "[controller]", "[finger.tendon_friction]\n[controller]"
    )
    (tmp_path / "three.toml").write_text(text)
    friction = {"place": "bends", "coulomb": 0.2, "stiction_ratio": 1.0, "viscous": 0.0}
    springs = {f"finger.joints.{name}.spring": {"stiffness": SPRING[name]} for name in RADIUS}
    free = {"finger.joint_friction": {"coulomb": 0.0, "stiction": 0.0}, "finger.tendon_friction": friction}
    scenario = fp.load_scenario(str(tmp_path / "three.toml"), springs | free)
    told = {"kind": "steady", "speed": 1e-4 * way, "inputs": {"tendon_command.flexor": "in"}, "outputs": POSTURE}
    pull = np.array([2.0, 6.0])
    data = {"in": pull, **{name: np.full(2, 0.1) for name in RADIUS}}
    settings = validate(RecordingSettings, told, ("identify", "recordings", "one"))
    found = np.array(SteadyReadings(read_recording("one", settings, data), scenario).compute(scenario, {}))
    radius, spring = (np.array([*each.values()])[:, None] for each in (RADIUS, SPRING))
    left = pull * np.exp(-0.2 * way * np.cumsum(np.abs(found), axis=0))
    np.testing.assert_allclose(spring * found, radius * left, rtol=2e-3)


@pytest.mark.parametrize(
    ("change", "overrides", "said"),
    [
        ({"inputs": {"tendon_command.T1": "in", "joint_position.drum": "q"}}, {}, "joint_position.drum: is an output"),
        ({}, {"finger.joint_friction.stiction": 1e-4}, "settled.speed: does not tell where the finger rests"),
        ({"speed": None, "outputs": {"tendon_tension.T1": "q"}}, {}, "settled.speed: is missing"),
        ({"outputs": {"joint_position.wheel": "q"}}, {}, "there is no wheel; there are drum"),
    ],
)
def test_postures_whose_friction_is_not_told_are_refused_in_one_line(change, overrides, said):
    data = {"settled": {"in": [2.0, 4.0], "way": [1.0, -1.0], "q": [0.1, 0.4]}}
    given = {"parameters": {STIFFNESS: (0.1, 1.0)}, "recordings": drum(**change), "data": data}
    with pytest.raises(fp.InputError) as refused:
        fp.identify("canal", **given, overrides=overrides)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.slow
def test_springs_come_from_what_a_winch_winds_as_its_cord_shares_it(tmp_path):
    """T = K (w - sum r q) and k q = r T: the angles of three joints on one cord, of which one spring is weighed."""
    (tmp_path / "three.toml").write_text(THREE)
    wound, cord = np.array([0.002, 0.004, 0.006, 0.008, 0.01]), 4000.0
    tension = cord * wound / (1.0 + cord * sum(RADIUS[name] ** 2 / SPRING[name] for name in RADIUS))
    noise = np.random.default_rng(4).normal(0.0, 1e-4, (3, wound.size))
    angles = {name: RADIUS[name] * tension / SPRING[name] + e for name, e in zip(RADIUS, noise, strict=True)}
    recording = {
        "kind": "steady",
        "inputs": {"tendon_winding.flexor": {"column": "w", "unit": "mm"}},
        "outputs": {f"joint_position.{name}": {"column": name, "unit": "rad"} for name in RADIUS},
    }
    given = {
        "parameters": {f"finger.joints.{name}.spring.stiffness": (0.02, 1.0) for name in ("pip", "dip")},
        "data": {"settled": {"w": 1e3 * wound, **angles}},
        "overrides": {
            "finger.tendons.flexor.winch.stiffness": cord,
            "finger.joints.mcp.spring.stiffness": SPRING["mcp"],
        },
        "starts": 1,
        "refits": False,
    }
    bench = str(tmp_path / "three.toml")
    found = fp.identify(bench, recordings={"settled": recording}, **given)
    np.testing.assert_allclose(found.estimate, [SPRING["pip"], SPRING["dip"]], rtol=5e-3)
    assert np.all((found.upper - found.lower) < 0.02 * found.estimate)
    for change in ({"speed": 0.1}, {"outputs": {"tendon_tension.flexor": "w"}, "speed": 0.1}):
        with pytest.raises(fp.InputError, match="tells postures without friction"):
            fp.identify(bench, recordings={"settled": recording | change}, **given)


MOTOR = {
    **{"voltage": 5.0, "torque_constant": 0.4, "resistance": 3.2, "maximum_current": 1.5, "inertia": 2e-4},
    **{"friction": {"coulomb": 0.0, "viscous": 2e-3}, "encoder": {"range": [-3.0, 3.0]}},
}
SERVO = {
    **{"motor": MOTOR, "tendons": ["flexor"], "spool_radius": 0.008, "drive": "position", "pretension": 2.0},
    **{"tendon_rigidity": 1200.0, "tendon_length": 0.3, "position_loop": {"proportional": 2.3}},
}
FREE = {
    **{f"finger.joints.{name}.spring": {"stiffness": SPRING[name], "damping": 0.01} for name in RADIUS},
    **{"finger.joint_friction": {"coulomb": 0.0, "stiction": 0.0}, "finger.tendon_friction.coulomb": 0.0},
    "finger.tendon_friction.viscous": 0.0,
}
POSTURE = {f"joint_position.{name}": {"column": name, "unit": "rad"} for name in RADIUS}


def readings(path, servo, inputs, values=(0.5, 1.0), speed=None, **change):
    """A servo on the cord of three joints, and settled postures of it."""
    path.write_text(THREE.replace("minimum_tension = 0.0", ""))
    made = {key: value for key, value in (SERVO | servo).items() if value is not None}
    scenario = fp.load_scenario(str(path), {"finger.actuators": {"servo": made}} | FREE)
    told = {"kind": "steady", "inputs": {name: {"column": "in"} | change for name in inputs}, "outputs": POSTURE}
    data = {"in": values, **{name: np.full(len(values), 0.1) for name in RADIUS}}
    settings = validate(RecordingSettings, told | {"speed": speed}, ("identify", "recordings", "one"))
    return SteadyReadings(read_recording("one", settings, data), scenario), scenario


@pytest.mark.parametrize(
    ("loop", "compliance", "current"),
    [
        ({"proportional": 2.3, "derivative": 0.01}, 0.008**2 / (0.4 * 5.0 / 3.2 * 2.3), 1.5),
        ({"proportional": 0.3}, 0.008**2 / (0.4 * 5.0 / 3.2 * 0.3), 1.5),
        ({"proportional": 2.3, "integral": 20.0}, 0.0, 1.5),
        ({"proportional": 2.3, "integral": 20.0}, 0.0, 0.1),
    ],
)
def test_goals_of_a_servo_tell_the_posture_at_which_its_loop_comes_to_rest(tmp_path, loop, compliance, current):
    """T (1 / K + r^2 R / (K_t V k_p) + sum r_j^2 / k_j) = r goal + f0 / K, up to K_t I_max / r; and as a run ends."""
    servo, goal = {"position_loop": loop, "motor": MOTOR | {"maximum_current": current}}, np.array([0.5, 1.0])
    give = compliance + 1.0 / 4000.0 + sum(RADIUS[name] ** 2 / SPRING[name] for name in RADIUS)
    tension = np.minimum((0.008 * goal + 2.0 / 4000.0) / give, 0.4 * current / 0.008)
    expected = [RADIUS[name] * tension / SPRING[name] for name in RADIUS]
    by_angle, scenario = readings(tmp_path / "three.toml", servo, ["spool_angle.servo"])
    np.testing.assert_allclose(by_angle.compute(scenario, {}), expected, rtol=1e-6)
    by_length, _ = readings(tmp_path / "three.toml", {}, ["tendon_winding.flexor"], 0.008 * goal)
    np.testing.assert_allclose(by_length.compute(scenario, {}), expected, rtol=1e-6)
    run = {"controller.spool_angle.servo.offset": 1.0, "simulation.duration": 3.0}
    end = fp.simulate(fp.load_scenario(scenario, run)).joint_position.values[-1]
    np.testing.assert_allclose(end, np.array(expected)[:, 1], rtol=1e-3)


def test_a_motor_in_tension_drive_settles_the_finger_up_to_its_stall_torque(tmp_path):
    servo = {"drive": "tension", "motor": MOTOR | {"maximum_current": 0.1}, "position_loop": None}
    made, scenario = readings(tmp_path / "three.toml", servo, ["tendon_command.flexor"], (3.0, 8.0))
    expected = [RADIUS[name] * np.array([3.0, 0.4 * 0.1 / 0.008]) / SPRING[name] for name in RADIUS]
    np.testing.assert_allclose(made.compute(scenario, {}), expected, rtol=1e-6)


PLAY, OFF = MOTOR | {"friction": {"coulomb": 0.0, "backlash": 0.01}}, {"proportional": 2.3, "torque_off": 1.0}
GOAL, TENSION = ["spool_angle.servo"], {"drive": "tension", "position_loop": None}
COGGED = MOTOR | {"cogging": {"amplitude": 0.01, "per_turn": 20.0}}


@pytest.mark.parametrize(
    ("servo", "inputs", "change", "said"),
    [
        (TENSION, GOAL, {}, r'spool_angle.servo: tells no rest: finger.actuators.servo.drive must be "position"$'),
        ({"motor": PLAY}, GOAL, {}, "servo.motor.friction.backlash must be 0"),
        ({"motor": PLAY, "tendon_pieces": 4}, GOAL, {}, "servo.tendon_pieces must be 0, and .*backlash must be 0"),
        ({"motor": COGGED}, GOAL, {}, "no rest: .*servo.motor.cogging must be left out"),
        (
            {"motor": COGGED, **TENSION},
            ["tendon_command.flexor"],
            {},
            "lack what servo rests at: .*servo.motor.cogging",
        ),
        ({"position_loop": OFF}, GOAL, {}, "servo.position_loop.torque_off must be left out"),
        (
            {},
            ["tendon_command.flexor"],
            {},
            r'one.inputs: lack what servo rests at: spool_angle.servo, or .*servo.drive must be "tension"',
        ),
        ({}, [*GOAL, "tendon_winding.flexor"], {}, "is of the same cord as spool_angle.servo: leave one out"),
        ({}, ["spool_angle.motor"], {}, "there is no motor; there are servo"),
        ({}, ["motor_voltage.servo"], {}, "is given tendon_command, spool_tension, spool_angle, tendon_winding and"),
        ({}, GOAL, {"speed": 0.1}, "spool_angle.servo: tells postures without friction"),
        ({}, GOAL, {"scale": 9.0}, "encoder.range.* takes the spool from 4.5 to 9"),
    ],
)
def test_goals_that_tell_no_rest_are_refused_in_one_line(tmp_path, servo, inputs, change, said):
    with pytest.raises(fp.InputError, match=said) as refused:
        readings(tmp_path / "three.toml", servo, inputs, **change)
    assert "\n" not in str(refused.value)
