"""Force closure at a posture and over postures, for tendons whose paths run through space."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.analysis.locking import CriticalFriction, critical_friction
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.routing import ForceClosure
from finger_pin.description.validation import finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Number of worst postures from which simplex searches start.
_SIMPLEX_STARTS = 3


@dataclass(frozen=True, eq=False, repr=False)
class ClosureRange(BriefRepr):
    """Internal tensions over the joints' ranges, t tendons at m postures.

    Attributes:
        positions: Shape (m, n), rad; the last are those that a search for the worst has ended at.
        tension: f^k, shape (m, t), largest entry 1; zero where there is no force closure.
        margin: Least internal tension over the largest, shape (m,); not above 0 where closure is lost.
        tendons: Names.
        joints: Names.
    """

    positions: Array
    tension: Array
    margin: Array
    tendons: tuple[str, ...]
    joints: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether there is force closure at every posture."""
        return bool(self.taut.all())

    @property
    def taut(self) -> NDArray[np.bool_]:
        """Whether there is force closure at each posture, shape (m,)."""
        return self.margin > 0.0

    @property
    def worst(self) -> Array:
        """The posture with the least margin, shape (n,), rad."""
        return np.asarray(self.positions[np.argmin(self.margin)])

    def __str__(self) -> str:
        """Return a sentence on force closure, with the posture of its least margin or of its loss."""
        where = ", ".join(f"{name} {angle:.3g}" for name, angle in zip(self.joints, self.worst, strict=True))
        if self.holds:
            return f"force closure everywhere, tensions differ at most {1 / self.margin.min():.3g}-fold, at {where}"
        return f"no force closure at {where}"


def posed(finger: FingerLike, position: Sequence[float] | Array) -> Finger:
    """Return a finger whose tendons keep the arms of one posture, for statics there.

    What this room says of a finger at a posture, such as `critical_friction` and `force_polytope`, it says of one with
    tendons along paths through ``posed(finger, position)``.

    Args:
        finger: A finger.
        position: theta, shape (n,), rad.
    """
    finger = as_finger(finger)
    theta = finite_vector("position", position, len(finger.routing.joints))
    if not finger.routing.through_space.any():
        return finger
    if finger.tendons.at_bends:
        allowed = 'must be "canal" for statics of tendons along paths through space'
        raise InputError("finger.tendon_friction.place", allowed, finger.description.tendon_friction.place)
    turns, tendons = dict(zip(finger.paths.cords, finger.paths.turn(theta), strict=True)), finger.description.tendons
    cords = {
        name: cord.posed(finger.routing.joints, arms, turns[str(tendons[name].along)]) if cord.through_space else cord
        for (name, cord), arms in zip(finger.routing.cords.items(), finger.coupling_at(theta), strict=True)
    }
    routing = replace(finger.routing, cords=cords)
    posed_finger = copy.copy(finger)
    posed_finger.routing, posed_finger.tendons = routing, replace(finger.tendons, routing=routing)
    return posed_finger


def closure_over_range(finger: FingerLike, samples: int = 512) -> ClosureRange:
    """Return force closure over the joints' ranges: at evenly spread postures, and at the worst that is found.

    Postures are a Sobol sequence; from the worst of them a simplex search goes on within the ranges.

    Args:
        finger: A finger; what its tendons run along may depend on the posture.
        samples: Postures, best a power of two.
    """
    finger = as_finger(finger)
    lower, upper = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    shares = scipy.stats.qmc.Sobol(len(lower), seed=0).random(samples)
    positions = list(lower + shares * (upper - lower))
    margins = [_closure_margin(finger, each)[1] for each in positions]
    for start in np.argsort(margins, kind="stable")[:_SIMPLEX_STARTS]:
        minimum = scipy.optimize.minimize(
            lambda theta: _closure_margin(finger, theta)[1],
            positions[start],
            method="Nelder-Mead",
            bounds=list(zip(lower, upper, strict=True)),
            options={"maxfev": 60 * len(lower)},
        )
        positions.append(np.clip(minimum.x, lower, upper))
    closures = [_closure_margin(finger, each) for each in positions]
    return ClosureRange(
        positions=np.array(positions),
        tension=np.array([closure.tension for closure, _ in closures]),
        margin=np.array([margin for _, margin in closures]),
        tendons=finger.routing.tendons,
        joints=finger.routing.joints,
    )


def locking_over_range(finger: FingerLike, samples: int = 64) -> tuple[CriticalFriction, Array]:
    """Return the least margin to self-locking over the joints' ranges, and its posture, shape (n,), rad.

    All joints move in their worst directions, which are 2^n, at evenly spread postures with force closure; tendons
    along paths have their arms and turns there. The margin is the critical coefficient over the joints' M^c.

    Args:
        finger: A finger.
        samples: Postures, best a power of two.
    """
    finger = as_finger(finger)
    closure = closure_over_range(finger, samples)
    postures = closure.positions[closure.taut]
    if not len(postures):
        raise InputError("finger.tendons", str(closure))
    critical = [critical_friction(posed(finger, each), each) for each in postures]
    worst = int(np.argmin([each.coefficient for each in critical]))
    return critical[worst], np.asarray(postures[worst])


def _closure_margin(finger: Finger, position: Array) -> tuple[ForceClosure, float]:
    """Return the internal tensions at a posture and their margin, which has a sign if the balance is unique."""
    closure = ForceClosure.from_coupling(finger.coupling_at(position), finger.routing.tendons)
    balances = closure.null_space
    if balances.shape[1] != 1:
        return closure, float(closure.tension.min()) if balances.shape[1] else -1.0
    balance = balances[:, 0] / np.abs(balances).max()
    return closure, float(max(balance.min(), (-balance).min()))
