"""The compiled dynamics against the readable ones: every signal, at states of every kind."""

import numpy as np
import pinocchio as pin
import pytest
from core_cases import BODIES, LOOPS, relative

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.description.caching import cached_property
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.signals import FingerSignals

STATES = 100


def assert_alike(found, expected, rtol=1e-9, name="signals"):
    """Compare named results part by part, whatever is nested; arrays by the norm of each state's numbers."""
    if isinstance(expected, np.ndarray):
        assert np.shape(found) == np.shape(expected), name
        found, expected = np.atleast_1d(found), np.atleast_1d(expected)
        distance = np.linalg.norm(found - expected, axis=-1)
        assert np.all(distance <= rtol * np.linalg.norm(expected, axis=-1)), name
    elif isinstance(expected, tuple | dict) or hasattr(expected, "__dict__"):
        for key, part in parts(expected).items():
            assert_alike(parts(found)[key], part, rtol, f"{name}.{key}")
    elif expected is not None:
        assert found == expected, name


def parts(value):
    """The parts of something nested, by name or number, those too that are computed; a table of rows is one thing."""
    if isinstance(value, tuple):
        return dict(enumerate(value))
    if isinstance(value, Rows):
        return {"table": id(value)}
    if isinstance(value, dict):
        return value
    if isinstance(value, FingerSignals):
        signals = {name: value[name] for name in value.finger.signal_table}
        return signals | {"rate": value.rate, "strands": value.strands, "mechanism": value.mechanism}
    computed = [name for name, each in vars(type(value)).items() if isinstance(each, property | cached_property)]
    return vars(value) | {name: getattr(value, name) for name in computed}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_the_state_rate_of_the_closed_loop_is_the_readable_one(cases, name):
    """By kind of state; the passive tendon's acceleration is a difference of forces that cancel to 1e-4 of them."""
    case, rng = cases[name], np.random.default_rng(3)
    x, times = case.states(rng, STATES), rng.uniform(0.0, 4.0, STATES)
    expected = np.array([case.loop.rhs(time, row) for time, row in zip(times, x, strict=True)])
    found = np.array([case.solve(time, row, 1e3)[0] for time, row in zip(times, x, strict=True)])
    for kind in case.kinds:
        assert relative(found[:, kind], expected[:, kind]) < 1e-11


@pytest.mark.parametrize("name", LOOPS)
def test_the_states_compared_are_of_every_kind(cases, name):
    case, rng = cases[name], np.random.default_rng(3)
    x, times = case.states(rng, STATES), rng.uniform(0.0, 4.0, STATES)
    found = case.loop.evaluate(times, x).finger
    for happens in (
        found.strands == 0.0,
        found.strands > 0.0,
        found["limiter_torque"] > 0.0,
        found["limiter_torque"] < 0.0,
        found.state.velocity > 0.0,
        found.state.velocity < 0.0,
    ):
        assert 0.01 < np.mean(happens) < 0.99


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_every_signal_is_the_readable_one_at_one_state_and_at_many(cases, name):
    loop, rng = cases[name].loop, np.random.default_rng(4)
    x = cases[name].states(rng, STATES)
    command = rng.uniform(0.0, 5.0, (STATES, loop.finger.routing.actuated))
    compiled = CompiledFinger(loop.finger)
    force = loop.fingertip_force
    assert_alike(compiled.evaluate(x, command, force), loop.finger.evaluate(x, command, force))
    assert_alike(compiled.evaluate(x[0], command[0], force), loop.finger.evaluate(x[0], command[0], force))


def on_body(bodies, name):
    """A finger with random states and commands around rest, in front of and beyond the ranges of its joints."""
    finger, rng = bodies[name], np.random.default_rng(5)
    postures = rng.uniform(-1.2, 1.2, (STATES, len(finger.routing.joints)))
    x = np.array([finger.rest_state(q) for q in postures])
    x += rng.normal(size=x.shape) * 0.1 * finger.layout.scales()
    return finger, x, rng.uniform(0.0, 5.0, (STATES, finger.routing.actuated)), rng.normal(size=3)


@pytest.mark.parametrize("name", BODIES)
def test_tendons_on_any_body_give_the_readable_signals(bodies, name):
    finger, x, command, _ = on_body(bodies, name)
    assert_alike(CompiledFinger(finger).evaluate(x, command), finger.evaluate(x, command))


