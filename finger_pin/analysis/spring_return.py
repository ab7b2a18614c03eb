"""The tensions between which a cord holds a finger that springs return, and whether it comes back when let go.

At a posture a joint needs the torque n of springs, bands and weight, along the way in which the cord turns it. By (9),
(14), (16) and (17), with the arm r, the load l on its pin per tension and a spring's hysteresis h, it moves

    in from   f (r - M^c l) = n + h + d on,   f = f^a exp(-mu_e phi)
    out from  f (r + M^c l) = n - h - d on,   f = f^a exp(mu_e phi)

with the drag d of the joint in that direction, and that of the tendon as in `Tendons.in_sliding`. In between it stays.
Where r <= M^c l no tension moves it in; where n <= h + d it does not come back, however slack the cord.

The torque of `Bands` is in n as that of springs, and their friction and hysteresis in d, with M^c times their tension,
which presses the pin.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from finger_pin.analysis.bands import Bands
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, one_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array, Indices

# Greatest number of postures, and least and greatest number of angles per joint.
_MAX_POSTURES, _MIN_PER_JOINT, _MAX_PER_JOINT = 600, 2, 8
# Tension that winds in a finger whose band is slack, N.
_LEAST_TENSION = 1e-300


@dataclass(frozen=True, eq=False, repr=False)
class SpringReturn(BriefRepr):
    """The tensions between which a cord holds a finger, over its postures.

    Attributes:
        cord: Name of the tendon.
        joints: Names of the joints that it crosses, k of them.
        positions: theta, shape (m, n), rad: shares of every joint's travel from its rest on.
        winding_in: f^a from which each joint moves with the cord, shape (m, k), N; infinite where friction locks it.
        letting_out: f^a below which each joint moves back, shape (m, k), N; not positive where it does not come back.
        margins: Torque of springs and weight over what resists the return with a slack cord, shape (m, k); infinite
            where nothing does that no load makes.
    """

    cord: str
    joints: tuple[str, ...]
    positions: Array
    winding_in: Array
    letting_out: Array
    margins: Array

    @property
    def returns(self) -> bool:
        """Whether every joint comes back from every posture when the cord is let go."""
        return bool(np.all(self.letting_out > 0.0))

    @property
    def margin(self) -> float:
        """Factor by which springs exceed the resistance to the return, at the worst joint and posture."""
        return float(self.margins.min())

    @property
    def _ratios(self) -> Array:
        return self.letting_out / np.maximum(self.winding_in, _LEAST_TENSION)

    @property
    def ratio(self) -> float:
        """Ratio of the least tension on the way out to that on the way in.

        It is 1 without friction, and 0 where a joint stays.
        """
        return max(0.0, float(self._ratios.min()))

    @property
    def worst(self) -> tuple[str, Array]:
        """The joint with the least ratio, and its posture, shape (n,), rad."""
        posture, joint = divmod(int(np.argmin(self._ratios)), len(self.joints))
        return self.joints[joint], self.positions[posture]


def spring_return(finger: FingerLike, cord: str | None = None) -> SpringReturn:
    """Return the tensions between which a cord holds a finger that springs return.

    Counts as if all bends of the cord slid the same way, with mu^d; joints let go at M^c, one by one. Other actuated
    tendons are slack. Passive tendons and springs of a tree's tendons are bands, which pull joints against the cord.

    Args:
        finger: One finger, its description, its name, or the path of its file.
        cord: Name of an actuated tendon; by default the only one.

    Raises:
        InputError: If there is no such tendon, a joint that it crosses has neither spring nor band, or another tendon
            is no band (`Bands.against`): what it pulls with does not follow from the posture.
    """
    finger = as_finger(finger)
    one_finger(finger.description)
    routing, index = finger.routing, _index(finger, cord)
    crossed = np.flatnonzero(routing.coupling[index])
    names = tuple(routing.joints[joint] for joint in crossed)
    sign = np.sign(routing.coupling[index])
    bands = Bands.against(finger, index)
    banded = np.any(bands.arms, axis=0)
    without_spring = [
        routing.joints[k] for k in crossed if not (finger.description.joints[routing.joints[k]].spring or banded[k])
    ]
    if not names:
        raise InputError("cord", "must cross a joint at the same radius in every posture", routing.tendons[index])
    if without_spring:
        raise InputError(
            "finger.joints", f"need a spring or a passive tendon to come back, see {', '.join(without_spring)}"
        )
    positions, arms = _postures(finger, crossed, sign), np.abs(routing.coupling[index, crossed])
    pins, held = finger.joint_friction, np.array([finger.static_torque(each) for each in positions])
    demand = (sign * (held + bands.pull(positions, 0.0)[0]))[:, crossed]
    friction_in, friction_out = (_resistance(bands, positions, sign, side)[:, crossed] for side in (1.0, -1.0))
    pin_arm = (pins.static * pins.loads[:, index])[crossed]
    inward, outward = (_transmission(finger, positions, index, crossed, side) for side in (1.0, -1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        moving = np.maximum(demand + friction_in, 0.0) / np.maximum(arms - pin_arm, 0.0)
        delivered = np.where(arms > pin_arm, moving, np.inf)
        # What the cord's drag leaves when nothing pulls.
        resistance = friction_out - outward[1] * (arms + pin_arm)
        margins = np.where(resistance > 0.0, demand / resistance, np.where(demand > 0.0, np.inf, 0.0))
    return SpringReturn(
        cord=routing.tendons[index],
        joints=names,
        positions=positions,
        winding_in=(delivered + inward[1]) / inward[0],
        letting_out=((demand - friction_out) / (arms + pin_arm) + outward[1]) / outward[0],
        margins=margins,
    )


def _index(finger: Finger, cord: str | None) -> int:
    """Return the index of a cord."""
    routing = finger.routing
    names = routing.tendons[: routing.actuated]
    if not names:
        raise InputError("finger.tendons", "must have an actuated one, against which springs return")
    if cord is None and len(names) != 1:
        raise InputError("cord", f"must be one of {', '.join(names)}")
    if cord is not None and cord not in names:
        raise InputError("cord", f"must be one of {', '.join(names)}{suggestion(cord, names)}", cord)
    return 0 if cord is None else names.index(cord)


def _resistance(bands: Bands, positions: Array, sign: Array, side: float) -> Array:
    """Return what resists joints beside the cord's load, shape (m, n), N m: drag, hysteresis, friction of bands."""
    pins, springs = bands.finger.joint_friction, bands.finger.springs
    hysteresis = springs.hysteresis * np.abs(springs.torque(positions, np.zeros_like(positions)))
    torque, load = bands.pull(positions, side)
    rubbing = side * sign * (torque - bands.pull(positions, 0.0)[0]) + pins.static * load
    resistance: Array = hysteresis + pins.break_away_drag(side * sign) + rubbing
    return resistance


def _transmission(finger: Finger, positions: Array, index: int, crossed: Indices, side: float) -> tuple[Array, Array]:
    """Return the share of the tension that arrives at joints, and the tension lost to drag, shape (m, k) each."""
    sliding = np.zeros((len(positions), len(finger.routing.tendons)))
    sliding[:, index] = side
    share, drag = finger.tendons.in_sliding(positions, sliding)
    return share[:, index, crossed], drag[:, index, crossed]


def _postures(finger: Finger, crossed: Indices, sign: Array) -> Array:
    """Return postures with every joint at shares of its travel from the rest of its spring to the end of its range."""
    limiter, springs = finger.stroke_limiter, finger.springs
    rest = np.clip(springs.rest, limiter.lower, limiter.upper)
    travel = np.where(sign > 0.0, limiter.upper, limiter.lower) - rest
    count = int(np.clip(_MAX_POSTURES ** (1.0 / len(crossed)), _MIN_PER_JOINT, _MAX_PER_JOINT))
    shares = np.array(list(product(np.arange(1, count + 1) / count, repeat=len(crossed))))
    postures = np.repeat(rest[None], len(shares), axis=0)
    postures[:, crossed] += shares * travel[crossed]
    return postures
