"""Bristles without a stiffness: they give by a length at any level, and what sticks stays."""

import numpy as np
import pytest
from scipy.integrate import quad

import finger_pin as fp
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings, bristles
from finger_pin.description.parameters import per_item
from finger_pin.laws.bristle import bristle_deflection, bristle_energy, bristle_stiffness, stiction_rate
from finger_pin.laws.bristle_slip import slip_level, slip_steepness
from finger_pin.laws.capstan import capstan_coefficient

GIVE = {TendonFrictionSettings: 20e-6, JointFrictionSettings: 1e-3}
NO_PIN = {"finger.joint_friction.coulomb": 0.0, "finger.joint_friction.stiction": 0.0}


@pytest.mark.parametrize("kind", GIVE)
@pytest.mark.parametrize("level", [1e-3, 1e-1, 1e1, 1e3])
@pytest.mark.parametrize("declared", [True, False], ids=["drag", "load"])
def test_at_four_fifths_of_any_level_bristles_have_given_by_a_length(kind, level, declared):
    """By (9a) without inertia dF / dx = sigma_0 (F) (1 - F / level)."""
    numbers = bristles(kind(), per_item(kind(), 1), level if declared else 0.0)
    stiffness, hardening = numbers["stiffness"][0], numbers["hardening"][0]
    by_share = lambda f: level / (bristle_stiffness(f * level, stiffness, hardening) * (1.0 - f))  # noqa: E731
    given = quad(by_share, 0.0, 0.8, limit=500)[0]
    assert given < 1.7 * GIVE[kind]
    stiff = kind(stiffness=3.0)
    assert not bristles(stiff, per_item(stiff, 1), level)["hardening"].any()


def test_energy_and_length_of_hardening_bristles_are_integrals_of_their_stiffness():
    for force, stiffness, hardening in ((3.0, 50.0, 40.0), (0.01, 50.0, 40.0), (3.0, 50.0, 0.0)):
        softness = lambda f, s=stiffness, h=hardening: 1.0 / bristle_stiffness(f, s, h)  # noqa: E731
        energy = quad(lambda f, of=softness: f * of(f), 0.0, force)[0]
        assert bristle_energy(force, stiffness, hardening) == pytest.approx(energy, rel=1e-9)
        assert bristle_deflection(force, stiffness, hardening) == pytest.approx(quad(softness, 0.0, force)[0], rel=1e-9)


@pytest.mark.parametrize("level", [1e-2, 0.5, 50.0])
@pytest.mark.parametrize("declared", [True, False], ids=["drag", "load"])
def test_a_joint_under_four_fifths_of_its_level_creeps_by_less_than_1e_4_in_a_second(level, declared):
    """The level is a drag, or what the cord's tension makes on the pin: its arm is then 0.8 of the coefficient.

    A level that grows with the load slips all the way: x = integral of dF / (sigma_0 (F) (1 - 0.8)).
    """
    radius = 0.02
    stays = 1e-3 if declared else 1.05 * bristle_deflection(0.8 * level, 5.0, 1e4) / 0.2
    friction = {"drag": level} if declared else {"coulomb": radius / 0.8, "stiction": radius / 0.8}
    keys = {
        "finger.tendon_friction.coulomb": 0.0,
        "finger.joints.drum.spring.stiffness": 0.0,
        "controller.tensions.T1.height": 0.8 * level / radius,
        "controller.tensions.T1.duration": 0.5,
        "simulation.duration": 2.0,
    }
    keys |= (NO_PIN if declared else {}) | {f"finger.joint_friction.{name}": value for name, value in friction.items()}
    result = fp.simulate(fp.load_scenario("canal", keys)).joint_position.sel(joint="drum")
    after = [float(result.sel(time=time, method="nearest")) for time in (1.0, 2.0)]
    assert 0.0 < after[0] < stays and abs(after[1] - after[0]) < 1e-4


@pytest.mark.parametrize("coulomb", [0.05, 0.35, 0.5])
@pytest.mark.parametrize("turns", [0.1, 1.5, 3.0])
def test_a_cord_delivers_the_capstan_law_round_any_number_of_turns(turns, coulomb):
    """Bristles of length delta = 2 um lag by 2 delta / x of what arrives, 0.4 % after a millimetre."""
    phi = 2.0 * np.pi * turns
    arrives = np.exp(-coulomb * phi)
    keys = {
        "finger.tendon_friction.coulomb": coulomb,
        "finger.tendon_friction.stiffness": "none",
        "finger.tendons.T1.curvature_offset": phi,
        "finger.joints.drum.spring.stiffness": min(0.8, 18.0 * arrives),
        "controller.tensions.T1.height": 55.0,
    }
    result = fp.simulate(fp.load_scenario("canal", keys | NO_PIN)).sel(time=3.1, method="nearest")
    assert float(result.joint_position[0]) * 0.02 > 6e-4
    assert float(result.tendon_tension[0] / result.tendon_command[0]) == pytest.approx(arrives, rel=0.01)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_slip_of_bristles_takes_energy_under_any_load_and_settles_at_the_level(way):
    """Over random loads and motions, what (9a) takes, F v less the bristles' own power, is never negative."""
    rng = np.random.default_rng(7)
    coefficient = capstan_coefficient(0.5, rng.uniform(0.0, 30.0, 1000))
    steepness, level = slip_steepness(coefficient, 1.0), 10.0 ** rng.uniform(-3.0, 2.0, 1000)
    force = level * rng.uniform(-3.0, 3.0, 1000)
    stiffness = bristle_stiffness(force, 5e4, 5e5)
    rate = stiction_rate(force, way, slip_level(force, level, steepness), stiffness)
    assert np.all(force * way - force * rate / stiffness >= 0.0)
    settled = stiction_rate(way * level, way, slip_level(way * level, level, steepness), stiffness)
    np.testing.assert_allclose(settled / stiffness, 0.0, atol=1e-12)
    np.testing.assert_array_equal(slip_level(force, level, slip_steepness(coefficient, 0.0)), level)
