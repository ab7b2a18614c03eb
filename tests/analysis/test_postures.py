"""Postures that are looked for: that of a fingertip at a point, and that in which a finger rests."""

import mujoco
import numpy as np
import pytest
from closed_kinematics import equation_1
from scipy.optimize import nnls

import finger_pin as fp
from finger_pin.analysis import equilibrium, inverse_kinematics


def test_the_fingertip_is_put_to_points_of_equation_1_with_the_passive_tendon_slack():
    random, finger = np.random.default_rng(3), fp.Finger("ub_stand_in")
    for _ in range(20):
        t1, t2, t3 = random.uniform([-0.17, 0.05, 0.05], [0.17, 1.5, 1.5])
        found = inverse_kinematics(finger, equation_1([t1, t2, t3, 0.7 * t3]))
        assert found.reached
        np.testing.assert_allclose(equation_1(found.position), equation_1([t1, t2, t3, 0.7 * t3]), atol=1e-8)
        assert found.position[3] == pytest.approx(0.7 * found.position[2], abs=1e-12)


def test_of_two_postures_of_a_planar_finger_the_one_near_the_wanted_is_found_and_what_is_out_of_reach_is_told():
    finger = fp.Finger("planar")
    l1, l2 = (joint.link.length for joint in finger.description.joints.values())
    # The law of cosines: elbow bent by +-arccos.
    radius, bend = 0.8 * (l1 + l2), np.arccos((0.64 * (l1 + l2) ** 2 - l1**2 - l2**2) / (2.0 * l1 * l2))
    found = inverse_kinematics(finger, [radius * np.cos(0.9), radius * np.sin(0.9), 0.0], near=[0.4, 0.9])
    assert found.position[1] == pytest.approx(bend, abs=1e-6)
    assert found.position[0] == pytest.approx(0.9 - np.arctan2(l2 * np.sin(bend), l1 + l2 * np.cos(bend)), abs=1e-6)
    away = inverse_kinematics(finger, [2.0 * (l1 + l2) * np.cos(0.5), 2.0 * (l1 + l2) * np.sin(0.5), 0.0])
    assert not away.reached and away.distance == pytest.approx(l1 + l2, rel=1e-6)
    np.testing.assert_allclose(away.position, [0.5, 0.0], atol=1e-4)
    with pytest.raises(fp.InputError, match="point"):
        inverse_kinematics(finger, [0.1, 0.1])


def test_a_finger_rests_where_its_weight_balances_the_tensions_and_stays_there():
    """Two links in a vertical plane, weight towards y: the torques of their weights, written out."""
    up = fp.Finger(fp.load_finger("planar", {"finger.gravity": [0.0, 9.81, 0.0]}))
    (m1, l1), (m2, l2) = ((joint.link.mass, joint.link.length) for joint in up.description.joints.values())
    theta = np.array([0.5, 0.4])
    second = m2 * 9.81 * 0.5 * l2 * np.cos(theta.sum())
    weight = np.array([(0.5 * m1 + m2) * 9.81 * l1 * np.cos(theta[0]) + second, second])
    # Flexors and the extensor, radii in the file; least squares with tensions that pull.
    tension = nnls(np.array([[6e-3, 2e-3, -8e-3], [0.0, 5.5e-3, -5.5e-3]]), -weight)[0]
    found = equilibrium(up, tension, position=[0.9, 1.1])
    np.testing.assert_allclose(found.position, theta, atol=1e-7)
    np.testing.assert_allclose(found.torque, -weight, atol=1e-9)
    sim = fp.Simulator(up, position=found.position)
    sim.x = found.state
    for _ in range(50):
        state = sim.step(tension, 1e-3)
    np.testing.assert_allclose(state.position, theta, atol=1e-7)


@pytest.mark.slow
def test_a_finger_with_a_passive_tendon_rests_and_what_cannot_is_told():
    finger = fp.Finger("ub_stand_in")
    found = equilibrium(finger, [1.0, 1.0, 1.2, 0.3], position=[0.0, 0.8, 0.8, 0.5], fingertip_force=[0.0, 0.02, 0.0])
    rate = finger.rhs(0.0, found.state, np.array([1.0, 1.0, 1.2, 0.3]), np.array([0.0, 0.02, 0.0]))
    assert np.abs(rate).max() < 1e-5
    # Where nothing pulls either way it stays where it was.
    free = fp.Finger(fp.load_finger("ub_stand_in", {"finger.gravity": [0.0, 0.0, 0.0]}))
    np.testing.assert_allclose(equilibrium(free, np.zeros(4), position=[0.05, 0.5, 0.5, 0.35]).position[0], 0.05)
    # Without any tension it lies on its limiters, which are stiff; one strong flexor leaves its last links loose.
    for tension in np.zeros(4), np.full(4, 0.01), np.array([10.0, 0.0, 0.0, 0.0]):
        state = equilibrium(finger, tension).state
        assert np.abs(finger.rhs(0.0, state, tension)).max() < 1e-5
    with pytest.raises(fp.InputError, match="negative"):
        equilibrium(finger, [1.0, -1.0, 1.0, 1.0])
    with pytest.raises(fp.InputError, match=r"ideal sources .* it has actuators \(M1, M2, M3, M4\)"):
        equilibrium(fp.Finger(fp.load_scenario("servo").finger), np.ones(4))
    around = fp.load_scenario("grasp").environment.objects
    with pytest.raises(fp.InputError, match=r"^finger: .* it has free objects \(cylinder\)"):
        equilibrium(fp.Finger("planar", objects=around), np.ones(4))


@pytest.mark.parametrize("slew", [None, 1.2])
def test_actuators_with_a_lag_rest_where_their_settled_force_bends_the_spring(slew):
    """Whatever their slew, k theta = g u with u within its limits: 0.5 x 0.3 / 0.6, and 0.5 x 0.4 / 0.6 beyond them."""
    read = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body><joint name="hinge" axis="0 0 1" stiffness="0.6"/>
    <geom size="0.01" mass="0.1"/></body></worldbody><actuator><general name="late" joint="hinge" dyntype="filterexact"
    dynprm="0.1" gainprm="0.5" ctrllimited="true" ctrlrange="-0.4 0.4"/></actuator></mujoco>""")
    finger = fp.from_mujoco(read)
    actuators = {"late": finger.tree.actuators["late"].updated(slew=slew)}
    finger = finger.updated(tree=finger.tree.updated(actuators=actuators))
    for command, angle in ((0.3, 0.25), (-2.0, -1.0 / 3.0)):
        assert equilibrium(finger, {"late": command}).position[0] == pytest.approx(angle, abs=1e-9)
    summing = {"late": finger.tree.actuators["late"].updated(time_constant=0.0, slew=None, integrates=True)}
    with pytest.raises(fp.InputError, match=r"^finger\.tree\.actuators\.late: integrates"):
        equilibrium(finger.updated(tree=finger.tree.updated(actuators=summing)), {"late": 0.1})
