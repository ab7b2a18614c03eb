"""Effect of a drag of tendons and joints on fingertip forces and slow motion, written out for the planar finger."""

from itertools import product

import numpy as np
import pytest
from scipy.linalg import null_space

import finger_pin as fp
from finger_pin.analysis import Friction, force_polytope, largest_force, self_locking_map, tension_for_force
from finger_pin.analysis.locking_loop import FrictionLoop

Q, LENGTHS = np.array([0.4, 0.9]), (0.045, 0.032)
ROWS = np.array([[6.0, 0.0], [2.0, 5.5], [-8.0, -5.5]]) * 1e-3
JACOBIAN = np.array(
    [
        [-LENGTHS[0] * np.sin(0.4) - LENGTHS[1] * np.sin(1.3), -LENGTHS[1] * np.sin(1.3)],
        [LENGTHS[0] * np.cos(0.4) + LENGTHS[1] * np.cos(1.3), LENGTHS[1] * np.cos(1.3)],
    ]
)
# mu phi: of every canal its offset, and the proximal angle where that bends it.
WOUND = 0.11 * np.array([0.3, 0.4 + 0.4, 0.4 + 0.4])


# By how much the drag of joints differs by direction.
MORE = np.array([0.4, -0.25])


def planar(drag, pins=0.0, dry=0.0):
    """Return the planar finger without weight."""
    keys = {"gravity": [0.0, 0.0, 0.0], "tendon_friction.drag": drag, "joint_friction.drag": dry}
    keys |= {"joint_friction.drag_asymmetry": MORE.tolist()}
    keys |= {"joint_friction.coulomb": pins, "joint_friction.stiction": pins}
    return fp.Finger(fp.load_finger("planar", {f"finger.{key}": value for key, value in keys.items()}))


@pytest.mark.slow
@pytest.mark.parametrize(("drag", "dry"), [(0.0, 0.0), (0.5, 0.0), (20.0, 0.0), (0.5, [4e-3, 2e-3])])
def test_a_finger_that_pushes_has_to_pull_as_much_more_as_drag_takes_and_nothing_where_a_tendon_is_idle(drag, dry):
    """Strands pull f = J^T E + s dry (1 + a s) + l (1, 1, 1), none below zero with the least l.

    f = f^a exp(-mu phi) - d / (1 + mu^d) arrives. The rows of H_c add up to nothing; an idle strand needs no command.
    """
    finger, taken = planar(drag, dry=dry), drag / (1.0 + np.tanh(0.5 * WOUND))
    for angle in np.linspace(0.1, 6.2, 12):
        force = 2.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
        torque = JACOBIAN.T @ force[:2]
        strands = np.linalg.lstsq(ROWS.T, torque + (np.sign(torque) + MORE) * dry, rcond=None)[0]
        strands -= strands.min()
        command = np.where(strands > 1e-9, (strands + taken) * np.exp(WOUND), 0.0)
        needed = tension_for_force(finger, Q, force, friction=Friction.HINDERING)
        assert needed.largest == pytest.approx(command.max(), rel=1e-6)
        np.testing.assert_allclose(needed.strands, strands, atol=1e-6)
        most = largest_force(finger, Q, force, needed.largest, friction=Friction.HINDERING)
        assert most == pytest.approx(2.0, rel=1e-6)


def test_passive_tendons_lose_drag_between_their_halves():
    finger = fp.Finger(fp.load_finger("ub_stand_in", {"finger.tendon_friction.drag": 0.4}))
    theta = np.array([0.1, 0.5, 0.6, 0.42])
    found = tension_for_force(finger, theta, [0.3, 0.2, -0.8], friction=Friction.HINDERING)
    sliding = np.tanh(0.5 * finger.tendons.surface * finger.routing.curvature(theta))
    before, after = found.command, found.strands[:4]
    # f^a - f = mu^d (f^a + f) + d, unless nothing arrives.
    np.testing.assert_allclose((before - after - sliding[:4] * (before + after) - 0.4)[after > 1e-9], 0.0, atol=1e-9)
    proximal, distal = found.strands[4:]
    assert min(proximal, distal) > 0.1
    assert abs(proximal - distal) == pytest.approx(sliding[4] * (proximal + distal) + 0.4)


