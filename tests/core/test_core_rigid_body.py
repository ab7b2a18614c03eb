"""The compiled rigid body against Pinocchio: chains and a tree, turning and sliding joints."""

import numpy as np
import pinocchio as pin
import pytest
from core_cases import BODIES, Bound, relative

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger, CompiledMechanism
from finger_pin.core.tables.inputs import held_control
from finger_pin.exceptions import InputError
from finger_pin.mechanism.mechanism import Mechanism

STATES = 200

#: A torque that is given.
TORQUE = fp.Law(
    "torque",
    (),
    lambda row, p: (row.command, 0.0 * row.length),
    lambda row, p, signals: ((0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    lambda row, p, force, rate, signals: (0.0 * force, force * row.speed),
    supplies=("motors",),
)


def driven(body):
    """A rigid body with a torque at every joint, and random states of it."""
    size, rng = body.model.nv, np.random.default_rng(1)
    names, numbers = tuple(body.joints), np.zeros((0, size))
    rows = fp.Rows("torques", TORQUE, names, numbers, np.eye(size), channels=np.arange(size))
    x = np.hstack([rng.uniform(-3.0, 3.0, (STATES, size)), 10.0 * rng.normal(size=(STATES, size))])
    return Mechanism(body, [rows]), x, 0.1 * rng.normal(size=(STATES, size))


@pytest.mark.parametrize("name", BODIES)
def test_accelerations_under_given_torques_are_pinocchio_s(bodies, name):
    """To rounding: mass matrices here have condition numbers up to about 1e3, which multiplies 2e-16 at most."""
    body = bodies[name].rigid_body
    mechanism, x, torque = driven(body)
    found, data = CompiledMechanism(mechanism).evaluate(x, torque).acceleration, body.model.createData()
    size = body.model.nv
    expected = [pin.aba(body.model, data, *each).copy() for each in zip(x[:, :size], x[:, size:], torque, strict=True)]
    assert relative(found, np.array(expected)) < 1e-12


@pytest.mark.parametrize("name", BODIES)
def test_derivatives_of_accelerations_are_pinocchio_s(bodies, name):
    """Out of the solutions of (g - J) u = r, whose inverse costs digits."""
    body = bodies[name].rigid_body
    mechanism, x, torque = driven(body)
    size, data = body.model.nv, body.model.createData()
    control = held_control(size, size)
    bound = Bound(mechanism, control)
    for each, given in zip(x[:40], torque, strict=False):
        control.tension[:] = given
        jacobian = 1e4 * np.eye(2 * size) - np.linalg.inv(bound.solve(0.0, each, 1e4)[1][:, :-1])
        by_position, by_velocity, _ = pin.computeABADerivatives(body.model, data, each[:size], each[size:], given)
        expected = np.hstack([by_position, by_velocity])
        np.testing.assert_allclose(jacobian[size:], expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", BODIES)
def test_fingertip_and_energies_are_pinocchio_s(bodies, name):
    finger = bodies[name]
    model, tip = finger.rigid_body.model, finger.rigid_body.tip_frame
    data, size = model.createData(), model.nv
    rng = np.random.default_rng(2)
    q, v = rng.uniform(-3.0, 3.0, (STATES, size)), 10.0 * rng.normal(size=(STATES, size))
    found = CompiledFinger(finger).motion(q, v)
    tips, kinetic, potential = [], [], []
    for each in zip(q, v, strict=True):
        pin.framesForwardKinematics(model, data, each[0])
        tips.append(data.oMf[tip].translation.copy())
        upper = np.triu(pin.crba(model, data, each[0], pin.Convention.WORLD))
        mass = upper + np.triu(upper, 1).T
        kinetic.append(0.5 * each[1] @ mass @ each[1])
        potential.append(pin.computePotentialEnergy(model, data, each[0]))
    assert relative(found.tip, np.array(tips)) < 1e-13
    np.testing.assert_allclose(found.kinetic_energy, kinetic, rtol=1e-12)
    np.testing.assert_allclose(found.potential_energy, potential, atol=1e-13 * np.abs(potential).max())
    single = CompiledFinger(finger).motion(q[0], v[0])
    for own, other in zip(single[:3], found[:3], strict=True):
        np.testing.assert_array_equal(own, other[0])


def test_a_joint_that_both_turns_and_slides_is_refused_by_name():
    model = pin.Model()
    screw = model.addJoint(0, pin.JointModelHX(0.1), pin.SE3.Identity(), "screw")
    model.appendBodyToJoint(screw, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", screw, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    description = fp.FingerDescription.model_validate(
        {
            "name": "screw",
            "joints": {"screw": {"range": [-1.0, 1.0]}},
            "tendons": {"A": {"crossings": {"screw": {"radius": 5e-3}}}},
        }
    )
    finger = fp.Finger.from_model(description, model, {"screw": "screw"}, "tip")
    with pytest.raises(InputError) as caught:
        CompiledFinger(finger)
    assert caught.value.entry == "joint screw"
