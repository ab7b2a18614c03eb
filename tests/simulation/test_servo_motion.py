"""Whole motions of servos against what is not ours: equations by hand in scipy, MuJoCo, conservation of energy."""

import numpy as np
import pytest
import tomli_w
from joined_mechanisms import join_mechanisms
from scipy.integrate import solve_ivp
from servo_cases import INERTIA, LINK, LINK_INERTIA, RADIUS, SMOOTH, SPOOL, finger, scenario, together

import finger_pin as fp
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control

K, D, G = 6000.0 / 0.3, 10.0, 9.81


def test_the_fitted_xl330_moves_a_pendulum_through_a_spool_as_scipy_has_it():
    """Rotor, gears with load and Stribeck level, elastic tendon and canal (16), written out; 1e-6 rad over a second."""
    xl330_inertia = 1.895e-3
    swing = {"offset": 5.8, "amplitude": 5.5, "frequency": 1.0}
    made = finger("XL330-M288", link={**LINK, "mass": 0.15}, gravity=G, canal=0.11)
    made = fp.Finger(made.description.updated(tendon_friction={"stiffness": 5e4}))
    weight, link_inertia = 0.15 * G * 0.03, 1e-5 + 0.15 * 0.03**2
    tensions = {"kind": "tensions", "tensions": {"flexor": swing}}
    result = fp.simulate(scenario(made, 1.0, controller=tensions))

    drag = np.tanh(0.11 * 1.0 / 2.0)
    canal, gears = {"s0": 5e4, "rho": 1.5, "w": 0.01}, {"s0": 50.0, "w": 2.558, "p": 0.76}

    def rates(t, x):
        q, v, theta, w, z, y = x
        wanted = 5.8 + 5.5 * np.sin(2.0 * np.pi * t)
        pull = max(0.0, K * (SPOOL * theta - RADIUS * q) + D * (SPOOL * w - RADIUS * v))
        delivered = max(0.0, pull - z)
        slide = RADIUS * v
        level = (delivered + pull) * drag * (1.0 + (canal["rho"] - 1.0) * np.exp(-abs(slide) / canal["w"]))
        torque, load = SPOOL * wanted, abs(SPOOL * wanted + SPOOL * pull)
        # |w|^p smoothed at rest, as the law says.
        power = ((w / gears["w"]) ** 2 + 1e-8) ** (gears["p"] / 2.0) - 1e-4 ** gears["p"]
        friction = 8.76e-3 + 0.0680 * load + 0.0738 * load * np.exp(-power)
        return [
            v,
            (RADIUS * delivered - weight * np.cos(q)) / link_inertia,
            w,
            (torque - y - 4.62e-3 * w - SPOOL * pull) / xl330_inertia,
            canal["s0"] * (slide - z * abs(slide) / max(level, 1e-9)),
            gears["s0"] * (w - y * abs(w) / friction),
        ]

    start = [0.0, 0.0, 5.8 / K / SPOOL, 0.0, 0.0, 0.0]
    times = result["time"].values[::50]
    exact = solve_ivp(rates, (0.0, 1.0), start, method="LSODA", t_eval=times, rtol=1e-9, atol=1e-12)
    assert exact.success and np.ptp(exact.y[0]) > 0.1
    np.testing.assert_allclose(result["joint_position"].values[::50, 0], exact.y[0], atol=1e-6)
    np.testing.assert_allclose(result["motor_position"].values[::50, 0], exact.y[2], atol=1e-6)


