"""The share that a tendon delivers: the capstan law by hand, over the workspace and along simulated motions."""

import numpy as np
import pytest
import xarray as xr
from paper.transmission import (
    coupling_in_motion,
    flexion_postures,
    transmission_efficiency,
    transmission_in_motion,
    workspace_postures,
)

import finger_pin as fp
from finger_pin.description.routing import ForceClosure


def curvature_by_hand(theta):
    """The routing table of the paper's finger: which joints bend which tendon, beside phi_off."""
    one, two, three, _ = np.abs(theta)
    return np.array([one + 1.0, one + 1.0, two + 0.28, two + three + 0.51, 0.58])


def test_steady_sliding_delivers_by_the_capstan_law_at_every_posture(finger):
    for theta in np.random.default_rng(1).uniform([-0.17, 0, 0, 0], [0.17, 1.5, 1.5, 1.5], (20, 4)):
        found, phi = transmission_efficiency(finger, theta), curvature_by_hand(theta)
        np.testing.assert_allclose(found.pulling, np.exp(-0.11 * phi), rtol=1e-12)
        np.testing.assert_allclose(found.releasing, np.exp(0.11 * phi), rtol=1e-12)
        # Break-away: f^a - f = rho mu^d (f^a + f), with mu^d = tanh(mu_e phi / 2) and rho = 1.5.
        loss = 1.5 * np.tanh(0.055 * phi)
        np.testing.assert_allclose(1.0 - found.least, loss * (1.0 + found.least), rtol=1e-12)
        np.testing.assert_allclose(found.greatest * found.least, 1.0, rtol=1e-12)


def test_a_canal_that_holds_a_tendon_fast_delivers_nothing_at_rest():
    coarse = fp.Finger(fp.load_finger("ub_stand_in", {"finger.tendon_friction.coulomb": 10.0}))
    found = transmission_efficiency(coarse, np.full(4, 0.5))
    assert np.all(found.least == 0.0) and np.all(np.isinf(found.greatest))


def test_postures_of_the_workspace_keep_to_the_ranges_and_to_the_passive_tendon(finger):
    postures = workspace_postures(finger, 5)
    limiter = finger.stroke_limiter
    assert np.all((postures >= limiter.lower - 1e-9) & (postures <= limiter.upper + 1e-9))
    np.testing.assert_allclose(3.5 * postures[:, 2], 5.0 * postures[:, 3], atol=1e-12)
    # 90 degrees of the medial joint need 63 of the distal one: none is left out.
    assert len(postures) == 5**3
    flexed = flexion_postures(finger, 3)
    np.testing.assert_allclose(flexed[2, 1], np.deg2rad([0.0, 90.0, 45.0, 31.5]), atol=1e-12)


def test_without_stribeck_effect_and_viscous_friction_a_motion_slides_by_the_capstan_law(finger):
    calm = {"stribeck_velocity": 1e-6, "viscous": 0.0, "stiction_ratio": 1.0}
    overrides = {f"finger.tendon_friction.{name}": value for name, value in calm.items()}
    result = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 1.5, **overrides}))
    found = transmission_in_motion(finger, result)
    theta = result["joint_position"].values
    for index in range(5):
        sliding = found.sliding[:, index]
        phi = np.array([curvature_by_hand(each)[index] for each in theta[sliding]])
        expected = np.exp(-0.11 * phi * found.direction[sliding, index])
        assert sliding.mean() > 0.3
        assert np.sqrt(np.mean((found.ratio[sliding, index] / expected - 1.0) ** 2)) < 0.01


def test_settled_sliding_is_law_9_with_its_rate_at_zero(finger):
    """F^s = F^n M(v) in (9a), then (9c), (12) and (14), solved for f by iteration."""
    speed, command, phi = 0.004, 5.0, 1.2
    mu = np.tanh(0.055 * phi)
    coefficient = mu * (1.0 + 0.5 * np.exp(-speed / 0.01))
    delivered = command
    for _ in range(100):
        delivered = command - coefficient * (command + delivered) - 1.0 * speed
    column = np.ones((3, 5))
    names = ("tendon_command", "tendon_tension", "tendon_velocity", "tendon_normal_force", "tendon_curvature")
    values = (command, delivered, speed, command + delivered, phi)
    result = xr.Dataset(
        {name: (("time", "tendon"), value * column) for name, value in zip(names, values, strict=True)}
        | {"passive_tension_proximal": ("time", command * column[:, 0])},
        coords={"time": [0.0, 0.1, 0.2]},
    )
    found = transmission_in_motion(finger, result)
    np.testing.assert_allclose(found.settled, delivered / command, rtol=1e-9)
    np.testing.assert_allclose(found.ratio, found.settled, rtol=1e-9)


def test_a_tendon_slides_only_some_bristle_lengths_after_its_reversal(finger):
    """At 10 N and a coefficient of 0.08 a bristle is 0.016 mm long; a speed of 1 mm/s needs five of them: 80 ms."""
    time = np.arange(0.0, 0.4, 0.001)
    speed = np.where(time < 0.2, 1e-3, -1e-3)[:, None] * np.ones(5)
    level = 0.08
    curvature = 2.0 * np.arctanh(level / (1.0 + 0.5 * np.exp(-0.1))) / 0.11
    even = np.ones((len(time), 5))
    result = xr.Dataset(
        {
            "tendon_command": (("time", "tendon"), 5.0 * even),
            "tendon_tension": (("time", "tendon"), 5.0 * even),
            "tendon_velocity": (("time", "tendon"), speed),
            "tendon_normal_force": (("time", "tendon"), 10.0 * even),
            "tendon_curvature": (("time", "tendon"), curvature * even),
            "passive_tension_proximal": ("time", 5.0 * even[:, 0]),
        },
        coords={"time": time},
    )
    sliding = transmission_in_motion(finger, result).sliding
    assert time[np.argmax(sliding[:, 0])] == pytest.approx(0.080, abs=0.002)
    assert not sliding[(time > 0.2) & (time < 0.275)].any()
    assert sliding[time > 0.285].all()


def test_tendon_friction_scales_the_rows_of_the_coupling_and_leaves_force_closure(finger):
    """T3 pulls, exp(-mu phi), T4 is drawn out, exp(mu phi); T5's proximal half pulls, 1 + mu, the distal one yields."""
    theta, velocity = np.array([0.1, 0.5, 0.6, 0.42]), np.array([0.0, 1.0, 1.0, 0.7])
    phi, mu = curvature_by_hand(theta), np.tanh(0.055 * 0.58)
    found = coupling_in_motion(finger.tendons, theta, velocity)
    np.testing.assert_allclose(found[2], [0, 0, 6.3e-3 * np.exp(-0.11 * phi[2]), 0], atol=1e-15)
    np.testing.assert_allclose(found[3], np.array([0, -1, -1, -1]) * 5.3e-3 * np.exp(0.11 * phi[3]), atol=1e-15)
    np.testing.assert_allclose(found[4], [0, 0, -3.5e-3 * (1 + mu), 5e-3 * (1 - mu)], atol=1e-15)
    assert ForceClosure.from_coupling(found, finger.routing.tendons).holds
