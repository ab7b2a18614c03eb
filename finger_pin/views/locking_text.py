"""Self-locking in words: the limits of a finger's joint friction, with or without that of its tendons."""

from __future__ import annotations

import numpy as np

from finger_pin.analysis import SelfLockingMap, SelfLockingMargin, critical_friction, self_locking_margin
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import expand
from finger_pin.views.summary import table

# A margin below this is none.
_LEAST = 1e-9


def summarize_locking(scenario: Scenario, found: SelfLockingMap) -> str:
    """Return the self-locking of a scenario's finger as plain text: critical frictions, postures, its own.

    Args:
        scenario: Of a finger with force closure.
        found: The map of its finger.

    Raises:
        InputError: If there is no force closure.
    """
    finger = scenario.finger
    static = expand(finger.joint_friction.break_away, len(finger.joints))
    alone = [(name, critical_friction(finger, joints=[name]).coefficient) for name in finger.joints]
    together = critical_friction(finger).coefficient
    rows = [(name, _millimetres(value), f"{1e3 * own:.3f}") for (name, value), own in zip(alone, static, strict=True)]
    rows.append(("all joints", _millimetres(together), f"{1e3 * max(static):.3f}"))
    blocks = [
        [
            "Joint friction at which the finger locks in its worst direction, mm,",
            "without tendon friction, so at any posture alike; and its own, M^c",
            *table(("moving", "locks at", "has"), rows),
        ]
    ]
    least = np.unravel_index(int(np.argmin(found.coefficient)), found.coefficient.shape)
    angles = zip(found.joints, (axis[index] for axis, index in zip(found.angles, least, strict=True)), strict=True)
    where = ", ".join(f"{name} {np.rad2deg(angle):.3g} deg" for name, angle in angles)
    if found.uniform:
        where = f"every posture of {' and '.join(found.joints)}"
    blocks.append(
        [
            "With the friction of the tendons, all joints moving in their worst directions, mm:",
            f"  locks at {_millimetres(float(found.coefficient.min()))}, at {where}",
            f"  {_verdict(found.actual / float(found.coefficient.min()))}",
        ]
    )
    place = f"in the motion of {scenario.name} where it is closest:"
    blocks.append([f"With the friction of the tendons, {place}", _closest(self_locking_margin(scenario))])
    if finger.actuators:
        what = "With tendons, gears and what motors can pull"
        blocks.append([f"{what}, {place}", _closest(self_locking_margin(scenario, servos=True))])
    return "\n\n".join("\n".join(block) for block in blocks)


def _closest(margin: SelfLockingMargin) -> str:
    if not np.isfinite(margin.margin):
        return "  nothing moves, or nothing locks it"
    posture = ", ".join(f"{each:.3g}" for each in np.rad2deg(margin.position))
    return f"  {_verdict(1.0 / max(margin.margin, _LEAST))}, at {margin.time:.3g} s and ({posture}) deg"


def _verdict(share: float) -> str:
    """Return a share of the critical friction in words."""
    if share * _LEAST >= 1.0:
        return "it locks, whatever its friction"
    what = "it locks" if share >= 1.0 else "it does not lock"
    return f"{what}: its friction is {share:.3g} times what locks it"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:.3f}" if np.isfinite(length) else "never"
