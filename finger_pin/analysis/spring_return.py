"""The tensions between which a cord holds a finger that springs return, and whether it comes back when let go.

At a posture a joint needs the torque n of springs and weight, along the way in which the cord turns it. By (9), (14),
(16) and (17), with the arm r, the load l on its pin per tension and a spring's hysteresis h, it moves

    in from   f (r - M^c l) = n + h + d on,   f = f^a exp(-mu_e phi)
    out from  f (r + M^c l) = n - h - d on,   f = f^a exp(mu_e phi)

with the drag d of the joint in that direction, and that of the tendon as in `Tendons.in_sliding`. In between it stays.
Where r <= M^c l no tension moves it in; where n <= h + d it does not come back, however slack the cord.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, one_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array, Indices

# Postures at most, and of a joint at least and at most.
_POSTURES, _FEWEST, _MOST = 600, 2, 8


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
    def ratio(self) -> float:
        """Least tension on the way out over that on the way in: 1 without friction, 0 where a joint stays."""
        return float(np.min(np.maximum(self.letting_out, 0.0) / self.winding_in))

    @property
    def worst(self) -> tuple[str, Array]:
        """The joint with the least ratio, and its posture, shape (n,), rad."""
        at, joint = divmod(int(np.argmin(self.letting_out / self.winding_in)), len(self.joints))
        return self.joints[joint], self.positions[at]


def spring_return(finger: FingerLike, cord: str | None = None) -> SpringReturn:
    """Return the tensions between which a cord holds a finger that springs return.

    Counts as if all bends of the cord slid the same way, with mu^d; joints let go at M^c. Other tendons are slack.

    Args:
        finger: One finger, its description, its name, or the path of its file.
        cord: Name of an actuated tendon; by default the only one.

    Raises:
        InputError: If there is no such tendon, a joint that it crosses has no spring, or the finger has passive tendons
            or tendons of a tree, whose pull the tension alone does not say.
    """
    finger = as_finger(finger)
    one_finger(finger.description)
    routing, index = finger.routing, _index(finger, cord)
    crossed = np.flatnonzero(routing.coupling[index])
    names = tuple(routing.joints[joint] for joint in crossed)
    loose = [name for name in names if finger.description.joints[name].spring is None]
    if not names:
        raise InputError("cord", "must cross a joint at the same radius in every posture", routing.tendons[index])
    if loose:
        raise InputError("finger.joints", f"need a spring to come back, see {', '.join(loose)}")
    positions = _postures(finger, crossed, np.sign(routing.coupling[index]))
    arms, way = np.abs(routing.coupling[index, crossed]), np.sign(routing.coupling[index, crossed])
    needed = way * np.array([finger.static_torque(each) for each in positions])[:, crossed]
    pins, springs = finger.joint_friction, finger.springs
    hysteresis = springs.hysteresis * np.abs(springs.torque(positions, np.zeros_like(positions)))
    dry, resisting = (
        (hysteresis + pins.break_away_drag(side * np.sign(routing.coupling[index])))[:, crossed] for side in (1.0, -1.0)
    )
    loaded = (pins.static * pins.loads[:, index])[crossed]
    inward, outward = (_cord(finger, positions, index, crossed, side) for side in (1.0, -1.0))
    with np.errstate(divide="ignore"):
        delivered = np.where(arms > loaded, np.maximum(needed + dry, 0.0) / np.maximum(arms - loaded, 0.0), np.inf)
        # What the cord's drag leaves when nothing pulls.
        held = resisting - outward[1] * (arms + loaded)
        margins = np.where(held > 0.0, needed / held, np.where(needed > 0.0, np.inf, 0.0))
    return SpringReturn(
        cord=routing.tendons[index],
        joints=names,
        positions=positions,
        winding_in=(delivered + inward[1]) / inward[0],
        letting_out=((needed - resisting) / (arms + loaded) + outward[1]) / outward[0],
        margins=margins,
    )


def _index(finger: Finger, cord: str | None) -> int:
    """Return the index of a cord; refuse fingers with passive tendons or tendons of a tree."""
    routing = finger.routing
    names = routing.tendons[: routing.actuated]
    if routing.passive or finger.description.canals:
        raise InputError("finger.tendons", "must all be actuated, none passive or of a tree: their pull is not known")
    if not names:
        raise InputError("finger.tendons", "must have an actuated one, against which springs return")
    if cord is None and len(names) != 1:
        raise InputError("cord", f"must be one of {', '.join(names)}")
    if cord is not None and cord not in names:
        raise InputError("cord", f"must be one of {', '.join(names)}{suggestion(cord, names)}", cord)
    return 0 if cord is None else names.index(cord)


def _cord(finger: Finger, positions: Array, index: int, crossed: Indices, side: float) -> tuple[Array, Array]:
    """Return the share of the tension that arrives at joints, and the tension lost to drag, shape (m, k) each."""
    ways = np.zeros((len(positions), len(finger.routing.tendons)))
    ways[:, index] = side
    share, lost = finger.tendons.in_sliding(positions, ways)
    return share[:, index, crossed], lost[:, index, crossed]


def _postures(finger: Finger, crossed: Indices, way: Array) -> Array:
    """Return postures with every joint at shares of its travel from the rest of its spring to the end of its range."""
    limiter, springs = finger.stroke_limiter, finger.springs
    rest = np.clip(springs.rest, limiter.lower, limiter.upper)
    travel = np.where(way > 0.0, limiter.upper, limiter.lower) - rest
    count = int(np.clip(_POSTURES ** (1.0 / len(crossed)), _FEWEST, _MOST))
    shares = np.array(list(product(np.arange(1, count + 1) / count, repeat=len(crossed))))
    postures = np.repeat(rest[None], len(shares), axis=0)
    postures[:, crossed] += shares * travel[crossed]
    return postures
