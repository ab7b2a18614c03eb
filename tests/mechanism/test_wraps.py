"""Tendons that rub where they bend: the capstan law, an integration of the equations alone, and the lumped law."""

from itertools import pairwise

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import scipy

import finger_pin as fp
from finger_pin.analysis import Friction
from finger_pin.analysis.locking_loop import FrictionLoop
from finger_pin.description.loading import read_scenario

RADIUS, STIFFNESS = np.array([0.010, 0.008, 0.006]), np.array([0.30, 0.20, 0.10])
TURN, MU, DAMPING = np.deg2rad([30.0, 20.0, 15.0]), 0.3, 0.01
JOINTS, LENGTHS, MASSES = ("mcp", "pip", "dip"), (0.05, 0.035, 0.025), (0.015, 0.008, 0.004)
PLACE = {"finger.tendon_friction.place": "bends"}


def table(pull, joints=3, duration=8.0, **friction):
    """Return a planar finger, its springs, and one cord that bends at every joint."""
    chosen = range(joints)
    return {
        "name": "three",
        "finger": {
            "name": "three",
            "gravity": [0.0, 0.0, 0.0],
            "joints": {
                JOINTS[k]: {
                    "range": [-0.2, 1.6],
                    "spring": {"stiffness": STIFFNESS[k], "damping": DAMPING},
                    "link": {"length": LENGTHS[k], "width": 0.012, "mass": MASSES[k]},
                }
                for k in chosen
            },
            "tendons": {
                "flexor": {
                    "crossings": {
                        JOINTS[k]: {"radius": RADIUS[k], "bends": True, "curvature_offset": float(TURN[k])}
                        for k in chosen
                    }
                }
            },
            "tendon_friction": {"coulomb": MU, "stiction_ratio": 1.0, "stiffness": 5e4, "place": "bends"} | friction,
            "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0, "stiffness": 1e-3, "floor": 1e-12},
        },
        "controller": {"kind": "tensions", "minimum_tension": 0.0, "tensions": {"flexor": pull}},
        "simulation": {"duration": duration, "initial": {"position": dict.fromkeys(JOINTS[:joints], 0.0)}},
    }


def points(*pairs):
    return {"kind": "points", "times": [t for t, _ in pairs], "values": [f for _, f in pairs]}


HELD = {"offset": 4.0}


@pytest.fixture(scope="module")
def drawn_in():
    return fp.simulate(read_scenario(table(points((0.0, 0.0), (7.0, 12.0)))))


def test_what_reaches_a_joint_is_what_the_joints_before_have_left(drawn_in):
    """Drawn in: T_i = T_(i-1) exp(-mu (phi_i + theta_i)), theta_i = r_i T_i / k_i. Bristles bend for 3 % of the way."""
    angle = np.zeros(3)
    for _ in range(100):
        tension = 12.0 * np.exp(-MU * np.cumsum(TURN + angle))
        angle = RADIUS * tension / STIFFNESS
    assert drawn_in.joint_position.values[-1] == pytest.approx(angle, rel=0.025)
    assert drawn_in.wrap_tension.values[-1] == pytest.approx(tension, rel=0.025)
    assert drawn_in["wrap"].values.tolist() == [f"flexor.{name}" for name in JOINTS]
    assert drawn_in.tendon_tension.values[-1, 0] == drawn_in.wrap_tension.values[-1, -1]


def test_the_whole_friction_is_the_sum_and_the_torque_that_of_each_tension(drawn_in):
    r = drawn_in
    assert r.tendon_friction.values[:, 0] == pytest.approx(r.wrap_friction.values.sum(axis=1), abs=1e-12)
    assert r.tendon_curvature.values[:, 0] == pytest.approx(r.wrap_curvature.values.sum(axis=1), abs=1e-12)
    assert r.joint_torque.values == pytest.approx(RADIUS * r.wrap_tension.values, abs=1e-12)
    assert abs(r.energy_residual).max() < 1e-6


def test_only_joints_beyond_a_bend_move_the_cord_past_it(drawn_in):
    moved = np.cumsum((RADIUS * drawn_in.joint_velocity.values)[:, ::-1], axis=1)[:, ::-1]
    assert drawn_in.wrap_velocity.values == pytest.approx(moved, abs=1e-12)


