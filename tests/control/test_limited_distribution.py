"""The quadratic programme against closed forms, other solvers and its conditions of optimality."""

import numpy as np
import pytest
import scipy.optimize

import finger_pin as fp
from finger_pin.control.distribution import LimitedDistribution
from finger_pin.description.routing import Routing


@pytest.fixture(scope="module")
def redundant(network):
    """Two joints, five tendons: three directions of internal tension."""
    tendons = {"A": {"j": 6, "k": 3}, "B": {"j": -4}, "C": {"k": 5}, "D": {"k": -5, "j": 2}, "E": {"j": -3, "k": -3}}
    return Routing.from_description(network("jk", tendons))


def torques(count, size, scale, seed):
    return np.random.default_rng(seed).normal(0.0, scale, (count, size))


def test_the_distribution_over_one_internal_direction_is_the_closed_form_within_the_limits(routing):
    wanted, minimum = torques(200, 4, 0.05, 1), np.array([1.0, 0.5, 1.0, 2.0, 1.0])
    limited = LimitedDistribution(routing, np.full(5, 1e4)).plan(wanted, minimum)
    paper = fp.control.PseudoInverse.from_routing(routing).plan(wanted, minimum)
    np.testing.assert_allclose(limited.tension, paper.tension, atol=1e-6)
    np.testing.assert_array_equal(limited.torque_deficit, 0.0)


def test_the_distribution_over_several_internal_directions_needs_the_least_tension_of_all(redundant):
    """SLSQP on the same programme finds the same tensions; one internal direction alone needs more."""
    minimum, maximum = np.full(5, 0.5), np.full(5, 12.0)
    wanted = torques(25, 2, 0.02, 2)
    plan = LimitedDistribution(redundant, maximum).plan(wanted, minimum)
    paper = fp.control.PseudoInverse.from_routing(redundant).plan(wanted, minimum)
    matrix = redundant.coupling.T
    for torque, tension in zip(wanted, plan.tension, strict=True):
        found = scipy.optimize.minimize(
            lambda f: f @ f,
            np.full(5, 5.0),
            jac=lambda f: 2.0 * f,
            method="SLSQP",
            bounds=[(0.5, 12.0)] * 5,
            constraints={
                "type": "eq",
                "fun": lambda f, t=torque: 1e3 * (matrix @ f - t),
                "jac": lambda f: 1e3 * matrix,
            },
            options={"ftol": 1e-12, "maxiter": 500},
        )
        assert np.max(np.abs(matrix @ found.x - torque)) < 1e-9
        np.testing.assert_allclose(tension, found.x, atol=1e-4)
    norms = [np.linalg.norm(each.tension, axis=1) for each in (plan, paper)]
    assert np.all(norms[0] <= norms[1] + 1e-9)
    assert np.max(norms[1] - norms[0]) > 0.5


@pytest.mark.slow
def test_the_distribution_falls_short_exactly_where_no_tensions_within_the_limits_exert_the_torque(redundant):
    """Whether there are any is asked of a linear programme."""
    minimum, maximum = np.full(5, 1.0), np.full(5, 6.0)
    wanted = torques(150, 2, 0.03, 3)
    plan = LimitedDistribution(redundant, maximum).plan(wanted, minimum)
    matrix, counts = redundant.coupling.T, [0, 0]
    for torque, tension, torque_deficit in zip(wanted, plan.tension, plan.torque_deficit, strict=True):
        feasible = scipy.optimize.linprog(
            np.zeros(5), A_eq=1e3 * matrix, b_eq=1e3 * torque, bounds=[(1.0, 6.0)] * 5
        ).success
        counts[feasible] += 1
        assert np.all(tension >= 1.0) and np.all(tension <= 6.0)
        np.testing.assert_allclose(matrix @ tension, torque - torque_deficit, atol=1e-8)
        assert feasible == (np.linalg.norm(torque_deficit) < 1e-7)
    assert min(counts) > 20


def test_a_distribution_that_falls_short_exerts_the_nearest_torque(redundant):
    """Conditions of optimality: no tension that may still change would bring the torque nearer."""
    minimum, maximum = np.full(5, 1.0), np.array([6.0, 5.0, 4.0, 7.0, 6.0])
    plan = LimitedDistribution(redundant, maximum).plan(torques(100, 2, 0.2, 4), minimum)
    short = np.linalg.norm(plan.torque_deficit, axis=1) > 1e-6
    assert short.sum() > 50
    gain = plan.torque_deficit[short] @ redundant.coupling.T
    tension, scale = plan.tension[short], np.linalg.norm(gain, axis=1, keepdims=True)
    np.testing.assert_array_less((gain / scale)[tension < maximum - 1e-6], 1e-6)
    np.testing.assert_array_less(-(gain / scale)[tension > minimum + 1e-6], 1e-6)


def test_a_tendon_whose_limits_coincide_is_held_there(redundant):
    minimum, maximum = np.full(5, 2.0), np.array([2.0, 6.0, 6.0, 6.0, 6.0])
    plan = LimitedDistribution(redundant, maximum).plan(torques(30, 2, 0.05, 5), minimum)
    np.testing.assert_allclose(plan.tension[:, 0], 2.0, atol=1e-9)


def test_a_plan_depends_on_nothing_but_its_arguments(redundant):
    wanted, minimum = torques(40, 2, 0.05, 6), np.full(5, 1.0)
    distribution = LimitedDistribution(redundant, np.full(5, 6.0))
    forth = distribution.plan(wanted, minimum)
    back = distribution.plan(wanted[::-1], minimum)
    np.testing.assert_array_equal(forth.tension, back.tension[::-1])


def test_a_simulation_keeps_to_the_limits_and_records_what_is_missing():
    limit = 4.0
    overrides = {
        "controller.distribution.maximum_tension": limit,
        "controller.gain": 3.0,
        "controller.sampling.period": 1e-3,
        "simulation.duration": 0.1,
        "reference.joints.proximal.frequency": 3.0,
    }
    result = fp.simulate(fp.load_scenario("reversals", overrides))
    assert float(result.tendon_command.max()) <= limit
    torque_deficit = result.torque_shortfall
    assert torque_deficit.dims == ("time", "joint") and torque_deficit.attrs["units"] == "N m"
    assert float(abs(torque_deficit).max()) > 1e-3
    planned = result.tendon_command.values @ fp.Finger(fp.load_finger("ub_stand_in")).coupling
    np.testing.assert_allclose(planned, (result.joint_torque_command - torque_deficit).values, atol=1e-8)
    assert "torque_shortfall" not in fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.01}))
