"""Cords that are wound in by an angle or a length: by servos, by ideal winches, from files and arrays alike."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import equilibrium
from finger_pin.description.loading import read_scenario, to_toml
from finger_pin.exceptions import InputError

RADIUS, SPRING, SPOOL, RIGIDITY = np.array([0.010, 0.008, 0.006]), np.array([0.30, 0.20, 0.10]), 0.005, 2e5
COMPLIANCE = float(np.sum(RADIUS**2 / SPRING))
TURN = {"kind": "ramp", "time": 0.0, "duration": 1.0, "height": 2.0}
LENGTH = {**TURN, "height": 0.010}
TIMES = np.linspace(0.0, 1.5, 31)
JOINTS, LINKS = ("mcp", "pip", "dip"), (0.05, 0.035, 0.025)
SERVO = {
    "motor": "XL330-M288",
    "tendons": ["flexor"],
    "spool_radius": SPOOL,
    "drive": "position",
    "tendon_rigidity": 0.3 * RIGIDITY,
    "position_loop": {"proportional": 2.3},
}


def scenario(controller, servo=None, overrides=None):
    """One cord over three joints with springs, without friction."""
    finger = {
        "name": "three",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {
            name: {
                "range": [0.0, 1.6],
                "spring": {"stiffness": float(k), "damping": 0.01},
                "link": {"length": length, "width": 0.012, "mass": 0.01},
            }
            for name, k, length in zip(JOINTS, SPRING, LINKS, strict=True)
        },
        "tendons": {"flexor": {"crossings": {j: {"radius": float(r)} for j, r in zip(JOINTS, RADIUS, strict=True)}}},
        "tendon_friction": {"coulomb": 0.0, "viscous": 0.0},
        "joint_friction": {"coulomb": 0.0, "stiction": 0.0},
    }
    if servo:
        finger["actuators"] = {"servo": servo}
    table = {"name": "wound", "finger": finger, "controller": controller, "simulation": {"duration": 2.5}}
    return read_scenario(table, overrides)


def settled(made, **given):
    return fp.simulate(made, **given).joint_position.values[-1]


def share_of(tension):
    """The angles at which the springs balance a tension."""
    return RADIUS * tension / SPRING


def test_a_servo_turned_by_two_radians_winds_in_what_its_spool_draws_less_its_sag():
    """Angles r dL / k over the sum of r^2 / k, less the 4 % of its loop; by the angle that it reaches exactly."""
    result = fp.simulate(scenario({"spool_angle": {"servo": TURN}}, SERVO))
    angles = result.joint_position.values[-1]
    np.testing.assert_allclose(angles, share_of(0.010 / COMPLIANCE), rtol=0.04)
    reached = SPOOL * float(result.motor_position[-1, 0])
    np.testing.assert_allclose(angles, share_of(reached / (COMPLIANCE + 1.0 / RIGIDITY)), rtol=1e-4)
    np.testing.assert_allclose(
        result.spool_angle.values[[0, 25, -1], 0], [0.0, 2.0 * result.time.values[25], 2.0], atol=3e-3
    )
    np.testing.assert_allclose(result.tendon_winding.values[:, 0], SPOOL * result.spool_angle.values[:, 0])


def test_the_length_of_its_cord_says_the_same_to_a_servo_as_the_angle_of_its_spool():
    by_angle, by_length = (
        fp.simulate(scenario(given, SERVO))
        for given in ({"spool_angle": {"servo": TURN}}, {"tendon_winding": {"flexor": LENGTH}})
    )
    np.testing.assert_allclose(by_angle.joint_position, by_length.joint_position, atol=1e-12)


def test_an_ideal_winch_winds_in_all_but_the_stretch_of_its_cord_and_its_account_closes():
    """T = dL / (sum of r^2 / k + 1 / K); what it supplies is the work of its cord."""
    made = scenario(
        {"tendon_winding": {"flexor": LENGTH}}, overrides={"finger.tendons.flexor.winch.stiffness": RIGIDITY}
    )
    result = fp.simulate(made)
    tension = 0.010 / (COMPLIANCE + 1.0 / RIGIDITY)
    # The finest bristles of canals hold some 1e-6 of it.
    np.testing.assert_allclose(result.joint_position.values[-1], share_of(tension), rtol=1e-5)
    assert float(result.spool_tension[-1, 0]) == pytest.approx(tension, rel=1e-4)
    assert float(result.tendon_winding[-1, 0]) == pytest.approx(0.010)
    drawn = result.joint_position.values @ RADIUS
    work = float(np.trapezoid(result.spool_tension.values[:, 0], drawn))
    assert work > float(np.sum(0.5 * SPRING * share_of(tension) ** 2))
    assert float(result.energy_exchanged_winches[-1]) == pytest.approx(work, rel=1e-3)
    assert float(abs(result.energy_residual).max()) < 1e-5 * work
    np.testing.assert_allclose(equilibrium(made.finger, {"tendon_winding.flexor": 0.010}).position, share_of(tension))
    again = fp.simulate(read_scenario(__import__("tomllib").loads(to_toml(made))))
    np.testing.assert_array_equal(again.joint_position, result.joint_position)


def test_a_cord_that_is_let_out_goes_slack_and_pulls_no_more():
    out = {"kind": "points", "times": [0.0, 0.5, 1.0], "values": [0.0, 0.010, -0.005]}
    result = fp.simulate(scenario({"tendon_winding": {"flexor": out}}))
    assert float(result.spool_tension.max()) > 8.0
    assert float(abs(result.spool_tension[-1, 0])) == 0.0 and float(abs(result.joint_position[-1]).max()) < 1e-3


@pytest.mark.parametrize("servo", [None, SERVO], ids=["winch", "servo"])
def test_a_file_and_arrays_wind_as_the_signal_does(tmp_path, servo):
    angles = np.minimum(TIMES, 1.0) * 2.0
    name, unit, values = (
        ("spool_angle.servo", "rad", angles) if servo else ("tendon_winding.flexor", "mm", 5.0 * angles)
    )
    lines = [f"time,{name} ({unit})", *(f"{t},{v}" for t, v in zip(TIMES, values, strict=True))]
    (tmp_path / "motion.csv").write_text("\n".join(lines))
    table, own = name.split(".")
    si = values if servo else 1e-3 * values
    sampled = {"kind": "samples", "times": TIMES.tolist(), "values": si.tolist()}
    expected = settled(scenario({table: {own: sampled}}, servo))
    if not servo:
        # Gears of a servo rub by how it arrives.
        np.testing.assert_allclose(expected, settled(scenario({"tendon_winding": {"flexor": LENGTH}})), atol=1e-5)
    by_file = settled(scenario({"file": str(tmp_path / "motion.csv")}, servo))
    by_array = settled(scenario({}, servo), controller=(TIMES, {name: si}))
    np.testing.assert_allclose([by_file, by_array], [expected] * 2, atol=1e-9)


def test_a_hand_winds_every_cord_by_the_name_of_its_finger():
    finger = scenario({}).finger.model_dump(mode="python", exclude_none=True)
    placed = {name: {"finger": finger, "position": [0.0, y, 0.0]} for name, y in (("index", 0.0), ("middle", 0.03))}
    given = {"tendon_winding": {"index": {"flexor": LENGTH}}, "fingers": {"middle": {"tendon_winding": {"flexor": {}}}}}
    table = {"name": "two", "hand": {"fingers": placed, "gravity": [0.0, 0.0, 0.0]}, "controller": given}
    result = fp.simulate(read_scenario(table | {"simulation": {"duration": 2.5}}))
    angles = share_of(0.010 / (COMPLIANCE + 1.0 / 2e4))
    np.testing.assert_allclose(result.joint_position.values[-1], [*angles, 0.0, 0.0, 0.0], rtol=1e-4, atol=1e-6)


def test_a_motor_of_two_cords_winds_each_by_its_own_radius_and_sign():
    """An antagonist on the same spool is paid out by its radius times the angle, as a cord that is wound in says."""
    table = to_toml(scenario({"tendon_winding": {"flexor": LENGTH}}, SERVO))
    table = __import__("tomllib").loads(table)
    table["finger"]["tendons"]["extensor"] = {"crossings": {"mcp": {"radius": -0.004}}}
    table["finger"]["tendons"]["pulled"] = {"crossings": {"pip": {"radius": -0.003}}}
    table["finger"]["actuators"]["servo"] |= {"tendons": ["flexor", "extensor"], "spool_radius": [SPOOL, 0.003]}
    result = fp.simulate(read_scenario(table))
    assert float(result.spool_angle[-1, 0]) == pytest.approx(2.0)
    np.testing.assert_allclose(result.tendon_winding.values[-1], [0.010, -0.006, 0.0])


def test_steps_and_policies_wind_a_winch_by_its_length():
    made = scenario({"tendon_winding": {"flexor": {}}})
    sim = fp.Simulator(made.finger, position=[0.0, 0.0, 0.0])
    for _ in range(20):
        state = sim.step([0.010], 0.1)
    wound = share_of(0.010 / (COMPLIANCE + 1.0 / 2e4))
    np.testing.assert_allclose(state.position, wound, rtol=1e-4)
    gymnasium = pytest.importorskip("gymnasium")
    world = fp.learning.Environment(
        made, reward=lambda signals: signals["action"][:, 0], action="tendon_winding", observation=["joint_position"]
    )
    assert isinstance(world, gymnasium.Env)
    world.reset(seed=0)
    # From all joints at zero to all at 1.6 rad, and 20 N of stretch.
    np.testing.assert_allclose(
        [world.action_space.low, world.action_space.high], [[0.0], [1.6 * 0.024 + 0.001]], atol=1e-7
    )
    for _ in range(80):
        seen, *_ = world.step(np.array([0.010], dtype=np.float32))
    np.testing.assert_allclose(seen["joint_position"] if isinstance(seen, dict) else seen, wound, rtol=1e-3)


def test_an_imported_tendon_is_wound_as_the_position_actuator_of_its_model_winds_it():
    """One that only pulls has the same force, k_p (u - L) + k_v L', whichever of the two is asked."""
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><site name="s0" pos="-0.02 0 0.01"/>
      <body name="one"><joint name="j1" axis="0 1 0" range="-1 1.5" stiffness="0.2" damping="0.01"/>
        <geom type="capsule" size="0.006" fromto="0 0 0 0.04 0 0" mass="0.02"/><site name="s1" pos="0.02 0 0.009"/>
        <body name="two" pos="0.04 0 0"><joint name="j2" axis="0 1 0" range="-1 1.5" stiffness="0.1" damping="0.01"/>
          <geom type="capsule" size="0.006" fromto="0 0 0 0.03 0 0" mass="0.01"/><site name="s2" pos="0.02 0 0.009"/>
      </body></body></worldbody>
      <tendon><spatial name="cord"><site site="s0"/><site site="s1"/><site site="s2"/></spatial></tendon>
      <actuator><position name="w" tendon="cord" kp="20000" kv="10" ctrlrange="0 0.2"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bare = mujoco.MjModel.from_xml_string(text[: text.index("<actuator>")] + "</mujoco>")

    def moved(described, controller):
        finger = fp.from_mujoco(described).model_dump(mode="python", exclude_none=True)
        table = {"name": "imported", "finger": finger, "controller": controller, "simulation": {"duration": 1.0}}
        return fp.simulate(read_scenario(table)).joint_position.values

    ramp = {"kind": "ramp", "time": 0.0, "duration": 0.5}
    by_input = moved(model, {"inputs": {"w": {**ramp, "offset": float(data.ten_length[0]), "height": -0.004}}})
    by_winch = moved(bare, {"tendon_winding": {"cord": {**ramp, "height": 0.004}}})
    assert abs(by_winch[-1]).max() > 0.1
    np.testing.assert_allclose(by_winch, by_input, atol=1e-5)
    with pytest.raises(InputError, match=r"controller\.inputs\.w$"):
        moved(model, {"tendon_winding": {"cord": {}}})