def equations(scenario, pull):
    """Return the rate of (theta, theta', F^s of every wrap) by the equations alone."""
    body = fp.Finger(scenario.finger).rigid_body.model
    data = body.createData()
    law = scenario.finger.tendon_friction
    sigma, viscous = law.stiffness / 3.0, law.viscous / 3.0

    def rate(time, y):
        theta, speed, bristle = np.split(y, 3)
        tension, torque, bent = pull(time), -STIFFNESS * theta - DAMPING * speed, np.zeros(3)
        for k in range(3):
            v = RADIUS[k:] @ speed[k:]
            left = tension - bristle[k] - viscous * v
            level = np.tanh(0.5 * MU * (TURN[k] + abs(theta[k]))) * (abs(tension) + abs(max(left, 0.0)))
            bent[k] = sigma * (v - bristle[k] * abs(v) / max(level, law.floor))
            tension = max(left, 0.0)
            torque[k] += RADIUS[k] * tension
        return np.concatenate([speed, pin.aba(body, data, theta, speed, torque), bent])

    return rate


@pytest.mark.slow
def test_a_motion_with_reversals_is_that_of_the_equations_alone():
    times = np.array([0.0, 0.3, 0.5, 0.8])
    values = np.array([2.0, 8.0, 5.0, 9.0])
    scenario = read_scenario(
        table({"kind": "points", "times": times.tolist(), "values": values.tolist()}, duration=0.8),
        {"simulation.rtol": 1e-8, "simulation.atol_scale": 1e-8},
    )
    found = fp.simulate(scenario)
    # From point to point without a bend or a kink: 10 u^3 - 15 u^4 + 6 u^5.
    rest = np.zeros(len(times))
    pull = scipy.interpolate.BPoly.from_derivatives(times, np.column_stack([values, rest, rest]))
    y = np.zeros(9)
    rate = equations(scenario, lambda t: float(pull(t)))
    for begin, end in pairwise(times):
        y = scipy.integrate.solve_ivp(rate, (begin, end), y, method="LSODA", rtol=1e-10, atol=1e-12).y[:, -1]
        at = int(np.argmin(np.abs(found.time.values - end)))
        assert found.joint_position.values[at] == pytest.approx(y[:3], abs=1e-5)
        assert found.wrap_friction.values[at] == pytest.approx(y[6:], abs=5e-3)
    assert np.ptp(found.wrap_velocity.values, axis=0).min() > 1e-3


def test_over_one_joint_it_is_the_lumped_law():
    one, lumped = (
        fp.simulate(
            read_scenario(table(points((0.0, 1.0), (0.2, 6.0)), 1, 0.2), {"finger.tendon_friction.place": place})
        )
        for place in ("bends", "canal")
    )
    for name in ("joint_position", "tendon_friction", "tendon_tension", "tendon_curvature"):
        assert np.array_equal(one[name].values, lumped[name].values)
    assert "wrap_tension" not in one


def test_readable_and_compiled_evaluation_agree_also_for_a_servo():
    servo = {"motor": "XL330-M288", "tendons": ["flexor"], "spool_radius": 0.005, "drive": "tension"}
    for more in ({}, {"finger.actuators": {"servo": servo}}):
        scenario = read_scenario(table(points((0.0, 1.0), (0.1, 6.0)), 3, 0.1), more)
        finger, rng = fp.Finger(scenario.finger), np.random.default_rng(3)
        x = finger.rest_state(np.array([0.3, 0.4, 0.5])) + 1e-3 * rng.normal(size=finger.layout.size)
        inputs = np.full(finger.mechanism.channels, 4.0)
        found = fp.Simulator(finger).loop.dynamics.evaluate(x, inputs)
        expected = finger.evaluate(x, inputs)
        assert np.allclose(found.rate, expected.rate, rtol=1e-9, atol=1e-9)
        for name in finger.signal_table:
            if name != "joint_acceleration":
                assert np.allclose(found[name], expected[name], rtol=1e-9), name
        assert expected["joint_torque"] == pytest.approx(RADIUS * expected["wrap_tension"])


