"""References (20): the passive tendon's planned elongation, followers in a chain, rates, and reversals by hand."""

import math

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError
from finger_pin.references.reference import SignalReference
from finger_pin.references.signal import Signal


@pytest.fixture(scope="module")
def reversals(routing):
    return SignalReference.from_scenario(fp.load_scenario("reversals"), routing)


def sinusoids(coupling, size, seed=12):
    draw = np.random.default_rng(seed)
    signal = Signal(
        np.hstack([draw.uniform(0.1, 1.0, (size, 4)), np.full((size, 1), -np.inf)]),
        np.array([0.0, 1.0]),
        np.zeros((6, 1, size)),
    )
    return SignalReference(signal, coupling)


@pytest.mark.parametrize("time", [0.0, 0.25, 0.5, 1.0, 2.0, 2.75, 7.9])
def test_reversals_is_the_motion_of_the_model_page(reversals, time):
    degree = math.pi / 180.0
    theta1 = 8.0 * degree * math.sin(math.pi * time)
    theta2 = (35.0 - 25.0 * math.cos(math.pi * time / 2.0)) * degree
    theta3 = (35.0 - 25.0 * math.cos(math.pi * time)) * degree
    theta4 = (3.5e-3 * theta3 - 1.0 / 5e4) / 5.0e-3
    np.testing.assert_allclose(reversals.at(time).position, [theta1, theta2, theta3, theta4], rtol=1e-12, atol=1e-14)