def test_a_finger_that_holds_bears_as_much_more_as_drag_takes():
    """Every f between max(0, f0 exp(-mu phi) - d / (1 + mu^d)) and (f_max + d / (1 + mu^d)) exp(mu phi) can be."""
    taken = 0.5 / (1.0 + np.tanh(0.5 * WOUND))
    ends = (np.maximum(0.0, 1.0 * np.exp(-WOUND) - taken), (10.0 + taken) * np.exp(WOUND))
    strands = np.array([[ends[high][i] for i, high in enumerate(each)] for each in product((0, 1), repeat=3)])
    corners = np.linalg.solve(JACOBIAN.T, (strands @ ROWS).T).T
    found = force_polytope(planar(0.5), Q, 10.0, minimum_tension=1.0, friction=Friction.HELPING)
    for angle in np.linspace(0.0, 6.2, 40):
        towards = np.array([np.cos(angle), np.sin(angle), 0.0])
        assert found.support(towards) == pytest.approx((corners @ towards[:2]).max(), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.5, 3.0])
def test_slow_motion_needs_what_drag_takes_besides(drag):
    """Slowly moving, tensions l k fill the kernel of H_c^T - M s |H_c|^T, of every direction that occurs."""
    pins, least, worst = 3e-4, 1.0, 0.0
    finger = planar(drag, pins)
    loop, at = FrictionLoop.from_tendons(finger.tendons, None), np.full((1, 2), 0.5 * np.pi)
    wound = 0.11 * np.array([0.3, 0.4 + 0.5 * np.pi, 0.4 + 0.5 * np.pi])
    for angle in np.linspace(0.01, 6.29, 200):
        speed = np.array([np.cos(angle), np.sin(angle)])
        signs, way = np.sign(speed), np.sign(ROWS @ speed)
        kernel = null_space(ROWS.T - pins * signs[:, None] * (ROWS.T != 0.0))[:, 0]
        kernel = kernel * np.sign(kernel[0])
        share, taken = np.exp(-way * wound), way * drag / (1.0 + way * np.tanh(0.5 * wound))
        strands = kernel * np.max(np.maximum(0.0, least * share - taken) / kernel)
        command = np.where(strands > 1e-12, (strands + taken) / share, least).max()
        # The controller's own command, found another way.
        found = loop.command_to_move(at, pins * signs[None], way[None], np.full(3, least), np.zeros((1, 2)))
        assert found.max() == pytest.approx(command, rel=1e-6)
        worst = max(worst, command)
    assert self_locking_map(finger, samples=2, minimum_tension=least).tension[1, 1] == pytest.approx(worst, rel=1e-6)


@pytest.mark.parametrize("pins", [0.0, 3e-4])
def test_slow_motion_needs_what_the_joints_drag_takes_besides(pins):
    """In every direction s: (H_c^T - M s |H_c|^T) f = s d (1 + a s) with the least f >= f0, where no tendon rubs."""
    least, dry, worst = 1.0, np.array([6e-3, 2e-3]), 0.0
    finger = planar(0.0, pins, dry.tolist())
    finger = fp.Finger(finger.description.updated(tendon_friction={"coulomb": 0.0}))
    for signs in product((1.0, -1.0), repeat=2):
        balance = ROWS.T - pins * np.array(signs)[:, None] * (ROWS.T != 0.0)
        kernel = null_space(balance)[:, 0]
        kernel, base = kernel * np.sign(kernel[0]), np.linalg.lstsq(balance, (signs + MORE) * dry, rcond=None)[0]
        worst = max(worst, (base + kernel * np.max((least - base) / kernel)).max())
    assert self_locking_map(finger, samples=2, minimum_tension=least).tension.max() == pytest.approx(worst, rel=1e-6)


def test_drag_shifts_no_self_locking():
    """Where tensions run away, what no load makes does not count."""
    ub = {f"finger.joint_friction.{name}": 5e-4 for name in ("coulomb", "stiction")}
    found = [
        fp.analysis.critical_friction(
            fp.Finger(fp.load_finger("ub_stand_in", ub | {"finger.tendon_friction.drag": drag}))
        )
        for drag in (0.0, 2.0)
    ]
    assert found[0].coefficient == found[1].coefficient < np.inf