def test_a_voltage_turns_the_motor_until_the_cord_holds_its_torque():
    """T = K_t U / (R r) without friction in the gears, and the springs' angles for it."""
    motor = {"voltage": 5.0, "torque_constant": 0.4, "resistance": 3.2, "maximum_current": 1.5, "inertia": 2e-4}
    motor |= {"friction": {"coulomb": 0.0, "viscous": 0.02}, "encoder": {"range": [-9.0, 9.0]}}
    voltage = {"kind": "ramp", "time": 0.1, "duration": 0.2, "height": 3.2}
    made = scenario(
        {"motor_voltage": {"servo": voltage}},
        {**SERVO, "motor": motor, "spool_radius": 0.02},
        {"simulation.duration": 9.0},
    )
    result = fp.simulate(made)
    np.testing.assert_allclose(result.joint_position.values[-1], share_of(0.4 * 3.2 / (3.2 * 0.02)), rtol=2e-5)
    assert float(result.motor_voltage[-1, 0]) == pytest.approx(3.2)


def test_the_voltages_that_a_loop_asked_for_make_the_same_motion_when_they_are_given(tmp_path):
    overrides = {"simulation.sample_rate": 1000.0, "simulation.duration": 1.0}
    led = fp.simulate(scenario({"spool_angle": {"servo": TURN}}, SERVO, overrides))
    times, volts = led.time.values, led.motor_voltage.values[:, 0]
    bare = scenario({"motor_voltage": {"servo": {}}}, SERVO, overrides)
    given = fp.simulate(bare, controller=(times, {"motor_voltage.servo": volts}))
    np.testing.assert_allclose(given.joint_position.values, led.joint_position.values, atol=1e-9)
    np.savetxt(
        tmp_path / "pwm.csv",
        np.column_stack([times, volts * 1e3]),
        delimiter=",",
        header="time,motor_voltage.servo (mV)",
        comments="",
    )
    file = {"file": str(tmp_path / "pwm.csv")}
    np.testing.assert_allclose(
        fp.simulate(scenario(file, SERVO, overrides)).joint_position.values, led.joint_position.values, atol=1e-9
    )


