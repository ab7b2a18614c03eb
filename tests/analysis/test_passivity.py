"""Micro-damping that can drive motion: the bound by hand, a cycle that gains energy beyond it, and the warning."""

import math

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis.advice import micro_damping_advice
from finger_pin.exceptions import MicroDampingWarning
from finger_pin.laws.bristle import (
    friction_coefficient,
    friction_force,
    friction_level,
    passive_micro_damping,
    stiction_rate,
)
from finger_pin.views.summary import summarize

LAW = {"kinetic": 1.0, "static": 1.5, "stribeck": 0.05}


def worst_power(micro, viscous, stiffness=1e5):
    """Return the least of F^f v - d/dt(F^s^2 / 2 sigma_0) over states with |F^s| <= F^n M^c, F^n = 1."""
    stiction, velocity = np.meshgrid(np.linspace(-1.5, 1.5, 601), np.linspace(-50.0, 50.0, 801))
    level = friction_level(1.0, friction_coefficient(velocity, *LAW.values()), 1e-9)
    rate = stiction_rate(stiction, velocity, level, stiffness)
    force = friction_force(stiction, velocity, viscous, rate, micro / stiffness)
    return np.min(force * velocity - stiction * rate / stiffness)


def test_up_to_the_bound_no_state_gives_energy_back_and_above_it_some_do():
    """Barabanov and Ortega: b >= sigma_1 (M^c - M^d) / M^d."""
    most = float(passive_micro_damping(2.0, LAW["kinetic"], LAW["static"]))
    assert most == pytest.approx(4.0)
    assert worst_power(most, 2.0) >= -1e-12
    assert worst_power(1.2 * most, 2.0) < -0.5


def test_without_stribeck_effect_any_micro_damping_is_passive():
    assert passive_micro_damping(0.0, 1.0, 1.0) == math.inf
    assert passive_micro_damping(0.0, 1.0, 1.5) == 0.0


def test_a_simulation_with_more_than_the_bound_warns_once_and_its_summary_says_so():
    """Tendons: rho = 1.5 and b = 1 N s/m allow 2 N s/m."""
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.01, "finger.tendon_friction.micro_damping": 2.1})
    with pytest.warns(
        MicroDampingWarning, match=r"micro_damping = 2.1 can drive the motion of T1.* up to 2 "
    ) as caught:
        result = fp.simulate(scenario)
    assert len(caught) == 1 and caught[0].filename == __file__
    assert "can drive the motion of T1" in " ".join(summarize(result).split())


@pytest.mark.parametrize(
    ("key", "value", "name"),
    [
        ("finger.tendon_friction.micro_damping", [2.0, 2.0, 2.0, 2.01, 2.0], "T4"),
        ("finger.joint_friction.micro_damping", [2.4e-3, 2.4e-3, 2.6e-3, 2.4e-3], "medial"),
    ],
)
def test_the_one_that_is_beyond_its_bound_is_named(key, value, name):
    """Joints: M^d = 2.5e-4, M^c = 3.5e-4 m and b = 1e-3 allow 2.5e-3 N m s/rad."""
    advice = micro_damping_advice(fp.load_finger("ub_stand_in", {key: value}))
    assert f"the motion of {name}:" in advice and ";" not in advice


def test_the_paper_s_finger_and_one_at_the_bound_say_nothing():
    assert micro_damping_advice(fp.load_finger("ub_stand_in")) == ""
    assert micro_damping_advice(fp.load_finger("ub_stand_in", {"finger.tendon_friction.micro_damping": 2.0})) == ""