def test_mujoco_agrees_on_a_position_drive_without_friction_to_first_order_in_its_step():
    mujoco = pytest.importorskip("mujoco")
    period, gain, duration = 2e-3, 5.0, 0.3
    loop = {"period": period, "proportional": gain, "derivative": 0.02, "integral": 10.0}
    made = finger(SMOOTH, gravity=G, drive="position", position_loop=loop)
    reference = {"joints": {"knuckle": {"offset": 0.2, "amplitude": 0.2, "frequency": 2.0}}}
    result = fp.simulate(scenario(made, duration, reference=reference))
    text = f"""<mujoco><compiler angle="radian"/><option gravity="0 {-G} 0" integrator="Euler"/>
      <worldbody>
        <body><joint name="knuckle" axis="0 0 1"/>
          <inertial pos="0.03 0 0" mass="0.02" diaginertia="1e-5 1e-5 1e-5"/></body>
        <body pos="0 1 0"><joint name="rotor" axis="0 0 1" ref="50" armature="{INERTIA - 1e-9}"/>
          <inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/></body>
      </worldbody>
      <tendon><fixed name="flexor" stiffness="{K}" damping="{D}" springlength="{50.0 * SPOOL}">
        <joint joint="rotor" coef="{SPOOL}"/><joint joint="knuckle" coef="{-RADIUS}"/></fixed></tendon>
      <actuator><general joint="rotor" gaintype="fixed" biastype="affine" gainprm="{0.4 / 3.0}"
        biasprm="0 0 {-(0.4**2) / 3.0}"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    errors = []
    for steps in (40, 80, 160):
        model.opt.timestep = period / steps
        data = mujoco.MjData(model)
        data.qpos[:] = 0.2, 50.0 + (RADIUS * 0.2 + 0.7 / K) / SPOOL
        summed, last = 0.0, None
        for sample in range(round(duration / period)):
            wanted = 0.2 + 0.2 * np.sin(4.0 * np.pi * sample * period)
            error = (RADIUS * wanted + 0.7 / K) / SPOOL - (data.qpos[1] - 50.0)
            summed += error * period
            rate = 0.0 if last is None else (error - last) / period
            last = error
            data.ctrl[0] = 5.0 * np.clip(gain * error + 0.02 * rate + 10.0 * summed, -1.0, 1.0)
            mujoco.mj_step(model, data, steps)
        found = np.array([data.qpos[0], data.qpos[1] - 50.0])
        ours = [float(result[name][-1, 0]) for name in ("joint_position", "motor_position")]
        errors.append(np.abs(found - ours))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(errors[-1] < 1e-4) and np.all((ratios > 1.8) & (ratios < 2.2)), (errors, ratios)


@pytest.mark.parametrize("name", ["servo", "servo_position"])
def test_electrical_and_mechanical_energy_close_to_a_millionth_of_what_was_supplied(name):
    result = fp.simulate(fp.load_scenario(name, {"simulation.duration": 0.4}))
    supplied = float(np.abs(result["energy_exchanged_electrical"]).max())
    assert supplied > 1e-3
    assert float(np.abs(result["energy_residual"]).max()) < 1e-6 * supplied
    # The motor's own: U i = R i^2 + tau theta_m'.
    terminals = (result.motor_voltage * result.motor_current).sum("motor")
    mechanical = (result.motor_torque * result.motor_velocity).sum("motor")
    np.testing.assert_allclose(terminals, result.power_motor_heat + mechanical, atol=1e-12)
    np.testing.assert_allclose(terminals, result.power_electrical, atol=1e-12)


def test_what_a_position_drive_holds_is_in_the_result():
    """The voltage of the k-th sample is V clip(k_p e), with the angle measured in steps, until the next one."""
    result = fp.simulate(
        fp.load_scenario("servo_position", {"simulation.duration": 0.02, "simulation.sample_rate": 2e3})
    )
    step, gain = 2.0 * np.pi / 4096, 9.2
    finger, wanted = fp.Finger(fp.load_scenario("servo_position").finger), result.joint_reference.values
    goal = finger.actuators.angle(wanted, result.tendon_command.values[:, :4])
    measured = np.round(result.motor_position.values / step) * step
    held = 5.0 * np.clip(gain * (goal - measured), -1.0, 1.0)
    # Two samples of the result to one of the drive, the last of which is taken at the very end.
    np.testing.assert_allclose(result.motor_voltage.values[::2], held[::2], atol=1e-9)
    np.testing.assert_allclose(result.motor_voltage.values[1::2], held[:-1:2], atol=1e-9)
    assert np.ptp(held) > 0.0


def test_a_simulator_records_the_voltages_that_it_was_told_of_either_sign():
    sim = fp.Simulator(finger(SMOOTH, drive="position"), [0.1])
    told = np.array([2.0, -3.0, -1.0, 4.0])
    for voltage in told:
        sim.step([voltage], 5e-3)
    result = sim.result(sample_rate=200.0)
    # Of a motor's speed and current its voltage is known but for rounding.
    np.testing.assert_allclose(result.motor_voltage.values[:-1, 0], told, rtol=1e-12)
    assert not result.tendon_command.values.any() and not result.joint_torque_command.values.any()
    supplied = float(np.abs(result["energy_exchanged_electrical"]).max())
    assert float(np.abs(result["energy_residual"]).max()) < 1e-5 * supplied


def test_a_start_at_which_a_motor_would_leave_its_supply_is_refused():
    """At its limit of 1.5 A a motor of 5 V, 3 Ohm and 0.4 N m/A induces 9.5 V at most: 23.75 rad/s."""
    made = finger(SMOOTH, drive="position")
    x = made.rest_state([0.0])
    short, sim = scenario(made, 0.005), fp.Simulator(made)
    for speed, refused in ((23.7, False), (-23.8, True)):
        made.layout.unpack(x).motor_velocity[:] = speed
        if refused:
            with pytest.raises(fp.InputError, match=r"motor servo must turn by at most 23.75 rad/s"):
                fp.simulate(short, initial=x)
            with pytest.raises(fp.InputError, match=r"x = -23.8: motor servo must turn by at most 23.75 rad/s"):
                sim.x = x
            with pytest.raises(fp.InputError, match=r"motor servo must turn by at most 23.75 rad/s"):
                sim.reset(x)
            assert made.layout.unpack(sim.x).motor_velocity[0] == 23.7
        else:
            sim.x = x
            assert float(abs(fp.simulate(short, initial=x).motor_voltage).max()) <= 5.0 * (1.0 + 1e-9)


def test_a_result_of_servos_is_continued_where_it_ended():
    whole = fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.06}))
    first = fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.03}))
    rest = {"simulation.duration": 0.03, "simulation.start_time": 0.03}
    second = fp.simulate(fp.load_scenario("servo", rest), initial=first)
    for name in ("joint_position", "motor_position", "gearbox_stiction"):
        np.testing.assert_allclose(second[name][-1], whole[name][-1], atol=1e-5)


def test_a_spool_of_two_tendons_works_beside_sampled_tensions_and_closes_the_account():
    both = {"motor": "STS3215", "tendons": ["T1", "T4"], "spool_radius": [0.006, 0.005], "drive": "position"}
    actuators = {"M": {**both, "pretension": [3.0, 3.0]}}
    overrides = {"finger.actuators": actuators, "simulation.duration": 0.1, "controller.sampling.period": 1.5e-3}
    result = fp.simulate(fp.load_scenario("reversals", overrides))
    assert np.all(np.ptp(result.spool_tension.values, axis=0) > 0.0) and float(result.spool_tension.min()) > 0.0
    assert np.ptp(result.motor_voltage.values) > 0.0
    # T2 has an ideal source, whose sampled tension goes right into the canal.
    np.testing.assert_array_equal(result.spool_tension.sel(tendon="T2"), result.tendon_command.sel(tendon="T2"))
    exchanged = sum(float(abs(result[name]).max()) for name in result if str(name).startswith("energy_exchanged"))
    assert float(abs(result.energy_residual).max()) < 1e-6 * exchanged


def test_cords_of_one_motor_are_wound_in_together_or_paid_out_each_by_its_radius():
    """At a spool angle phi a cord of radius r on a pulley R turns a spring k by K R (e0 + r phi) / (k + K R^2)."""
    pulley, spool = np.array([0.010, 0.008, 0.006]), np.array([0.005, 0.004, 0.003])
    wound = {"spool_radius": spool.tolist(), "winds": ["in", "in", "out"], "pretension": [0.0, 0.0, 60.0]}
    made = together(SMOOTH, pulley, drive="position", **wound)
    turn = {"kind": "ramp", "time": 0.0, "duration": 0.2, "height": 0.4}
    result = fp.simulate(scenario(made, 2.0, reference={"joints": {"a": turn, "b": turn}}))
    phi, ways = float(result.motor_position[-1, 0]), np.array([1.0, 1.0, -1.0])
    expected = K * pulley * ([0.0, 0.0, 60.0 / K] + ways * spool * phi) / (0.2 + K * pulley**2)
    assert phi > 0.3 and expected.min() > 0.05
    np.testing.assert_allclose(result.joint_position[-1], expected, atol=1e-5)
    supplied = float(abs(result.energy_exchanged_electrical).max())
    assert float(abs(result.energy_residual).max()) < 1e-6 * supplied


def test_a_servo_that_is_let_go_carries_no_current_and_is_turned_back_through_its_gears():
    """From 0.3 s on J m'' = -b m' - r f alone, continued by scipy from there; U is what the motor induces."""
    viscous, stiff, damped, pulley = 2e-3, 0.2, 0.02, 0.01
    motor = {**SMOOTH, "friction": {"coulomb": 0.0, "viscous": viscous}}
    loop = {"proportional": 9.2, "torque_off": 0.3}
    made = together(motor, [pulley], spool_radius=SPOOL, drive="position", position_loop=loop)
    turn = {"kind": "ramp", "time": 0.0, "duration": 0.2, "height": 0.4}
    result = fp.simulate(scenario(made, 0.6, reference={"joints": {"a": turn}})).sel(time=slice(0.3 - 1e-9, None))

    def rate(_, x):
        q, m, dq, dm = x
        pull = max(0.0, K * (SPOOL * m - pulley * q) + D * (SPOOL * dm - pulley * dq))
        turned = (pulley * pull - stiff * q - damped * dq) / LINK_INERTIA
        return [dq, dm, turned, (-viscous * dm - SPOOL * pull) / INERTIA]

    names = ("joint_position", "motor_position", "joint_velocity", "motor_velocity")
    found, times = np.array([result[name].values[:, 0] for name in names]), result.time.values
    exact = solve_ivp(rate, times[[0, -1]], found[:, 0], "Radau", times, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found[:2], exact.y[:2], atol=1e-6)
    assert found[1, 0] > 0.5 and found[1, -1] < 0.4
    np.testing.assert_array_equal(result.motor_current, 0.0)
    np.testing.assert_allclose(result.motor_voltage, 0.4 * result.motor_velocity, rtol=1e-12)
    supplied = float(abs(result.energy_exchanged_electrical).max())
    assert float(abs(result.energy_residual).max()) < 1e-6 * supplied


