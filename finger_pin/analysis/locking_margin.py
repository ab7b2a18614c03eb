"""The margin of a scenario to self-locking on its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.analysis.locking import sliding_velocity
from finger_pin.analysis.locking_loop import FrictionLoop
from finger_pin.analysis.printing import BriefRepr
from finger_pin.analysis.servo_limits import gear_shares, tension_limits
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.tendons import Tendons
from finger_pin.references.reference import LoopReference, SignalReference
from finger_pin.typing import Array, Indices

#: Below this margin a simulation warns: friction then multiplies tensions about sixfold.
CLOSE_TO_LOCKING = 1.2
# Cases of a simulation's warning: combinations of directions times cases of slack passive tendons.
_WARNING_CASES = 48
# Search for the friction that motors cannot overcome: greatest share of the critical one, greatest multiple of the
# finger's own, and number of bisections.
_CRITICAL_SHARE, _MAX_SCALE, _BISECTIONS = 0.95, 1e3, 8


@dataclass(frozen=True, eq=False, repr=False)
class SelfLockingMargin(BriefRepr):
    """The margin of a scenario to self-locking.

    Attributes:
        margin: Factor by which every M^c could be raised until the finger locks somewhere on its reference; infinite
            where nothing moves or nothing locks.
        time: Time of the least margin, s.
        position: theta^d there, shape (n,), rad.
        directions: Directions of the joints there, shape (n,).
    """

    margin: float
    time: float
    position: Array
    directions: Array


def self_locking_margin(
    scenario: ScenarioLike,
    samples: int = 500,
    maximum_cases: int | None = None,
    servos: bool = False,
    reference: LoopReference | None = None,
) -> SelfLockingMargin:
    """Return the margin to self-locking along a scenario's reference.

    The stiction coefficients M^c are scaled in proportion, joints and tendons move as the reference does, tendons rub
    with mu^d at its postures and passive tendons are elastic under the controller's gain. Every combination of
    directions that occurs is looked at where the tendons that go with it are bent least and where they are bent most.
    Against joints that keep sliding, whose friction is M^d, the margin is the larger by M^c / M^d.

    Args:
        scenario: The scenario, its name, or the path of a file.
        samples: Instants of the reference; directions that last for less than their distance may be missed.
        maximum_cases: Greatest number of combinations to look at, those that seem closest to locking; all by default.
            A finger of many joints has hundreds, and each costs as many eigenvalue problems as there are tendons.
        servos: Whether gears and the limits of motors count: then the finger is also locked from where the tensions
            that would move it slowly, with passive tendons as planned, are more than a motor can pull.
        reference: Of one finger, where it is built already.

    Of a hand it is that of the finger that is closest, with the position and the directions of its own joints.
    """
    parts = load_scenario(scenario).parts()
    if len(parts) > 1:
        return min(
            (self_locking_margin(part, samples, maximum_cases, servos=servos) for part in parts.values()),
            key=lambda candidate: candidate.margin,
        )
    scenario = next(iter(parts.values()))
    tendons = Tendons.from_description(scenario.finger)
    routing = tendons.routing
    # Midpoints: a reference that starts or ends at rest moves there.
    times = scenario.simulation.duration * (np.arange(samples) + 0.5) / samples
    motion = (reference or SignalReference.from_scenario(scenario, routing)).at(times)
    size = len(routing.joints)
    # What stands still but for rounding does not move.
    speed = np.where(np.abs(motion.velocity) > 1e-12, motion.velocity, 0.0)
    directions = np.sign(np.hstack([speed, sliding_velocity(tendons, speed)]))
    cases = _extreme_bends(directions, (np.abs(motion.position) @ routing.curvature_matrix.T).sum(axis=1))
    signs, sliding = directions[cases, :size], directions[cases, size:]
    weights = signs * scenario.finger.numbers["joint_friction"][scenario.finger.joint_friction.break_away_entry]
    gain = scenario.numbers["gain"]
    # Without gain there is no lag that would say what passive tendons carry: they count as planned.
    gears = gear_shares(scenario.finger) if servos else np.ones((2, routing.actuated))
    loop = FrictionLoop.from_tendons(
        tendons, gain if np.all(gain > 0.0) else None, np.where(np.isfinite(gears), gears, 1.0)
    )
    if maximum_cases is not None and len(cases) > maximum_cases:
        worst_first = np.argsort(-loop.growth(motion.position[cases], weights, sliding), kind="stable")[:maximum_cases]
        cases, signs, sliding, weights = (each[worst_first] for each in (cases, signs, sliding, weights))
    kappa = loop.critical(motion.position[cases], weights, sliding)[0]
    if servos:
        kappa = _movable_scale(scenario, loop, motion.position[cases], weights, signs, sliding, kappa)
        # Gears that no load turns let no tendon out, whatever joints do.
        not_backdrivable = (sliding[:, : routing.actuated] < 0.0) & np.isinf(gears[1])
        kappa = np.where(not_backdrivable.any(axis=1), 0.0, kappa)
    worst = int(np.argmin(kappa))
    sample = cases[worst]
    return SelfLockingMargin(float(kappa[worst]), float(times[sample]), motion.position[sample], signs[worst])


def _extreme_bends(directions: Array, bend: Array) -> Indices:
    """Return the samples, one or two for every combination of directions, (m, k), with its least and greatest bend."""
    # Ordered by directions, then by bend: the first and the last of every combination.
    order = np.lexsort((bend, *directions.T))
    steps = np.flatnonzero(np.any(np.diff(directions[order], axis=0) != 0.0, axis=1))
    return np.asarray(order[np.unique(np.concatenate([[0], steps, steps + 1, [len(order) - 1]]))])


def _movable_scale(
    scenario: Scenario,
    loop: FrictionLoop,
    position: Array,
    weights: Array,
    signs: Array,
    sliding: Array,
    critical: Array,
) -> Array:
    """Return the scale of joint friction, shape (m,), up to which motors can move the finger slowly.

    Where that is close to the critical scale, it is the critical one.
    """
    finger = Finger(scenario.finger)
    limits, actuated = np.array(tension_limits(finger)), finger.routing.actuated
    minimum = scenario.numbers["minimum_tension"]
    weight = np.array([finger.static_torque(each) for each in position])
    drag = signs * finger.joint_friction.break_away_drag(signs)

    def within_limits(scale: Array, indices: NDArray[np.int64]) -> NDArray[np.bool_]:
        case, load = scale[:, None] * weights[indices], weight[indices] + scale[:, None] * drag[indices]
        command = loop.command_to_move(position[indices], case, sliding[indices], minimum, load)[:, :actuated]
        # What gears take is in the limit, and in the share of what is let out.
        return np.asarray(np.all(command * loop.gears[0] <= limits, axis=1), dtype=bool)

    # Close to critical, tensions grow without bound and take long to find.
    upper_scale = _CRITICAL_SHARE * np.minimum(critical, _MAX_SCALE)
    limited = np.flatnonzero(~within_limits(upper_scale, np.arange(len(position))))
    low, high = np.zeros(len(limited)), upper_scale[limited]
    for _ in range(_BISECTIONS if len(limited) else 0):
        middle = 0.5 * (low + high)
        movable = within_limits(middle, limited)
        low, high = np.where(movable, middle, low), np.where(movable, high, middle)
    scale = critical.copy()
    scale[limited] = low
    return scale


def quick_margin(scenario: Scenario, reference: LoopReference | None = None) -> float:
    """Return the margin to self-locking along a scenario's reference, at a cost that is bounded.

    Of many combinations of directions only those that seem closest to locking are looked at.

    Args:
        scenario: The scenario.
        reference: Its reference, where it is built already.
    """
    margin = np.inf
    # Parameters at the edge of what numbers hold have no margin: warnings of arithmetic would not help.
    with np.errstate(all="ignore"):
        parts = scenario.parts().values()
        for part in parts:
            maximum_cases = max(1, _WARNING_CASES // 2 ** len(part.finger.passive_names))
            part_reference = reference if len(parts) == 1 else None
            margin = min(
                margin, self_locking_margin(part, maximum_cases=maximum_cases, reference=part_reference).margin
            )
    return margin


def locking_advice(margin: float) -> str:
    """Return the warning about a narrow margin, in one line; empty for a wide one."""
    if not margin < CLOSE_TO_LOCKING:
        return ""
    if margin < 1.0:
        share = f"{1.0 / margin:.3g} times" if margin > 0.0 else "far above"
        return f"joint friction is {share} what locks the finger: tensions run away"
    return f"joint friction is {100.0 / margin:.0f} % of what locks the finger: tensions multiply"