def test_a_loop_at_its_limit_turns_a_free_motor_in_proportion_to_its_supply():
    """Free speed V K_t / (K_t^2 + b R), while the cord is slack; V sags from 5 V to 3 V."""
    motor = {"voltage": 5.0, "torque_constant": 0.4, "resistance": 3.2, "maximum_current": 1.5, "inertia": 2e-4}
    motor |= {"friction": {"coulomb": 0.0, "viscous": 0.02}, "encoder": {"range": [-60.0, 9.0]}}
    sag = {"kind": "ramp", "time": 0.3, "duration": 0.1, "offset": 5.0, "height": -2.0}
    given = {"spool_angle": {"servo": {"offset": -50.0}}, "supply_voltage": {"servo": sag}}
    overrides = {"simulation.duration": 0.6, "simulation.sample_rate": 1000.0}
    result = fp.simulate(scenario(given, {**SERVO, "motor": motor}, overrides))
    free = -0.4 / (0.4**2 + 0.02 * 3.2)
    np.testing.assert_allclose(result.motor_velocity.values[[299, 599], 0], [5.0 * free, 3.0 * free], rtol=1e-6)
    np.testing.assert_allclose(result.motor_voltage.values[[299, 350, 599], 0], [-5.0, -4.0, -3.0], atol=1e-9)