def test_hands_of_servos_fall_into_islands_that_move_as_each_does_alone():
    """The second tendon of a spool has an input that goes nowhere, the last one of all among them."""
    made = [finger(SMOOTH, opposed=True, drive="position", pretension=3.0, tendon_damping=each) for each in (5.0, 20.0)]
    whole = join_mechanisms({"left": made[0].mechanism, "right": made[1].mechanism})

    def stepper(mechanism, starts):
        q, v, z = zip(*(part.split(start) for part, start in starts), strict=True)
        # Joints of all, then lumps of all, in positions and velocities; then all states.
        moving = [each[part] for kind in (q, v) for part in (slice(1), slice(1, None)) for each in kind]
        x, control = np.concatenate([*moving, *z]), held_control(mechanism.channels, mechanism.coordinates)
        return Stepper(mechanism, control, x, TABLEAUS["Rodas5P"](), 1e-9, 1e-9 * np.ones(len(x)))

    starts = [(each.mechanism, each.rest_state(np.zeros(1))) for each in made]
    together, alone = stepper(whole, starts), [stepper(part, [(part, start)]) for part, start in starts]
    together.hold(np.array([1.0, 0.0, -2.0, 0.0]))
    assert len(together.parts) == 2 and not together.advance(0.05)
    for index, (each, voltage) in enumerate(zip(alone, (1.0, -2.0), strict=True)):
        each.hold(np.array([voltage, 0.0]))
        assert not each.advance(0.05)
        np.testing.assert_array_equal(together.x[[index, 2 + index]], each.x[:2])


