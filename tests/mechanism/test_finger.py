"""The wired finger against a scalar re-implementation of the model page, and as a function that others call."""

import inspect

import numpy as np
import pinocchio as pin
import pytest
from scalar_model import NUMBERS, UB, controller, random_states, scalar_model

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.exceptions import InputError


@pytest.fixture(scope="module", params=["reversals", "stick_slip"])
def case(request):
    scenario = fp.load_scenario(request.param)
    return NUMBERS[request.param], ClosedLoop.from_scenario(scenario)


def close(actual, expected, name):
    expected = np.asarray(expected)
    np.testing.assert_allclose(
        actual, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max(initial=0.0), err_msg=name
    )


@pytest.mark.slow
@pytest.mark.parametrize("evaluator", [lambda finger: finger, CompiledFinger], ids=["Python", "compiled"])
def test_evaluation_agrees_with_the_scalar_model_at_random_states(case, evaluator):
    numbers, loop = case
    evaluated, seen = evaluator(loop.finger), []
    for x, command, force in random_states(numbers):
        rate, expected = scalar_model(numbers, x, command, force)
        signals = evaluated.evaluate(x, command, force)
        actual = {
            "phi": signals["tendon_curvature"],
            "slide": signals["tendon_velocity"],
            "loss": signals["tendon_friction"],
            "strands": signals.strands,
            "normal": signals["tendon_normal_force"],
            "torque": signals["joint_torque"],
            "reaction": signals["joint_reaction"],
            "friction": signals["joint_friction"],
            "limiter": signals["limiter_torque"],
            "external": signals["external_torque"],
        }
        for name, values in expected.items():
            close(actual[name], values, name)
        for part in (slice(0, 4), slice(4, 5), slice(5, 9), slice(9, 10), slice(10, 15), slice(15, 19)):
            close(signals.rate[part], rate[part], f"rate {part}")
        close(signals["joint_acceleration"], rate[5:9], "acceleration")
        strands, limiter = np.array(expected["strands"]), np.array(expected["limiter"])
        seen.append([*(strands == 0.0), *(strands > 0.0), (limiter > 0).any(), (limiter < 0).any(), force.any()])
    assert np.all(np.any(seen, axis=0)), "the states must cover slack and taut strands, both limits and a force"
    assert not np.all(np.array(seen)[:, -1])


@pytest.mark.slow
def test_the_closed_loop_agrees_with_the_scalar_model_and_controller(case):
    numbers, loop = case
    for (x, _, _), time in zip(random_states(numbers, 30), np.linspace(0.0, 2.0, 30), strict=True):
        desired = loop.reference.at(time).position
        tension = controller(numbers, x[:4], desired)
        close(loop.evaluate(time, x).control.tension, tension, "tension")
        rate, _ = scalar_model(numbers, x, tension[:4], np.zeros(3))
        for part in (slice(0, 4), slice(4, 5), slice(5, 9), slice(9, 10), slice(10, 15), slice(15, 19)):
            close(loop.rhs(time, x)[part], rate[part], f"rate {part}")


def test_both_sides_of_equation_18_agree_in_newton_euler_recursion(finger):
    model = finger.rigid_body.model
    data = model.createData()
    for x, command, force in random_states(UB, 40):
        s = finger.evaluate(x, command, force)
        left = pin.rnea(model, data, x[:4], x[5:9], s["joint_acceleration"])
        right = s["joint_torque"] - s["joint_friction"] - s["limiter_torque"] + s["external_torque"]
        np.testing.assert_allclose(left, right, rtol=1e-9, atol=1e-11)


def test_the_mass_of_the_passive_tendon_obeys_equation_13(finger):
    for x, command, _ in random_states(UB, 20):
        s = finger.evaluate(x, command)
        expected = (s.strands[4] - s.strands[5] - s["tendon_friction"][4]) / 8.8e-6
        assert s.rate[9] == pytest.approx(expected, rel=1e-12)


def test_evaluation_of_a_batch_is_that_of_each_state(finger):
    x, command, force = (np.array(rows) for rows in zip(*random_states(UB, 12), strict=True))
    batch = finger.evaluate(x, command, force)
    for index in range(12):
        single = finger.evaluate(x[index], command[index], force[index])
        close(batch.rate[index], single.rate, "rate")
        for name, values in vars(single.state).items():
            close(getattr(batch.state, name)[index], values, name)
        for name in finger.signal_table:
            close(batch[name][index], single[name], name)


def test_one_force_serves_a_whole_batch(finger):
    x, command, _ = (np.array(rows) for rows in zip(*random_states(UB, 5), strict=True))
    force = np.array([0.2, -0.3, 0.5])
    shared = finger.evaluate(x, command, force).rate
    each = finger.evaluate(x, command, np.tile(force, (5, 1))).rate
    np.testing.assert_array_equal(shared, each)


def test_the_right_hand_side_is_a_pure_function(finger):
    states = list(random_states(UB, 6))
    first = []
    for x, command, force in states:
        kept = x.copy(), command.copy(), force.copy()
        first.append(finger.rhs(0.0, x, command, force))
        for before, after in zip(kept, (x, command, force), strict=True):
            np.testing.assert_array_equal(before, after)
    again = [finger.rhs(5.0, *state) for state in reversed(states)]
    np.testing.assert_array_equal(first, again[::-1])