def test_stick_slip_is_the_motion_of_the_model_page():
    scenario = fp.load_scenario("stick_slip")
    reference = SignalReference.from_scenario(scenario, Routing.from_description(scenario.finger))
    for time in (0.0, 0.3, 1.0, 1.7):
        bend = 0.5 - 0.4 * math.cos(math.pi * time)
        expected = [0.1 * math.sin(math.pi * time), bend, bend, bend - 3.0 / (3e4 * 4.5e-3)]
        np.testing.assert_allclose(reference.at(time).position, expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("desired", [0.0, 1.0, 2.5])
def test_at_the_reference_the_passive_tendon_carries_its_desired_tension(desired, routing):
    reference = SignalReference.from_scenario(
        fp.load_scenario("reversals", {"controller.passive_tension": desired}), routing
    )
    theta = reference.at(np.linspace(0.0, 8.0, 50)).position
    tension = 5e4 * (3.5e-3 * theta[:, 2] - 5.0e-3 * theta[:, 3])
    np.testing.assert_allclose(tension, desired, atol=1e-10)


def test_rates_are_the_time_derivatives_of_positions(reversals):
    times, step = np.linspace(0.1, 7.9, 40), 1e-3
    near = reversals.at(times + step).position - reversals.at(times - step).position
    far = reversals.at(times + 2 * step).position - reversals.at(times - 2 * step).position
    numeric = (8.0 * near - far) / (12.0 * step)
    np.testing.assert_allclose(reversals.at(times).velocity, numeric, atol=1e-9)
    assert np.abs(numeric).max(axis=0).min() > 0.1


def test_many_times_are_each_time(reversals):
    times = np.array([0.0, 0.4, 3.3])
    many = reversals.at(times)
    assert many.position.shape == many.velocity.shape == (3, 4)
    for index, time in enumerate(times):
        np.testing.assert_allclose(many.position[index], reversals.at(time).position, rtol=1e-14)
        np.testing.assert_allclose(many.velocity[index], reversals.at(time).velocity, rtol=1e-14, atol=1e-17)


@pytest.mark.parametrize("order", [("P", "Q"), ("Q", "P")])
def test_followers_may_follow_followers_whichever_is_written_first(network, order):
    """P couples b to a, Q couples c to b: theta_b = (3 theta_a - l_P) / 4, theta_c = (2 theta_b - l_Q) / 3 (in mm)."""
    tendons = {"F": {"a": 6}, "E": {"a": -5, "b": -5, "c": -5}}
    passive = {"P": {"a": -3, "b": 4}, "Q": {"b": -2, "c": 3}}
    routing = Routing.from_description(network("abc", tendons | {name: passive[name] for name in order}, order))
    wanted, stiffness = {"P": 2.0, "Q": 3.0}, {"P": 1e4, "Q": 4e4}
    coupling = PassiveCoupling.from_routing(routing, np.array([wanted[n] / stiffness[n] for n in order]))
    assert sorted(coupling.followers) == [1, 2]
    reference = sinusoids(coupling, 3)
    a, b, c = reference.at(0.7).position
    offset, amplitude, frequency, phase, _ = reference.signal.harmonics[0]
    own = offset + amplitude * math.sin(2.0 * math.pi * frequency * 0.7 + phase)
    assert a == pytest.approx(own, rel=1e-14)
    assert b == pytest.approx((3e-3 * a - 2.0 / 1e4) / 4e-3, rel=1e-12)
    assert c == pytest.approx((2e-3 * b - 3.0 / 4e4) / 3e-3, rel=1e-12)
    va, vb, vc = reference.at(0.7).velocity
    assert vb == pytest.approx(0.75 * va, rel=1e-12)
    assert vc == pytest.approx(0.5 * va, rel=1e-12)


def test_a_posture_satisfies_the_constraint_for_any_angles_of_the_free_joints(network):
    """H_c theta = -length in the rows of the passive tendons, of which the second one follows the first."""
    tendons = {"F": {"a": 6}, "E": {"a": -5, "b": -5, "c": -5}, "P": {"a": -3, "b": 4}, "Q": {"b": -2, "c": 3}}
    routing = Routing.from_description(network("abc", tendons, ["P", "Q"]))
    length = np.array([2e-4, -1e-3])
    coupling = PassiveCoupling.from_routing(routing, length)
    angles = np.linspace(-1.0, 1.0, 6).reshape(2, 3, 1)
    postures = coupling.posture(angles)
    np.testing.assert_array_equal(postures[..., coupling.free], angles)
    np.testing.assert_allclose(postures @ routing.coupling[routing.actuated :].T, -length + 0.0 * angles, atol=1e-17)


def test_a_tendon_over_three_joints_drives_the_last_one(network):
    tendons = {"F": {"a": 6}, "E": {"a": -5, "b": -5, "c": -5}, "P": {"a": -3, "b": -2, "c": 4}}
    routing = Routing.from_description(network("abc", tendons, ["P"]))
    coupling = PassiveCoupling.from_routing(routing, np.array([2.0 / 1e4]))
    assert coupling.followers == (2,)
    a, b, c = sinusoids(coupling, 3).at(1.3).position
    assert c == pytest.approx((3e-3 * a + 2e-3 * b - 2.0 / 1e4) / 4e-3, rel=1e-12)
    loose = PassiveCoupling.from_routing(routing, np.array([2.0 / 1e4 + 1e-3]))
    a, b, c = sinusoids(loose, 3).at(1.3).position
    assert c == pytest.approx((3e-3 * a + 2e-3 * b - 2.0 / 1e4 - 1e-3) / 4e-3, rel=1e-12)


def test_a_spring_to_the_base_and_no_passive_tendon_leave_every_joint_its_own_reference(network):
    spring = Routing.from_description(network("a", {"F": {"a": 6}, "P": {"a": -3}}, ["P"]))
    assert PassiveCoupling.from_routing(spring, np.ones(1)).followers == ()
    none = Routing.from_description(fp.load_finger("planar"))
    coupling = PassiveCoupling.from_routing(none, np.zeros(0))
    np.testing.assert_array_equal(coupling.matrix, np.eye(2))
    np.testing.assert_array_equal(coupling.offset, np.zeros(2))


def test_two_passive_tendons_on_one_follower_are_refused_by_name(network):
    tendons = {"F": {"a": 6}, "E": {"a": -5, "b": -5}, "P": {"a": -3, "b": 4}, "Q": {"a": -2, "b": 3}}
    routing = Routing.from_description(network("ab", tendons, ["P", "Q"]))
    with pytest.raises(InputError, match="P, Q determine the same joint twice") as caught:
        PassiveCoupling.from_routing(routing, np.ones(2))
    assert caught.value.entry == "finger.tendons"


def test_a_joint_without_reference_is_held_at_zero(routing):
    scenario = fp.Scenario.model_validate(fp.load_scenario("reversals").model_dump() | {"reference": {"joints": {}}})
    theta = SignalReference.from_scenario(scenario, routing).at(np.array([0.0, 1.0])).position
    np.testing.assert_array_equal(theta[:, :3], 0.0)
    np.testing.assert_allclose(theta[:, 3], -1.0 / (5e4 * 5.0e-3), rtol=1e-12)
