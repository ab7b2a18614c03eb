"""Varied scenarios are those that the same entries in a file give."""

import numpy as np
import pytest
from paper.runs import (
    at_speed,
    internal_passive_tension,
    swinging_to_lock,
    weightless,
    with_joint_friction,
    with_minimum_tension,
    with_passive_tension,
    with_tendon_friction,
)

import finger_pin as fp
from finger_pin.references.reference import SignalReference


@pytest.fixture(scope="module")
def fig6_scenario():
    return fp.load_scenario("reversals")


def test_variations_are_the_overrides_that_they_stand_for(fig6_scenario):
    for varied, overrides in (
        (
            with_joint_friction(fig6_scenario, 2.0),
            {"finger.joint_friction.coulomb": 5e-4, "finger.joint_friction.stiction": 7e-4},
        ),
        (with_tendon_friction(fig6_scenario, 2.0), {"finger.tendon_friction.coulomb": 0.22}),
        (with_minimum_tension(fig6_scenario, 2.5), {"controller.minimum_tension": 2.5}),
        (with_passive_tension(fig6_scenario, (3.0,)), {"controller.passive_tension": [3.0]}),
        (weightless(fig6_scenario), {"finger.gravity": [0.0, 0.0, 0.0]}),
    ):
        assert varied == fp.load_scenario("reversals", overrides)


def test_friction_of_every_joint_and_tendon_is_scaled_alike():
    uneven = {"finger.joint_friction.coulomb": [1e-4, 2e-4, 3e-4, 4e-4], "finger.joint_friction.stiction": 5e-4}
    law = with_joint_friction(fp.load_scenario("reversals", uneven), 0.5).finger.joint_friction
    assert law.coulomb == pytest.approx((5e-5, 1e-4, 1.5e-4, 2e-4))
    assert law.stiction == pytest.approx(2.5e-4)


def test_at_another_speed_the_motion_is_the_same_in_stretched_time(fig6_scenario, routing):
    quick = at_speed(fig6_scenario, 4.0)
    times = np.linspace(0.0, 2.0, 50)
    np.testing.assert_allclose(
        SignalReference.from_scenario(quick, routing).at(times).position,
        SignalReference.from_scenario(fig6_scenario, routing).at(4.0 * times).position,
        atol=1e-12,
    )
    assert quick.simulation.duration == 2.0
    assert len(quick.sample_times()) == len(fig6_scenario.sample_times())


def test_the_internal_tension_of_the_passive_tendon_is_the_null_vector_by_hand(fig6_scenario):
    """(1, 1, 4.32, 3.02, 3.20) is in the null space of H_c^T, so at f0 = 1 N the plan for T5 is 3.2 N."""
    assert internal_passive_tension(fig6_scenario) == pytest.approx((3.2,), rel=1e-6)
    assert internal_passive_tension(with_minimum_tension(fig6_scenario, 2.0)) == pytest.approx((6.4,), rel=1e-6)


def test_the_swing_moves_all_joints_their_amplitudes_in_the_directions_that_lock_first(fig6_scenario, routing):
    swing = swinging_to_lock(fig6_scenario)
    start, end = (
        SignalReference.from_scenario(swing, routing).at(t).position for t in (0.0, swing.simulation.duration)
    )
    np.testing.assert_allclose(np.abs(end - start), np.deg2rad([16.0, 50.0, 50.0, 35.0]), rtol=1e-6)
    # Abduction may go either way: T1 and T2 are mirror images.
    assert abs(np.sign(end - start)[1:] @ [1, -1, -1]) == 3