def test_reactions_at_the_pins_count_the_tension_that_is_left(drawn_in):
    """(17): with one cord along the links and no force at the tip R_j is the tension behind the bend at joint j."""
    assert drawn_in.joint_reaction.values[-1] == pytest.approx(drawn_in.wrap_tension.values[-1], rel=1e-9)


def test_a_run_goes_on_from_its_result_as_if_it_had_not_stopped():
    whole = fp.simulate(read_scenario(table(HELD, 3, 0.1)))
    first = fp.simulate(read_scenario(table(HELD, 3, 0.05)))
    rest = fp.simulate(read_scenario(table(HELD, 3, 0.05)), initial=first)
    assert rest.joint_position.values[-1] == pytest.approx(whole.joint_position.values[-1], abs=1e-5)


def test_offsets_of_a_tendon_are_shared_by_its_bends():
    given = table(HELD)
    crossings = given["finger"]["tendons"]["flexor"]["crossings"]
    for each in crossings.values():
        del each["curvature_offset"]
    crossings["pip"] |= {"bends": False}
    given["finger"]["tendons"]["flexor"]["curvature_offset"] = 1.0
    finger = fp.Finger(read_scenario(given).finger)
    assert [(wrap.name, wrap.offset, wrap.share) for wrap in finger.tendons.wraps[0]] == [
        ("mcp", 0.5, 0.5),
        ("dip", 0.5, 0.5),
    ]


@pytest.mark.parametrize("moving", [1, 2])
@pytest.mark.parametrize("tail", [{"bends": False, "curvature_offset": 1.0}, {"bends": True, "curvature_offset": 0.2}])
def test_a_bend_behind_the_last_joint_that_moves_the_cord_takes_nothing(moving, tail):
    """No cord slides past it: runs and statics are those without it, also at a joint that is turned."""
    given = table(points((0.0, 1.0), (0.1, 6.0)), moving + 1, 0.1)
    given["simulation"]["initial"]["position"][JOINTS[moving]] = 0.8
    crossings, found = given["finger"]["tendons"]["flexor"]["crossings"], []
    for last in (tail, {"bends": False}):
        crossings[JOINTS[moving]] = {"radius": 0.0} | last
        scenario = read_scenario(given)
        finger, theta = fp.Finger(scenario.finger), np.full(moving + 1, 0.4)
        statics = finger.tendons.in_sliding(theta, np.ones(1))[0][0]
        assert statics[:moving] == pytest.approx(np.exp(-MU * np.cumsum(TURN[:moving] + 0.4)), rel=1e-12)
        found.append(fp.simulate(scenario))
    for name in ("joint_position", "tendon_friction", "tendon_tension", "tendon_curvature"):
        assert np.array_equal(found[0][name].values, found[1][name].values)


STRING = """
<mujoco><option gravity="0 0 0"/><worldbody>
<site name="s0" pos="-0.02 0 0.01"/>
<body name="a"><joint name="a" axis="0 -1 0" range="-1.5 1.5" damping="0.01" stiffness="0.4"/>
<geom type="capsule" size="0.004" fromto="0 0 0 0.04 0 0" mass="0.02"/>
<site name="s1" pos="0.01 0 0.01"/><site name="s2" pos="0.03 0 0.01"/>
<body name="b" pos="0.04 0 0"><joint name="b" axis="0 -1 0" range="-1.5 1.5" damping="0.01" stiffness="0.3"/>
<geom type="capsule" size="0.004" fromto="0 0 0 0.03 0 0" mass="0.01"/>
<site name="s3" pos="0.01 0 0.01"/><site name="s4" pos="0.025 0 0.004"/></body></body></worldbody>
<tendon><spatial name="cord"><site site="s0"/><site site="s1"/><site site="s2"/><site site="s3"/><site site="s4"/>
</spatial></tendon>
<actuator><motor name="pull" tendon="cord" gear="-1" ctrlrange="0 50"/></actuator></mujoco>
"""


