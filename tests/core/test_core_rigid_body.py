"""The compiled rigid body against Pinocchio: chains and a tree, turning and sliding joints."""

from dataclasses import dataclass, fields

import kernels
import numpy as np
import pinocchio as pin
import pytest
from core_cases import BODIES, relative

import finger_pin as fp
from finger_pin.core.compiled_finger import CompiledFinger
from finger_pin.core.evaluation.rigid_body import BY_POSITION, BY_VELOCITY, MASS_MATRIX
from finger_pin.core.tables import build_tables
from finger_pin.core.work import build_work
from finger_pin.exceptions import InputError

STATES = 200


@dataclass
class Found:
    """What a rigid body does at many states; leading dimension: states."""

    mass: list
    bias: list
    torque: list
    by_position: list
    by_velocity: list
    acceleration: list


@pytest.fixture(scope="module", params=BODIES)
def compared(request, bodies):
    """The same quantities of one body, compiled and from Pinocchio."""
    finger = bodies[request.param]
    model, tables = finger.rigid_body.model, build_tables(finger.mechanism)
    laws = [table.law for table in finger.mechanism.rows]
    data, work, size = model.createData(), build_work(tables, laws, finger.mechanism.channels), model.nv
    rng = np.random.default_rng(1)
    ours, theirs = Found(*([] for _ in fields(Found))), Found(*([] for _ in fields(Found)))
    for _ in range(STATES):
        q, v = rng.uniform(-3.0, 3.0, size), 10.0 * rng.normal(size=size)
        a, torque = 100.0 * rng.normal(size=size), 0.1 * rng.normal(size=size)
        bias, needed, acceleration = np.zeros((3, size))
        kernels.rigid(tables, q, v, a, torque, work, bias, needed, acceleration)
        ours.mass.append(work.square[MASS_MATRIX].copy())
        ours.by_position.append(work.square[BY_POSITION].copy())
        ours.by_velocity.append(work.square[BY_VELOCITY].copy())
        ours.bias.append(bias)
        ours.torque.append(needed)
        ours.acceleration.append(acceleration)
        upper = np.triu(pin.crba(model, data, q, pin.Convention.WORLD))
        theirs.mass.append(upper + np.triu(upper, 1).T)
        theirs.bias.append(pin.nonLinearEffects(model, data, q, v).copy())
        theirs.torque.append(pin.rnea(model, data, q, v, a).copy())
        theirs.acceleration.append(pin.aba(model, data, q, v, torque).copy())
        by_position, by_velocity, _ = pin.computeRNEADerivatives(model, data, q, v, a)
        theirs.by_position.append(by_position.copy())
        theirs.by_velocity.append(by_velocity.copy())
    return ours, theirs


@pytest.mark.parametrize("quantity", [field.name for field in fields(Found)])
def test_mass_bias_torque_derivatives_and_acceleration_are_pinocchio_s(compared, quantity):
    """To rounding: mass matrices here have condition numbers up to about 1e3, which multiplies 2e-16 at most."""
    ours, theirs = (np.array(getattr(each, quantity)) for each in compared)
    assert relative(ours, theirs) < 1e-12


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
    for field in fields(found)[:3]:
        np.testing.assert_array_equal(getattr(single, field.name), getattr(found, field.name)[0])


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
