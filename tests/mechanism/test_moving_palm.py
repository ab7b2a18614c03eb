"""A palm along a prescribed path: its acceleration acts on every link."""

import numpy as np
import pinocchio as pin
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.palm import PalmPath
from finger_pin.exceptions import InputError

PATH = {
    "x": {"amplitude": 0.05, "frequency": 1.3},
    "y": {"kind": "points", "times": [0.0, 0.2, 0.4], "values": [0.0, 0.08, -0.02]},
    "z": {"amplitude": 0.04, "frequency": 2.0, "phase": 0.4, "offset": 0.2},
    "roll": {"amplitude": 0.5, "frequency": 1.1},
    "pitch": {"amplitude": 0.4, "frequency": 0.9, "phase": 1.0},
    "yaw": {"kind": "samples", "times": [0.0, 0.15, 0.3, 0.5], "values": [0.0, 0.5, 0.2, 0.6]},
}
DURATION = {"simulation.duration": 0.25}


@pytest.fixture(scope="module")
def scenario():
    return fp.load_scenario("hand", DURATION | {"hand.palm.path": PATH})


@pytest.fixture(scope="module")
def loop(scenario):
    return ClosedLoop.from_scenario(scenario)


def carried(finger):
    """The same fingers on six prescribed joints: along x, y, z of the world, then about z, y, x."""
    own, model = finger.rigid_body.model, pin.Model()
    kinds = [pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX]
    base = 0
    for kind in kinds:
        base = model.addJoint(base, kind(), pin.SE3.Identity(), f"{kind.__name__}")
    for index in range(1, own.njoints):
        parent = int(own.parents[index])
        at = model.addJoint(base + parent, own.joints[index], own.jointPlacements[index], own.names[index])
        model.inertias[at] = own.inertias[index]
    model.gravity.linear[:] = own.gravity.linear
    return model, model.createData()


def prescribed(loop, time):
    """Positions, velocities and accelerations of those six joints, by differences of the signals."""
    order = [0, 1, 2, 5, 4, 3]

    def at(instant):
        return loop.palm.signal.at(instant)[0][order]

    h = 1e-4
    rate = (at(time - 2 * h) - 8 * at(time - h) + 8 * at(time + h) - at(time + 2 * h)) / (12 * h)
    second = (-at(time - 2 * h) + 16 * at(time - h) - 30 * at(time) + 16 * at(time + h) - at(time + 2 * h)) / (
        12 * h * h
    )
    return at(time), rate, second


@pytest.mark.parametrize("time", [0.031, 0.117, 0.222])
def test_accelerations_are_those_of_a_base_on_six_prescribed_joints(loop, time):
    """Newton-Euler in the world with all accelerations gives the torques that acted, in both evaluators."""
    model, data = carried(loop.finger)
    rng = np.random.default_rng(5)
    place, rate, second = prescribed(loop, time)
    for dynamics in (loop.finger, loop.compiled().dynamics):
        x = loop.finger.rest_state(rng.uniform(0.0, 1.0, 20), 3.0 * rng.normal(size=20))
        command, force = rng.uniform(0.0, 6.0, 20), rng.normal(size=(5, 3))
        found = dynamics.evaluate(x, command, force, loop.base(time))
        state = loop.finger.layout.unpack(x)
        torque = found.mechanism.torque[:20] + found["external_torque"]
        q, v, a = (
            np.append(*each)
            for each in ((place, state.position), (rate, state.velocity), (second, found["joint_acceleration"]))
        )
        wanted = np.array(pin.rnea(model, data, q, v, a))
        np.testing.assert_allclose(torque, wanted[6:], rtol=1e-6, atol=1e-8)
        # What moves the palm supplies its wrench times its motion.
        palm = found.mechanism.account()[1]["palm"]
        assert palm == pytest.approx(float(rate @ wanted[:6]), rel=1e-5, abs=1e-7)


