"""Self-locking in words: the limits of a finger's joint friction, with or without that of its tendons."""

from __future__ import annotations

import numpy as np

from finger_pin.analysis import SelfLockingMap, SelfLockingMargin, SpringReturn, critical_friction, self_locking_margin
from finger_pin.description.scenario import Scenario
from finger_pin.views.summary import table

# A margin below this is none.
_LEAST_MARGIN = 1e-9


def summarize_locking(scenario: Scenario, locking_map: SelfLockingMap) -> str:
    """Return the self-locking of a scenario's finger as plain text: critical frictions, postures, actual friction.

    Args:
        scenario: Of a finger with force closure.
        locking_map: The map of its finger.
    """
    finger = scenario.finger
    stiction = finger.numbers["joint_friction"][finger.joint_friction.break_away_entry]
    margins = [(name, critical_friction(finger, joints=[name]).coefficient) for name in finger.joints]
    joint_margin = critical_friction(finger).coefficient
    rows = [
        (name, _millimetres(value), f"{1e3 * actual:.3f}")
        for (name, value), actual in zip(margins, stiction, strict=True)
    ]
    rows.append(("all joints", _millimetres(joint_margin), f"{1e3 * max(stiction):.3f}"))
    paragraphs = [
        [
            "Joint friction at which the finger locks in its worst direction, mm,",
            "without tendon friction, so at any posture alike; and its own, M^c",
            *table(("moving", "locks at", "has"), rows),
        ]
    ]
    least = np.unravel_index(int(np.argmin(locking_map.coefficient)), locking_map.coefficient.shape)
    angles = zip(
        locking_map.joints, (axis[index] for axis, index in zip(locking_map.angles, least, strict=True)), strict=True
    )
    domain = ", ".join(f"{name} {np.rad2deg(angle):.3g} deg" for name, angle in angles)
    if locking_map.uniform:
        domain = f"every posture of {' and '.join(locking_map.joints)}"
    paragraphs.append(
        [
            "With the friction of the tendons, all joints moving in their worst directions, mm:",
            f"  locks at {_millimetres(float(locking_map.coefficient.min()))}, at {domain}",
            f"  {_verdict(locking_map.actual / float(locking_map.coefficient.min()))}",
        ]
    )
    place = f"in the motion of {scenario.name} where it is closest:"
    paragraphs.append([f"With the friction of the tendons, {place}", _closest_posture(self_locking_margin(scenario))])
    if finger.actuators:
        assumption = "With tendons, gears and what motors can pull"
        paragraphs.append([f"{assumption}, {place}", _closest_posture(self_locking_margin(scenario, servos=True))])
    return "\n\n".join("\n".join(paragraph) for paragraph in paragraphs)


def summarize_return(spring_return: SpringReturn) -> str:
    """Return in plain text whether a finger comes back, and the tensions between which the cord holds it."""
    ends = {"least bent": 0, "most bent": -1}
    rows = [
        (
            f"{joint}, {angles}",
            f"{spring_return.winding_in[row, index]:.3g}",
            f"{max(spring_return.letting_out[row, index], 0.0):.3g}",
        )
        for index, joint in enumerate(spring_return.joints)
        for angles, row in ends.items()
    ]
    joint, position = spring_return.worst
    posture = f"{joint} at ({', '.join(f'{value:.3g}' for value in np.rad2deg(position))}) deg"
    message = "it comes back when the cord is let go, from every posture"
    if not spring_return.returns:
        stuck_joints = [
            name
            for name, column in zip(spring_return.joints, spring_return.letting_out.T, strict=True)
            if np.any(column <= 0.0)
        ]
        message = f"it does not come back when the cord is let go: {', '.join(stuck_joints)}"
    return "\n".join(
        [
            f"Springs and bands against {spring_return.cord}, N: the cord moves a joint in from, and lets it back from",
            *table(("joint", "in", "back"), rows),
            "",
            f"  {message}",
            f"  {_return_sentence(spring_return.margin)}",
            f"  tension back over tension in: at least {spring_return.ratio:.3g}, {posture}",
        ]
    )


def _return_sentence(margin: float) -> str:
    if np.isinf(margin):
        return "nothing resists the return once the cord is slack"
    return f"springs, bands and weight are {margin:.3g} times what resists them once the cord is slack"


def _closest_posture(margin: SelfLockingMargin) -> str:
    if not np.isfinite(margin.margin):
        return "  nothing moves, or nothing locks it"
    posture = ", ".join(f"{angle:.3g}" for angle in np.rad2deg(margin.position))
    return f"  {_verdict(1.0 / max(margin.margin, _LEAST_MARGIN))}, at {margin.time:.3g} s and ({posture}) deg"


def _verdict(share: float) -> str:
    """Return a share of the critical friction in words."""
    if share * _LEAST_MARGIN >= 1.0:
        return "it locks, whatever its friction"
    text = "it locks" if share >= 1.0 else "it does not lock"
    return f"{text}: its friction is {share:.3g} times what locks it"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:.3f}" if np.isfinite(length) else "never"