SUPPLY = {"supply_voltage": {"servo": {"offset": 4.0}}}
WRONG = {
    "a supply beyond the motor's": ({"supply_voltage": {"servo": {"offset": 6.0}}}, r"beyond 0 V to .*motor\.voltage"),
    "a supply below zero": ({"supply_voltage": {"servo": {"offset": -0.1}}}, r"from -0\.1 to -0\.1 V, beyond 0 V"),
    "a supply beside a voltage": ({**SUPPLY, "motor_voltage": {"servo": {}}}, "no effect: .* in place of the loop"),
    "a supply of a cord": ({"supply_voltage": {"flexor": {}}}, r"supply_voltage\.flexor: no such motor"),
    "a voltage beyond the supply": ({"motor_voltage": {"servo": {"offset": 6.0}}}, r"reaches 6 V, beyond the supply"),
    "an angle and a voltage": (
        {"motor_voltage": {"servo": {}}, "spool_angle": {"servo": TURN}},
        "two sources.*spool_angle.servo turns the same",
    ),
    "a voltage of a cord": ({"motor_voltage": {"flexor": {}}}, r"no such motor"),
    "a variable's name": ({"motor_position": {"servo": TURN}}, r"did you mean controller\.spool_angle\?"),
    "a tension": (
        {"tensions": {"flexor": TURN}},
        r"wind it by controller\.spool_angle\.servo \(rad\) or controller\.tendon",
    ),
    "an input": ({"inputs": {"servo": TURN}}, r"give controller\.spool_angle\.servo"),
    "the tendon's angle": (
        {"spool_angle": {"flexor": TURN}},
        r"no such motor.*give controller\.tendon_winding\.flexor",
    ),
    "the motor's length": (
        {"tendon_winding": {"servo": LENGTH}},
        r"no such actuated.*give controller\.spool_angle\.servo",
    ),
    "millimetres": ({"tendon_winding": {"flexor": {**LENGTH, "height": 10.0}}}, "is it in millimetres"),
    "both": ({"tendon_winding": {"flexor": LENGTH}, "spool_angle": {"servo": TURN}}, "two sources.*same spool"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wound_otherwise_is_refused_by_the_name_of_the_right_entry(case):
    given, message = WRONG[case]
    with pytest.raises(InputError, match=message):
        scenario(given, SERVO)


def test_a_winch_is_refused_beside_a_motor_a_closed_loop_and_tensions():
    with pytest.raises(InputError, match=r"finger\.tendons\.flexor\.winch.*servo pulls it"):
        scenario({}, SERVO, {"finger.tendons.flexor.winch.stiffness": RIGIDITY})
    with pytest.raises(InputError, match=r"kind.*ideal winches wind flexor in open loop"):
        scenario({"kind": "proportional", "tendon_winding": {"flexor": LENGTH}, "spring_compensation": True})
    with pytest.raises(InputError, match=r"a winch holds its length; wind it by controller\.tendon_winding\.flexor"):
        scenario({"tendon_winding": {"flexor": LENGTH}, "tensions": {"flexor": {}}})
    servo = {**SERVO, "drive": "tension"}
    servo.pop("position_loop")
    with pytest.raises(InputError, match='must have drive = "position"'):
        scenario({"spool_angle": {"servo": TURN}}, servo)
    with pytest.raises(InputError, match=r'supply_voltage\.servo: .* must have drive = "position"'):
        scenario(SUPPLY, servo)
