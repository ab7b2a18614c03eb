"""The controller (19), (21), (22) against its defining properties and by hand."""

from fractions import Fraction

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.proportional import ProportionalController
from finger_pin.description.routing import Routing
from finger_pin.references.reference import ReferenceSignals


@pytest.fixture(scope="module")
def controller(routing):
    return ProportionalController.from_scenario(fp.load_scenario("reversals"), routing)


def command(controller, error, position=None):
    position = np.zeros_like(error) if position is None else position
    reference = ReferenceSignals(position + error, np.zeros_like(error))
    return controller.command(0.0, reference, position, np.zeros_like(error))


def errors(count=200, size=4, seed=13):
    return np.random.default_rng(seed).normal(0.0, 0.1, (count, size))


def internal_by_hand():
    """f^k with its largest entry 1, from the radii joint by joint, tip inwards."""
    f4 = Fraction(1)
    f5 = Fraction("5.3") / Fraction("5.0") * f4
    f3 = (Fraction("5.3") * f4 + Fraction("3.5") * f5) / Fraction("6.3")
    f1 = Fraction("5.3") * f4 / 16
    vector = np.array([float(value) for value in (f1, f1, f3, f4, f5)])
    return vector / vector.max()


def test_torque_is_the_gain_times_the_error():
    scenario = fp.load_scenario("reversals", {"controller.gain": [1.0, 2.0, 3.0, 4.0]})
    controller = ProportionalController.from_scenario(scenario, fp.Finger(scenario.finger).routing)
    signals = command(controller, np.array([0.1, 0.1, -0.2, 0.3]), position=np.array([0.5, 0.2, 0.3, 0.1]))
    np.testing.assert_allclose(signals.torque, [0.1, 0.2, -0.6, 1.2], rtol=1e-12)


def test_the_planned_tensions_produce_the_desired_torque_exactly(controller, routing):
    for error in errors():
        signals = command(controller, error)
        np.testing.assert_allclose(routing.coupling.T @ signals.tension, error, rtol=1e-11, atol=1e-14)


def test_every_planned_tension_is_at_least_the_minimum_and_one_is_at_it(controller):
    for error in errors():
        tension = command(controller, error).tension
        assert tension.min() == pytest.approx(1.0, rel=1e-12)


def test_each_tendon_can_have_a_minimum_of_its_own(routing):
    minimum = np.array([0.5, 1.0, 2.0, 4.0, 0.1])
    controller = ProportionalController.from_routing(routing, np.ones(4), minimum)
    tight = set()
    for error in errors():
        spare = command(controller, error).tension - minimum
        assert spare.min() == pytest.approx(0.0, abs=1e-10)
        tight.add(int(np.argmin(spare)))
    assert len(tight) > 1


def test_without_error_the_tensions_are_the_internal_ones_scaled_to_the_minimum(controller):
    """f^m = 0, so lambda = max f0 / f^k_i is 1 / f^k_1 and T1, T2 sit at 1 N."""
    ratio = internal_by_hand()
    np.testing.assert_allclose(command(controller, np.zeros(4)).tension, ratio / ratio.min(), rtol=1e-12)


def test_lambda_is_the_largest_of_equation_22_by_hand(controller):
    """T1 and T2 alone turn joint 1: 0.016 N m takes f^m = (1, -1, 0, 0, 0) N, which has no share along f^k."""
    ratio = internal_by_hand()
    signals = command(controller, np.array([0.016, 0.0, 0.0, 0.0]))
    minimal = np.array([1.0, -1.0, 0.0, 0.0, 0.0])
    assert abs(minimal @ ratio) < 1e-15
    level = max((1.0 - m) / k for m, k in zip(minimal, ratio, strict=True))
    assert level == pytest.approx(2.0 / ratio[1], rel=1e-12)
    np.testing.assert_allclose(signals.tension, minimal + level * ratio, rtol=1e-12)


def test_the_part_besides_internal_tension_is_the_shortest_that_makes_the_torque(controller, routing):
    """Normal equations by hand: f^m = Hc (Hc^T Hc)^-1 tau is orthogonal to f^k and makes tau."""
    ratio = internal_by_hand()
    table = (
        np.array([[8.0, 8.0, 0, 0], [-8.0, 8.0, 0, 0], [0, 0, 6.3, 0], [0, -5.3, -5.3, -5.3], [0, 0, -3.5, 5.0]]) * 1e-3
    )
    for error in errors(50):
        minimal = table @ np.linalg.solve(table.T @ table, error)
        level = max((1.0 - m) / k for m, k in zip(minimal, ratio, strict=True))
        tension = command(controller, error).tension
        np.testing.assert_allclose(tension, minimal + level * ratio, rtol=1e-10)
        removed = tension - ratio * (tension @ ratio) / (ratio @ ratio)
        np.testing.assert_allclose(removed, minimal, rtol=1e-9, atol=1e-11)


def test_commands_of_a_batch_are_those_of_each_row(controller):
    batch = command(controller, errors(5))
    for index, error in enumerate(errors(5)):
        np.testing.assert_allclose(batch.tension[index], command(controller, error).tension, rtol=1e-12)
    assert batch.torque.shape == (5, 4) and batch.tension.shape == (5, 5)


def test_a_finger_with_two_internal_directions_is_still_held_above_the_minimum(network):
    description = network("jk", {"A": {"j": 6}, "B": {"j": -3}, "C": {"k": 5}, "D": {"k": -5}})
    routing = Routing.from_description(description)
    controller = ProportionalController.from_routing(routing, np.ones(2), np.full(4, 0.7))
    for error in errors(50, 2):
        tension = command(controller, error).tension
        assert tension.min() == pytest.approx(0.7, rel=1e-9)
        np.testing.assert_allclose(routing.coupling.T @ tension, error, rtol=1e-9, atol=1e-12)