def test_a_routed_tendon_rubs_at_every_bend_of_its_path():
    """T behind a bend is T before times exp(-mu turn), drawn in; the turns are those of the model's points."""
    description = fp.from_mujoco(mujoco.MjSpec.from_string(STRING))
    law = {"coulomb": 0.4, "stiction_ratio": 1.0, "viscous": 0.0, "place": "bends"}
    finger = fp.Finger(description.updated(tendon_friction=law))
    simulator = fp.Simulator(finger, position=[0.0, 0.0])
    for k in range(400):
        simulator.step([0.02 * (k + 1)], 5e-3)
    found = simulator.signals()
    model = pin_points(simulator.state.position)
    turns = [np.arccos(np.clip(a @ b, -1.0, 1.0)) for a, b in pairwise(model)]
    # No bend before s1; those at s1 and s2 slide alike, as the stretch between keeps its length; none beyond slides.
    expected = [0.0, turns[0] + turns[1]]
    assert found["wrap_curvature"] == pytest.approx(expected, abs=1e-9)
    left = 8.0 * np.exp(-0.4 * np.cumsum(expected))
    assert found["wrap_tension"] == pytest.approx(left, rel=0.02)


def pin_points(position):
    """Return the unit directions of the stretches between the sites of the model, in the plane."""
    a, b = position

    def turned(angle, x, z):
        return np.array([np.cos(angle) * x - np.sin(angle) * z, np.sin(angle) * x + np.cos(angle) * z])

    elbow = turned(a, 0.04, 0.0)
    points = [np.array([-0.02, 0.01]), turned(a, 0.01, 0.01), turned(a, 0.03, 0.01)]
    points += [elbow + turned(a + b, 0.01, 0.01), elbow + turned(a + b, 0.025, 0.004)]
    return [(q - p) / np.linalg.norm(q - p) for p, q in pairwise(points)]


def antagonists(place):
    """Return a planar finger of two joints and three cords, without friction of joints."""
    given = table(HELD, 2)["finger"]
    for each in given["joints"].values():
        del each["spring"]

    def cord(*radii):
        names = zip(JOINTS, radii, strict=False)
        return {"crossings": {name: {"radius": r, "bends": True, "curvature_offset": 0.3} for name, r in names}}

    given["tendons"] = {"flexor": cord(0.01, 0.008), "short": cord(-0.012, 0.004), "extensor": cord(-0.006, -0.009)}
    given["tendon_friction"]["place"] = place
    return fp.Finger(read_scenario({"name": "two", "finger": given}).finger)


def test_tensions_that_push_against_friction_give_the_torque_that_every_joint_gets():
    finger, theta, push = antagonists("bends"), np.array([0.4, 0.6]), np.array([0.0, 0.0, -3.0])
    found = fp.analysis.tension_for_force(finger, theta, push, minimum_tension=0.5, friction=Friction.HINDERING)
    at = np.exp(-MU * np.cumsum(0.3 + theta))
    torque = (at * finger.coupling).T @ found.command
    needed = finger.rigid_body.jacobian(theta).T @ push + finger.static_torque(theta)
    assert torque == pytest.approx(needed, abs=1e-6)
    assert found.strands == pytest.approx(at[-1] * found.command, rel=1e-6)


def test_the_critical_friction_is_that_of_the_tensions_at_every_joint():
    """Where the tensions that reach each joint turn it as much as they press its pin times kappa."""
    finger, theta = antagonists("bends"), np.array([0.4, 0.6])
    loop, sliding = FrictionLoop.from_tendons(finger.tendons, None), np.ones((1, 3))
    kappa, _, command = loop.critical(theta[None], np.array([[1.0, 1.0]]), sliding)
    at = np.exp(-MU * np.cumsum(0.3 + theta))
    tension = at * command[0][:, None]
    pull = np.sum(finger.coupling * tension, axis=0)
    load = np.sum(np.abs(np.sign(finger.coupling)) * tension, axis=0)
    assert pull == pytest.approx(kappa[0] * load, rel=1e-6)


def test_mujoco_is_refused_what_it_cannot_do():
    with pytest.raises(fp.InputError, match="one tension"):
        fp.to_mjcf(antagonists("bends").description, friction=True)
    with pytest.raises(fp.InputError, match="canal, bends"):
        read_scenario(table(HELD, place="bend"))


def test_fingers_of_a_hand_rub_at_the_same_kind_of_place():
    with pytest.raises(fp.InputError, match=r"^hand.fingers: must have one tendon_friction.place, not canal, bends$"):
        fp.load_scenario("hand", {"hand.fingers.index.finger.tendon_friction.place": "bends"})
