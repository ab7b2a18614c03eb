"""Forward kinematics against equation (1) written out, and against yourdfpy reading the generated URDF."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import load_finger
from finger_pin.mechanism.bodies import build_rigid_body
from finger_pin.mechanism.urdf import to_urdf
from finger_pin.typing import Array
from validation.check import Check, Comparison, Section, compare, skipped

TITLE = "Forward kinematics"
POSTURES = 1000
TOLERANCE = 1e-12


def equation_1(lengths: Sequence[float], theta: Array) -> Array:
    """Return the fingertip of (1), shape (3,), m: C is cosine and S is sine, angles add up along the finger."""
    a1, a2, a3, a4 = lengths
    t2, t23, t234 = np.cumsum(theta[1:])
    reach = a1 + a2 * np.cos(t2) + a3 * np.cos(t23) + a4 * np.cos(t234)
    height = a2 * np.sin(t2) + a3 * np.sin(t23) + a4 * np.sin(t234)
    return np.array([np.cos(theta[0]) * reach, np.sin(theta[0]) * reach, height])


def planar_tip(lengths: Sequence[float], theta: Array) -> Array:
    """Return the fingertip of the two-joint finger in the x-y plane, shape (3,), m, written out."""
    (l1, l2), (t1, t12) = lengths, np.cumsum(theta)
    return np.array([l1 * np.cos(t1) + l2 * np.cos(t12), l1 * np.sin(t1) + l2 * np.sin(t12), 0.0])


FINGERS: dict[str, Callable[[Sequence[float], Array], Array]] = {
    "ub_stand_in": equation_1,
    "dexmart_index": equation_1,
    "planar": planar_tip,
}


def postures(finger: FingerDescription) -> Array:
    """Return random postures, shape (1000, n), rad."""
    return np.random.default_rng(1).uniform(-np.pi, np.pi, (POSTURES, len(finger.joints)))


def tips_by_pinocchio(finger: FingerDescription) -> Array:
    """Return the fingertip by our rigid body, shape (1000, 3), m."""
    body = build_rigid_body(finger)
    return np.array([body.tip_position(theta) for theta in postures(finger)])


def read_by_yourdfpy(urdf: str) -> Any:
    """Read a URDF from memory with an independent reader."""
    import yourdfpy

    robot = yourdfpy.URDF.load(io.BytesIO(urdf.encode()))
    assert robot.validate(), robot.errors
    return robot


def tips_by_yourdfpy(finger: FingerDescription) -> Array:
    """Return the fingertip by yourdfpy on the generated URDF, shape (1000, 3), m."""
    robot, tips = read_by_yourdfpy(to_urdf(finger)), []
    for theta in postures(finger):
        robot.update_cfg(theta)
        tips.append(robot.get_transform("fingertip", "base")[:3, 3])
    return np.array(tips)


def tips_by_formula(finger: FingerDescription, formula: Callable[[Sequence[float], Array], Array]) -> Array:
    """Return the fingertip by a formula, shape (1000, 3), m."""
    lengths = [joint.link.length for joint in finger.joints.values() if joint.link is not None]
    return np.array([formula(lengths, theta) for theta in postures(finger)])


def measure() -> Section:
    """Compare the fingertip of every shipped finger at random postures."""
    checks: list[Check] = []
    for name, formula in FINGERS.items():
        finger = load_finger(name)
        exact = tips_by_formula(finger, formula)
        source = "equation (1)" if formula is equation_1 else "two links in a plane, written out"
        what = f"fingertip of {name}, {POSTURES} postures"
        checks.append(compare(what, source, Comparison(tips_by_pinocchio(finger), exact).largest, TOLERANCE, "m"))
        if importlib.util.find_spec("yourdfpy") is None:
            checks.append(skipped(f"{what}, from the URDF", "yourdfpy", "yourdfpy is not installed"))
        else:
            gap = Comparison(tips_by_pinocchio(finger), tips_by_yourdfpy(finger)).largest
            checks.append(compare(f"{what}, from the URDF", "yourdfpy", gap, TOLERANCE, "m"))
    return Section.of(checks)