def test_results_do_not_change_when_the_finger_is_used_again(finger):
    (x, command, force), (y, other, _) = list(random_states(UB, 2))
    signals = finger.evaluate(x, command, np.ones(3))
    kept = signals.rate.copy(), signals["external_torque"].copy(), signals["joint_reaction"].copy()
    finger.evaluate(y, other, force)
    for before, after in zip(kept, (signals.rate, signals["external_torque"], signals["joint_reaction"]), strict=True):
        np.testing.assert_array_equal(before, after)


def test_no_force_and_a_force_of_zero_are_the_same(finger):
    x, command, _ = next(random_states(UB, 1))
    np.testing.assert_array_equal(finger.rhs(0.0, x, command), finger.rhs(0.0, x, command, np.zeros(3)))


def test_reaction_is_continuous_in_the_force(finger):
    """Zero force takes a shorter path through the code; a tiny one must give the same."""
    for x, command, _ in random_states(UB, 10):
        none, tiny = finger.evaluate(x, command), finger.evaluate(x, command, np.array([1e-13, 0.0, 0.0]))
        np.testing.assert_allclose(tiny["joint_reaction"], none["joint_reaction"], atol=1e-12)


def test_rest_state_has_no_motion_no_stiction_and_an_even_passive_tendon(finger):
    theta = np.array([0.05, 0.4, 0.9, 0.5])
    expected = np.zeros(19)
    expected[:4] = theta
    expected[4] = 0.5 * (3.5e-3 * 0.9 + 5e-3 * 0.5)
    np.testing.assert_allclose(finger.rest_state(theta), expected, rtol=1e-14)
    strands = finger.evaluate(finger.rest_state(theta), np.zeros(4)).strands
    assert strands[4] == pytest.approx(strands[5], rel=1e-9) and strands[4] > 0.0


def test_the_start_is_at_rest_on_the_reference(case):
    numbers, loop = case
    x = loop.initial_state()
    np.testing.assert_allclose(x[:4], loop.reference.at(0.0).position, rtol=1e-14)
    assert x[4] == pytest.approx(0.5 * (numbers["r35"] * x[2] + numbers["r45"] * x[3]), rel=1e-12)
    np.testing.assert_array_equal(x[5:], 0.0)


def test_a_rigid_body_with_another_number_of_joints_is_refused(ub):
    planar = fp.Finger(fp.load_finger("planar"))
    with pytest.raises(InputError) as caught:
        fp.Finger(ub, planar.rigid_body)
    assert caught.value.entry == "finger.joints"


def test_a_state_of_the_wrong_size_is_refused(finger):
    with pytest.raises(ValueError, match=r"x = \[18\]: must be numbers of shape \(\.\.\., 19\)"):
        finger.evaluate(np.zeros(18), np.zeros(4))


def test_couplings_are_those_of_the_routing(finger):
    np.testing.assert_array_equal(finger.coupling, finger.routing.coupling)
    np.testing.assert_array_equal(finger.strand_coupling, finger.routing.strand_coupling)


#: Arguments that are numbers, by name, and attributes that are their sizes.
SIZES = {"q": 4, "v": 4, "a": 4, "torque": 4, "position": 4, "velocity": 4, "x": 19, "inputs": 4}


@pytest.mark.parametrize("kind", [fp.Finger, type(fp.Finger("ub_stand_in").rigid_body)])
def test_every_method_of_postures_and_states_takes_lists_and_refuses_other_sizes_in_one_line(kind):
    finger, random = fp.Finger("ub_stand_in"), np.random.default_rng(3)
    owner, seen = finger if kind is fp.Finger else finger.rigid_body, []
    for name, method in inspect.getmembers(owner, inspect.ismethod):
        needed = [each.name for each in inspect.signature(method).parameters.values() if each.default is each.empty]
        names = [each for each in needed if each != "time"]
        if name.startswith("_") or not names or not {*names} <= {*SIZES} or names[0] == "rigid_body":
            continue
        arrays = {each: 0.1 + 0.3 * random.random(SIZES[each]) for each in names}
        time = {"time": 0.0} if "time" in needed else {}
        given, wanted = (method(**time, **{k: f(v) for k, v in arrays.items()}) for f in (np.ndarray.tolist, np.copy))
        for got, expected in zip(numbers(given), numbers(wanted), strict=True):
            np.testing.assert_array_equal(got, expected)
        for each in names:
            for wrong in ([0.1] * (SIZES[each] + 1), [], "abcd", 0.3, None):
                with pytest.raises(InputError, match=rf"^{each}\b.*must be numbers of shape \(") as caught:
                    method(**time, **{**arrays, each: wrong})
                assert "\n" not in str(caught.value)
        seen.append(name)
    expected = {"static_torque", "rhs", "evaluate", "excursion", "rest_state"}
    expected = expected if kind is fp.Finger else {"mass_matrix", "jacobian", "tip_position", "forward_dynamics"}
    assert expected <= {*seen}


def numbers(found):
    """Return the arrays of an answer, whatever it is; none of objects of Pinocchio."""
    if hasattr(found, "rate"):
        return [found.rate]
    parts = (
        vars(found).values() if hasattr(found, "__dict__") else found if isinstance(found, tuple | list) else [found]
    )
    return [each for each in parts if isinstance(each, np.ndarray)]