@pytest.mark.parametrize("name", BODIES)
def test_a_fingertip_force_on_any_body_is_pinocchio_s(bodies, name):
    """(6), (17) and (18) with Jacobian, link directions and accelerations of the model itself; chains and a tree."""
    finger, x, command, force = on_body(bodies, name)
    model, frame = finger.rigid_body.model, finger.rigid_body.tip_frame
    data, beyond = model.createData(), model.supports[model.frames[frame].parentJoint]
    found = CompiledFinger(finger).evaluate(x, command, force)
    torque = found["joint_torque"] - found["joint_friction"] - found["limiter_torque"]
    for k, (q, v) in enumerate(zip(found.state.position, found.state.velocity, strict=True)):
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3]
        external = jacobian.T @ force
        np.testing.assert_allclose(found["external_torque"][k], external, atol=1e-12 * np.linalg.norm(external))
        expected = pin.aba(model, data, q, v, torque[k] + external)
        np.testing.assert_allclose(found["joint_acceleration"][k], expected, atol=1e-10 * np.linalg.norm(expected))
        pin.forwardKinematics(model, data, q)
        for j in range(1, model.njoints):
            offset = model.jointPlacements[j].translation
            along = offset / np.linalg.norm(offset) if model.parents[j] else np.array([1.0, 0.0, 0.0])
            load = finger.routing.loads[j - 1] @ found.strands[k]
            push = force if j in beyond else np.zeros(3)
            reaction = np.linalg.norm(push - load * (data.oMi[model.parents[j]].rotation @ along))
            assert found["joint_reaction"][k, j - 1] == pytest.approx(reaction, rel=1e-10)


def test_the_fingertip_force_is_that_of_the_call_and_leaves_no_trace(cases):
    case, rng = cases["reversals"], np.random.default_rng(6)
    finger, x = case.loop.finger, case.states(rng, 6)
    command, forces = rng.uniform(0.0, 5.0, (6, 4)), rng.normal(size=(6, 3))
    forces[2] = 0.0
    compiled = CompiledFinger(finger)
    before = compiled.evaluate(x, command)
    assert_alike(compiled.evaluate(x, command, forces), finger.evaluate(x, command, forces))
    assert_alike(compiled.evaluate(x, command, forces[1]), finger.evaluate(x, command, forces[1]))
    after = compiled.evaluate(x, command)
    np.testing.assert_array_equal(after.rate, before.rate)
    np.testing.assert_array_equal(after["external_torque"], 0.0)


def test_a_state_or_command_of_the_wrong_size_is_refused_before_compiled_code_sees_it(cases):
    finger = cases["reversals"].loop.finger
    compiled, x = CompiledFinger(finger), cases["reversals"].loop.initial_state()
    for state, command in ((x[:-1], np.ones(4)), (np.append(x, 0.0), np.ones(4)), (x, np.ones(3)), (x, np.ones(5))):
        with pytest.raises(ValueError):
            compiled.evaluate(state, command)
    assert isinstance(compiled.evaluate(x, np.ones(4)), FingerSignals)


def test_lists_integers_frozen_and_strided_arrays_are_taken_as_the_numbers_that_they_hold(cases):
    """Compiled code reads one kind of array alone, and would misread another."""
    finger = cases["reversals"].loop.finger
    x = cases["reversals"].loop.initial_state()
    frozen = np.tile(x, (3, 1))
    frozen.flags.writeable = False
    compiled = CompiledFinger(finger)
    assert_alike(compiled.evaluate(x, [1, 2, 3, 4]), finger.evaluate(x, np.array([1.0, 2.0, 3.0, 4.0])))
    strided = np.arange(6.0).reshape(3, 2)[:, 0]
    assert_alike(
        compiled.evaluate(frozen, np.ones(4), strided), finger.evaluate(frozen.copy(), np.ones(4), strided.copy())
    )
    single = np.ones((3, 4), dtype=np.float32)
    assert_alike(compiled.evaluate(np.asfortranarray(frozen), single), finger.evaluate(frozen, np.ones((3, 4))))
    found = compiled.motion(frozen[:, :4], np.zeros((3, 4), dtype=int))
    np.testing.assert_array_equal(found.tip, compiled.motion(frozen[:, :4].copy(), np.zeros((3, 4))).tip)


def test_a_finger_of_one_joint_whose_arrays_are_in_either_order_is_evaluated_and_stepped(network):
    link = {"length": 0.03, "width": 0.01, "mass": 0.01}
    description = network(["only"], {"A": {"only": 5.0}, "B": {"only": -5.0}}).model_dump()
    description["joints"]["only"]["link"] = link
    finger = fp.Finger(fp.FingerDescription.model_validate(description))
    start, scales = finger.rest_state(np.zeros(1)), finger.layout.scales()
    assert_alike(CompiledFinger(finger).evaluate(start, np.ones(2)), finger.evaluate(start, np.ones(2)))
    control = held_control(finger.mechanism.channels, finger.mechanism.coordinates)
    assert Stepper(finger.mechanism, control, start, TABLEAUS["Rodas4"](), 1e-6, 1e-6 * scales).advance(1e-4) == 0
