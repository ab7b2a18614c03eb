"""Joint reaction (17) with and without external force, against vector norms written out."""

import math

import numpy as np
import pytest
from exerted import pin_forces

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.mechanism.joints import JointFriction

COULOMB, STICTION, STIFFNESS, VISCOUS, STRIBECK, FLOOR = 2.5e-4, 3.5e-4, 5.0, 1e-3, 0.1, 1e-7


def directions(theta):
    """e_1 is the base's x axis; e_2, e_3, e_4 run along links 1, 2, 3."""
    t1, t2, t23 = theta[0], theta[1], theta[1] + theta[2]
    return [
        (1.0, 0.0, 0.0),
        (math.cos(t1), math.sin(t1), 0.0),
        (math.cos(t1) * math.cos(t2), math.sin(t1) * math.cos(t2), math.sin(t2)),
        (math.cos(t1) * math.cos(t23), math.sin(t1) * math.cos(t23), math.sin(t23)),
    ]


def loads(strands):
    f1, f2, f3, f4, f53, f54 = strands
    return [f1 + f2 + f3 + f4, f1 + f2 + f3 + f4, f3 + f4 + f53, f4 + f54]


@pytest.fixture(scope="module")
def joints(ub, routing):
    return JointFriction(ub, routing)


def test_links_point_where_table_i_turns_them(finger):
    draw = np.random.default_rng(9)
    for theta in draw.uniform(-1.5, 1.5, (20, 4)):
        np.testing.assert_allclose(finger.rigid_body.link_directions(theta), directions(theta), atol=1e-13)


def test_without_external_force_the_reaction_is_the_sum_of_the_crossing_tensions(joints):
    strands = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    forces = pin_forces(joints, np.zeros(4), np.zeros(4), strands)
    np.testing.assert_allclose(forces.normal_force, [15.0, 15.0, 28.0, 40.0], rtol=1e-14)


def test_reaction_is_the_norm_of_tendon_pull_and_external_force_at_random_postures(finger):
    draw = np.random.default_rng(10)
    for _ in range(100):
        theta, force = draw.uniform(-1.0, 1.5, 4), draw.normal(0.0, 3.0, 3)
        x = finger.rest_state(theta)
        command = draw.uniform(0.0, 5.0, 4)
        signals = finger.evaluate(x, command, force)
        tension = max(0.0, 5e4 * (3.5e-3 * theta[2] - 5e-3 * theta[3]))
        expected = []
        for e, load in zip(directions(theta), loads([*command, tension, tension]), strict=True):
            expected.append(math.sqrt(sum((f - c * load) ** 2 for c, f in zip(e, force, strict=True))))
        np.testing.assert_allclose(signals["joint_reaction"], expected, rtol=1e-9)


def test_joint_friction_is_law_9_loaded_by_the_reaction(joints):
    draw = np.random.default_rng(11)
    for _ in range(50):
        velocity, stiction = draw.normal(0.0, 0.5, 4), draw.normal(0.0, 2e-3, 4)
        strands = draw.uniform(0.0, 5.0, 6)
        forces = pin_forces(joints, velocity, stiction, strands)
        for j, load in enumerate(loads(strands)):
            v, s = float(velocity[j]), float(stiction[j])
            level = max(load * (COULOMB + (STICTION - COULOMB) * math.exp(-abs(v) / STRIBECK)), FLOOR)
            assert forces.level[j] == pytest.approx(level, rel=1e-12)
            assert forces.friction[j] == pytest.approx(s + VISCOUS * v, rel=1e-12)
            assert forces.rate[j] == pytest.approx(STIFFNESS * (v - s * abs(v) / level), rel=1e-10)


def test_an_unloaded_joint_slides_at_the_floor(joints):
    forces = pin_forces(joints, np.ones(4), np.full(4, FLOOR), np.zeros(6))
    np.testing.assert_array_equal(forces.level, FLOOR)
    np.testing.assert_allclose(forces.rate, 0.0, atol=1e-12)


def test_coefficients_can_differ_from_joint_to_joint(routing):
    coulomb, stiction = (1e-4, 2e-4, 3e-4, 4e-4), (1e-4, 3e-4, 5e-4, 7e-4)
    description = fp.load_finger(
        "ub_stand_in",
        {"finger.joint_friction.coulomb": list(coulomb), "finger.joint_friction.stiction": list(stiction)},
    )
    joints = JointFriction(description, routing)
    strands = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    forces = pin_forces(joints, np.zeros(4), np.zeros(4), strands)
    np.testing.assert_allclose(forces.level, np.array(stiction) * [15.0, 15.0, 28.0, 40.0], rtol=1e-12)


def test_a_joint_without_a_bearing_does_not_slow_down():
    cart = {"mass": 0.1, "inertia": [1e-5, 1e-5, 1e-5, 0.0, 0.0, 0.0]}
    rail = {"body": "cart", "kind": "slide", "axis": [1.0, 0.0, 0.0], "bearing": False}
    tree = {
        "bodies": {"cart": cart, "arm": cart | {"parent": "cart"}},
        "joints": {"rail": rail, "pin": {"body": "arm"}},
    }
    tree |= {"tip": {"body": "arm"}, "actuators": {"push": {"joint": "rail", "gain": 1.0}}}
    table = {"name": "cart", "gravity": [0.0, 0.0, 0.0], "tendons": {}, "tree": tree}
    table["joints"] = {"rail": {"range": [-1.0, 1.0]}, "pin": {"range": [-1.0, 1.0]}}
    finger = fp.Finger(read_scenario({"name": "cart", "finger": table, "controller": {"kind": "tensions"}}).finger)
    moving = finger.evaluate(finger.rest_state(np.zeros(2), np.array([0.3, 0.0])), np.zeros(1))
    assert moving["joint_acceleration"] == pytest.approx([0.0, 0.0], abs=1e-12)