def test_both_evaluators_agree_on_a_moving_palm(loop):
    rng, times = np.random.default_rng(6), np.array([0.02, 0.1, 0.19])
    x = np.array([loop.finger.rest_state(rng.uniform(0.0, 1.0, 20), rng.normal(size=20)) for _ in times])
    command = rng.uniform(0.0, 6.0, (3, 20))
    base = loop.base(times)
    slow = loop.finger.evaluate(x, command, None, base)
    fast = loop.compiled().dynamics.evaluate(x, command, None, base)
    np.testing.assert_allclose(fast.rate, slow.rate, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(fast.mechanism.account()[1]["palm"], slow.mechanism.account()[1]["palm"], rtol=1e-9)
    state = loop.finger.layout.unpack(x)
    first, second = (
        each.motion(state.position, state.velocity, base) for each in (loop.finger, loop.compiled().dynamics)
    )
    np.testing.assert_allclose(second.kinetic_energy, first.kinetic_energy, rtol=1e-12)
    np.testing.assert_allclose(second.potential_energy, first.potential_energy, rtol=1e-9, atol=1e-12)


def test_the_numbers_of_the_base_have_the_rates_that_they_say(loop):
    for time in (0.05, 0.12, 0.21):
        h = 1e-4
        before, after = loop.palm.base(time - h), loop.palm.base(time + h)
        np.testing.assert_allclose(loop.palm.base(time)[15:], (after - before)[:12] / (2 * h), rtol=1e-5, atol=2e-3)


def test_the_account_of_a_moving_palm_closes_and_tips_move_with_it(scenario, loop):
    result = fp.simulate(scenario)
    assert abs(result.energy_exchanged_palm).max() > 1e-3
    assert abs(result.energy_residual).max() < 1e-5 * abs(result.energy_exchanged_palm).max()
    place, rotation = loop.palm.place(result.time.values)
    np.testing.assert_allclose(result.palm_position, place)
    still = loop.finger.motion(result.joint_position.values, result.joint_velocity.values).tip
    tips = np.einsum("mrc,mfc->mfr", rotation, still) + place[:, None]
    np.testing.assert_allclose(result.fingertip_position, still, atol=1e-12)
    np.testing.assert_allclose(fp.in_world(result).fingertip_position, tips, atol=1e-12)


def test_a_palm_that_falls_freely_takes_the_weight_off(scenario):
    """And one that rests, wherever it is, changes nothing but where things are."""
    loop = ClosedLoop.from_scenario(scenario)
    q = np.linspace(0.0, 1.0, 20)
    base = np.zeros(27)
    weightless = loop.finger.mechanism.evaluate(loop.finger.rest_state(q), np.zeros(20), base=base)
    described = fp.load_hand("ub_hand", {"hand.gravity": [0.0, 0.0, 0.0]})
    free = fp.Finger(described)
    still = free.evaluate(free.rest_state(q), np.zeros(20))
    np.testing.assert_allclose(weightless.acceleration[:20], still["joint_acceleration"], rtol=1e-9, atol=1e-9)
    resting = fp.load_scenario("hand", DURATION | {"hand.palm.path": {"z": {"offset": 0.3}}})
    moved, plain = fp.simulate(resting), fp.simulate(fp.load_scenario("hand", DURATION))
    np.testing.assert_allclose(moved.joint_position, plain.joint_position, atol=1e-7)
    raised = (fp.in_world(moved).fingertip_position - plain.fingertip_position).transpose("time", "finger", "axis")
    np.testing.assert_allclose(raised, np.broadcast_to([0.0, 0.0, 0.3], raised.shape), atol=1e-7)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ({"rol": {"amplitude": 1.0}}, "did you mean roll?"),
        ({"x": {"kind": "step", "time": 0.1, "height": 0.1}}, "a palm has an acceleration"),
        ({"z": {"amplitude": 50.0}}, "must be at most 12.5"),
    ],
)
def test_a_wrong_path_is_named(path, said):
    with pytest.raises(InputError, match=r"hand\.palm\.path") as caught:
        fp.load_scenario("hand", {"hand.palm.path": path})
    assert said in str(caught.value)


def test_a_path_starts_at_the_scenarios_start_time(scenario):
    later = PalmPath.from_hand(scenario.hand, 0.1)
    np.testing.assert_allclose(later.base(0.05), PalmPath.from_hand(scenario.hand, 0.0).base(0.15))