@pytest.mark.parametrize(
    "controller", [{}, {"sampling.period": 1e-3}, {"sampling.period": 1e-3, "passive_tension_loop": {}}]
)
def test_servos_start_with_their_tendons_stretched_by_what_is_commanded_there(controller):
    """At rest on the reference, (22) plans f0 times the ratio of the internal tensions."""
    settings = {f"controller.{key}": value for key, value in controller.items()} | {"controller.damping": 0.0}
    result = fp.simulate(fp.load_scenario("servo", {"simulation.duration": 0.002, **settings}))
    internal = fp.Finger("ub_stand_in").routing.force_closure().tension[:4]
    np.testing.assert_allclose(result.spool_tension.values[0, :4], internal / internal.min(), rtol=1e-6)


def test_fingers_of_a_hand_hold_their_spools_each_as_it_does_alone(tmp_path):
    """Islands with loops of their own: the first finger of the two moves as `servo_position`."""
    alone = fp.load_scenario("servo_position", {"simulation.duration": 0.03})
    text = tomli_w.dumps(
        {
            "hand": {
                "name": "two",
                "palm": {"size": [0.08, 0.05, 0.02]},
                "fingers": {
                    name: {"finger": "./one.toml", "position": [0.0, y, 0.0]} for name, y in (("a", -0.03), ("b", 0.03))
                },
            },
            "reference": {"joints": {"a": alone.reference.model_dump(exclude_none=True)["joints"]}},
            "simulation": {"duration": 0.03},
        }
    )
    described = alone.finger.model_dump(mode="json", exclude_none=True)
    (tmp_path / "one.toml").write_text(tomli_w.dumps(described))
    (tmp_path / "two.toml").write_text(text)
    both, one = fp.simulate(fp.load_scenario(tmp_path / "two.toml")), fp.simulate(alone)
    for name, dimension in (("joint_position", "joint"), ("motor_voltage", "motor"), ("spool_tension", "tendon")):
        own = [f"a.{each}" for each in one[dimension].values]
        np.testing.assert_allclose(both[name].sel({dimension: own}), one[name], rtol=1e-7, atol=1e-9)
    assert np.ptp(one.motor_voltage.values) > 0.0 and np.ptp(both.motor_voltage.sel(motor="b.M3").values) > 0.0
