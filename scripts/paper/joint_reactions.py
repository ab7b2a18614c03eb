"""The error of the joint reaction (17) along a result: against the whole force on the pins, part by part.

R_j is the length of the pin's force P_j. Beside it stand what (17) does not know at all: the part of P_j along the
axis, the thrust, and the moment across the axis, the tilt, a pair of forces whose size depends on the distance of the
joint's bearings. See `pin_wrench` for the mechanics and its assumptions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from finger_pin.analysis.printing import BriefRepr
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import one_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.frames import read_scene
from finger_pin.typing import Array
from paper.pin_wrench import pin_wrench
from paper.tendon_cuts import Groove

_MOTION = ("joint_position", "joint_velocity", "joint_acceleration")


@dataclass(frozen=True, eq=False, repr=False)
class JointReactions(BriefRepr):
    """Reactions of n joints at m instants, shapes (m, n), N unless said otherwise.

    Attributes:
        time: Shape (m,), s.
        joints: Names.
        paper: R_j by (17).
        direction: (17) with the tendons along their paths.
        weight: (17) with the weight.
        inertia: (17) with inertia.
        static: Tendons along their paths, and weight: the full quasi-static reaction.
        full: With inertia as well.
        other_groove: The full quasi-static reaction with the grooves on the proximal links.
        thrust: Part of the full force along the axis, signed.
        tilt: Moment of the pin across its axis, N m.
        coulomb: M^d of the joints, shape (n,), m.
    """

    time: Array
    joints: tuple[str, ...]
    paper: Array
    direction: Array
    weight: Array
    inertia: Array
    static: Array
    full: Array
    other_groove: Array
    thrust: Array
    tilt: Array
    coulomb: Array

    def differences(self) -> tuple[ReactionDifference, ...]:
        """Return a summary for every joint."""
        return tuple(ReactionDifference.of(self, index) for index in range(len(self.joints)))


@dataclass(frozen=True)
class Difference:
    """Differences of a reaction from (17) over a result, in parts of the mean of (17).

    Attributes:
        mean: Of the signed difference.
        largest: Of its size.
    """

    mean: float
    largest: float

    @classmethod
    def between(cls, other: Array, paper: Array) -> Difference:
        """Compare, for shapes (m,)."""
        scale = float(np.mean(paper)) or float("nan")
        return cls(float(np.mean(other - paper)) / scale, float(np.max(np.abs(other - paper))) / scale)


@dataclass(frozen=True)
class ReactionDifference:
    """The error of (17) at one joint.

    Attributes:
        joint: Its name.
        paper: Mean of (17), N.
        direction: Through the tendons' direction alone.
        weight: Through weight alone.
        inertia: Through inertia alone.
        static: Through direction and weight.
        full: Through all of it.
        other_groove: As ``static``, with grooves on the proximal link.
        friction: Mean and largest change of the joint's Coulomb friction, M^d times that of ``static``, N m.
        thrust: Largest force along the axis, N.
        tilt: Mean moment across the axis, N m.
    """

    joint: str
    paper: float
    direction: Difference
    weight: Difference
    inertia: Difference
    static: Difference
    full: Difference
    other_groove: Difference
    friction: tuple[float, float]
    thrust: float
    tilt: float

    @classmethod
    def of(cls, reactions: JointReactions, index: int) -> ReactionDifference:
        """Summarise one joint."""
        paper = reactions.paper[:, index]
        more = reactions.coulomb[index] * (reactions.static[:, index] - paper)
        return cls(
            joint=reactions.joints[index],
            paper=float(np.mean(paper)),
            direction=Difference.between(reactions.direction[:, index], paper),
            weight=Difference.between(reactions.weight[:, index], paper),
            inertia=Difference.between(reactions.inertia[:, index], paper),
            static=Difference.between(reactions.static[:, index], paper),
            full=Difference.between(reactions.full[:, index], paper),
            other_groove=Difference.between(reactions.other_groove[:, index], paper),
            friction=(float(np.mean(more)), float(np.max(np.abs(more)))),
            thrust=float(np.max(np.abs(reactions.thrust[:, index]))),
            tilt=float(np.mean(reactions.tilt[:, index])),
        )


def joint_reactions(result: xr.Dataset) -> JointReactions:
    """Return the reactions by (17) and in full along a result.

    Args:
        result: Dataset of `simulate`, of a finger whose joints all carry links.

    Raises:
        InputError: If something is missing in the result, or a joint carries no link.
    """
    description = read_scene(result.attrs).finger
    one_finger(description)
    finger = Finger(description)
    position, velocity, acceleration = (_values(result, name) for name in _MOTION)
    strands, force = _strands(result, finger), _values(result, "fingertip_force")
    found, other = (
        pin_wrench(finger, position, velocity, acceleration, strands, force, groove)
        for groove in (Groove.DISTAL, Groove.PROXIMAL)
    )
    paper = found.paper + found.external
    along = np.sum(found.moment * found.axis, axis=-1, keepdims=True)
    return JointReactions(
        time=np.asarray(result["time"].values, dtype=float),
        joints=finger.routing.joints,
        paper=_length(paper),
        direction=_length(found.tendons + found.external),
        weight=_length(paper + found.carried),
        inertia=_length(paper + found.inertia),
        static=_length(found.force - found.inertia),
        full=_length(found.force),
        other_groove=_length(other.force - other.inertia),
        thrust=np.sum(found.force * found.axis, axis=-1),
        tilt=_length(found.moment - along * found.axis),
        coulomb=finger.joint_friction.kinetic,
    )


def fingertip_loads(sizes: Sequence[float]) -> dict[str, tuple[float, ...]]:
    """Return fingertip forces of given sizes, N, both ways along the axes of the base, by a label."""
    signs = (("+", 1.0), ("\N{MINUS SIGN}", -1.0))
    return {
        f"{sign}{axis} {size:g} N": (*(factor * size if axis == each else 0.0 for each in "xyz"),)
        for axis in "xyz"
        for sign, factor in signs
        for size in sizes
    }


def _length(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=-1))


def _values(result: xr.Dataset, name: str) -> Array:
    if name not in result.variables:
        raise InputError(f"result.{name}", "is missing; give a result of simulate")
    return np.asarray(result[name].transpose("time", ...).values, dtype=float)


def _strands(result: xr.Dataset, finger: Finger) -> Array:
    routing, tension = finger.routing, _values(result, "tendon_tension")
    strands = np.zeros((len(tension), len(routing.strand_coupling)))
    strands[:, : routing.actuated] = tension[:, : routing.actuated]
    if routing.passive:
        proximal = _values(result, "passive_tension_proximal")
        strands[:, routing.actuated :: 2] = proximal.reshape(len(tension), -1)
        strands[:, routing.actuated + 1 :: 2] = tension[:, routing.actuated :]
    return strands
