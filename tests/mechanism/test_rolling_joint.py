"""A rolling joint, two hinges in a row whose surfaces roll on each other, against its closed form."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.validation import validate

NEAR, FAR, LENGTH = 0.006, 0.009, 0.03
ANCHOR, INSERTION = np.array([-0.01, 0.0075]), np.array([0.012, 0.005])


def rolling_finger(**coupling):
    """A proximal surface of radius `NEAR` about the base, and a distal one of `FAR` that rolls on it."""
    link = {"mass": 0.01, "inertia": [1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0]}
    table = {
        "name": "rolling",
        "gravity": [0.0, 0.0, 0.0],
        "joints": {name: {"range": [-2.0, 2.0]} for name in ("near", "far")},
        "tendons": {"flexor": {"along": "flexor"}},
        "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0},
        "tendon_friction": {"coulomb": 0.0, "viscous": 0.0},
        "tree": {
            "bodies": {
                "bridge": link | {"mass": 1e-4},
                "distal": link | {"parent": "bridge", "position": [NEAR + FAR, 0.0, 0.0], "centre": [0.015, 0.0, 0.0]},
            },
            "joints": {"near": {"body": "bridge"}, "far": {"body": "distal"}},
            "tendons": {
                "flexor": {
                    "path": {
                        "a": {"kind": "point", "position": [*ANCHOR, 0.0]},
                        "b": {"kind": "point", "body": "distal", "position": [*INSERTION, 0.0]},
                    }
                }
            },
            "couplings": {"roll": {"joint": "far", "other": "near", "rolling": [FAR, NEAR], **coupling}},
            "tip": {"body": "distal", "position": [LENGTH, 0.0, 0.0]},
        },
    }
    return validate(fp.FingerDescription, table, ("finger",))


def turned(angle, point):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])


def closed_form(phi):
    """Return tip and length of the tendon where the distal body has turned by phi in all.

    Equal arcs, NEAR alpha = FAR (phi - alpha), turn the line of centres by alpha = phi FAR / (NEAR + FAR).
    """
    alpha = phi * FAR / (NEAR + FAR)
    centre = turned(alpha, (NEAR + FAR, 0.0))
    return centre + turned(phi, (LENGTH, 0.0)), np.linalg.norm(centre + turned(phi, INSERTION) - ANCHOR)


@pytest.mark.parametrize("phi", [-0.9, 0.0, 0.4, 1.3])
def test_tip_and_tendon_are_where_rolling_puts_them(phi):
    hand = fp.Hand(rolling_finger())
    alpha = phi * FAR / (NEAR + FAR)
    q = np.array([alpha, phi - alpha])
    tip, length = closed_form(phi)
    np.testing.assert_allclose(hand.rigid_body.tip_position(q)[:2], tip, atol=1e-14)
    np.testing.assert_allclose(hand.paths.length(q)[0], length, atol=1e-14)
    # The surfaces touch at one point, which is at rest: both move it alike.
    assert NEAR * q[0] == pytest.approx(FAR * q[1], abs=1e-15)


def test_pulled_by_its_tendon_it_rolls_and_its_energy_is_what_the_tendon_gave():
    hand = fp.Hand(rolling_finger(stiffness=1e4, damping=0.0))
    sim = fp.Simulator(hand)
    states = [sim.step([0.2], 1e-3) for _ in range(100)]
    q, v = states[-1].position, states[-1].velocity
    phi = q.sum()
    assert phi > 0.5
    assert q[1] == pytest.approx(NEAR / FAR * q[0], abs=1e-6)
    tip, length = closed_form(phi)
    np.testing.assert_allclose(hand.rigid_body.tip_position(q)[:2], tip, atol=1e-7)
    # What a constant tension gives is its way: all of it is in the motion, as nothing rubs.
    given = 0.2 * (closed_form(0.0)[1] - length)
    mass = hand.rigid_body.mass_matrix(q)
    assert 0.5 * v @ mass @ v == pytest.approx(given, rel=5e-3)


@pytest.mark.parametrize(
    ("entries", "says"),
    [({"ratio": 0.5}, "leave out ratio"), ({"rolling": [0.0, 1.0]}, "rolling"), ({"other": None}, "other")],
)
def test_an_entry_that_contradicts_rolling_is_refused(entries, says):
    with pytest.raises(fp.InputError, match=says):
        rolling_finger(**entries)
