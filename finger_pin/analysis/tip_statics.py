"""Statics of a fingertip that pushes: forces within tension limits, and the tensions that a force needs.

At rest at theta, with E = -F the force that the fingertip exerts on what it touches, (18) reads

    J^T E = H_c2^T f - G - tau^k - tau^f,

linear in E and the tensions f of the strands. With bounds on the commands f^a it describes a polytope of (E, f^a, f,
tau^f), and the forces are its projection on E. Passive tendons carry whatever the balance asks of them, without
limit, but never push. Friction enters in one of three ways.

- NONE: f_i = f^a_i, halves of passive tendons alike, tau^f = 0.
- HELPING: whatever stiction can hold. f_i / f^a_i and the ratio of the halves lie between exp(-mu_e phi) and
  exp(mu_e phi), and |tau^f_j| <= M^d_j S_j. The set of forces that the finger can hold against a contact that pushes.
- HINDERING: what is left when the finger pushes and everything slips against it. f_i = f^a_i exp(-mu_e phi_i) at all
  actuated tendons, passive tendons lose to whichever side is worse, and tau^f_j = s_j M^d_j (S_j + |E|) with s_j the
  sign of (J^T E)_j, whichever is worse where E passes a joint's axis too closely to say. It depends on the direction
  of E, so it is asked about direction by direction; no polytope.

A drag d, which no load makes, adds to the level, mu^d (f^a_i + f_i) + d, so that it takes d / (1 + mu^d) of a tension
beside the capstan law: of HELPING that much more on either side, of HINDERING f_i = max(0, f^a_i exp(-mu_e phi_i) -
d / (1 + mu^d)), where a tendon whose command does not overcome its drag delivers nothing. That of a joint adds to
M^d_j S_j.

S_j is the sum of the tensions that cross joint j. The reaction (17) is |-e_j S_j - E|, at most S_j + |E|: so HINDERING
is on the safe side, and HELPING leaves out what the contact itself adds to the friction.

Directions in which no joint moves the fingertip are carried by the structure and are left out of the polytope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.description.validation import expand, finite_vector
from finger_pin.exceptions import InputError
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.coerce import one_finger, refuse_without_tendons
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

#: Status codes of scipy's linear programmes.
INFEASIBLE, UNBOUNDED = 2, 3
# Lever, part of the largest, below which a force turns no joint.
_LEVER_TOLERANCE = 1e-9


class Friction(Enum):
    """The part of friction in a finger that pushes; see the module."""

    NONE = "none"
    HELPING = "helping"
    HINDERING = "hindering"


@dataclass(frozen=True, eq=False)
class Slip:
    """One way in which everything slips against a finger that pushes.

    Attributes:
        tendons: 1 where a tendon's far end loses, -1 where the near one does, shape (t,).
        idle: Whether drag keeps a tendon from delivering anything, shape (t,).
        joints: s, the sign of every joint's friction, shape (n,).
    """

    tendons: Array
    idle: NDArray[np.bool_]
    joints: Array


@dataclass(frozen=True, eq=False)
class Segments:
    """The strands of a finger at a posture, cut where tendons rub; k places of friction, s segments.

    Attributes:
        coupling: Arms of the segments, shape (s, n), m.
        loads: Which segments load which joints, shape (n, s).
        tendon: Tendon of every segment, shape (s,).
        strands: Segment at the end of every strand.
        near_end: What pulls at the near end of every place, shape (k,), an index among commands and segments.
        far_end: Likewise at the far end.
        friction_of: Tendon of every place, shape (k,).
        loss: exp(-mu_e phi) of every place, shape (k,).
        drag: What drag takes of what arrives there, shape (k,), N.
    """

    coupling: Array
    loads: Array
    tendon: NDArray[np.intp]
    strands: NDArray[np.intp]
    near_end: NDArray[np.intp]
    far_end: NDArray[np.intp]
    friction_of: NDArray[np.intp]
    loss: Array
    drag: Array

    @classmethod
    def from_tendons(cls, tendons: Tendons, theta: Array) -> Segments:
        """Cut the strands at theta, shape (n,)."""
        routing, a = tendons.routing, tendons.routing.actuated
        curvature, everywhere = routing.curvature(theta), np.ones(len(routing.joints), dtype=bool)
        coupling, loads = list[Array](), list[Array]()
        tendon, strands = list[int](), list[int]()
        # Of every place: tendon, near and far end, curvature, and the tendon's number of places.
        places: list[tuple[int, int, int, float, int]] = []
        for k in range(a):
            bend_cuts = tendons.several.get(k)
            cuts = bend_cuts or [(routing.curvature_matrix[k], routing.curvature_offset[k], everywhere)]
            for number, (bends, offset, beyond) in enumerate(cuts):
                after = cuts[number + 1][2] if number + 1 < len(cuts) else ~everywhere
                segment = a + len(tendon)
                bend, pulling = float(np.abs(theta) @ bends + offset), segment - 1 if number else k
                places.append((k, pulling, segment, bend, len(cuts)))
                # What the first place has before it is that of the whole.
                mask = (beyond if number else everywhere) & ~after
                coupling.append(routing.strand_coupling[k] * mask)
                loads.append(routing.loads[:, k] * mask)
                tendon.append(k)
            strands.append(len(tendon) - 1)
        for k in range(a, len(routing.tendons)):
            proximal, segment = routing.strand(routing.tendons[k]), a + len(tendon)
            places.append((k, segment, segment + 1, float(curvature[k]), 1))
            for half in (proximal, proximal + 1):
                coupling.append(routing.strand_coupling[half])
                loads.append(routing.loads[:, half])
                strands.append(len(tendon))
                tendon.append(k)
        friction_of, near_end, far_end, turn, count = (np.array(each) for each in zip(*places, strict=True))
        surface = tendons.surface[friction_of]
        return cls(
            coupling=np.array(coupling),
            loads=np.array(loads).T,
            tendon=np.array(tendon),
            strands=np.array(strands),
            near_end=near_end,
            far_end=far_end,
            friction_of=friction_of,
            loss=np.exp(-surface * turn),
            drag=tendons.drag[friction_of] / count / (1.0 + capstan_coefficient(surface, turn)),
        )


@dataclass(frozen=True, eq=False)
class TipStatics:
    """The linear constraints on x = (f^a, f, tau^f) that do not depend on E, and J^T.

    Attributes:
        jacobian: J, shape (3, n).
        equal: Rows that vanish, shape (., a + s + n + 1), the last number being a constant.
        below: Rows that are at most zero, likewise.
        torque: Rows (n) of H_c2^T f - tau^f.
        weight: G and the torque of springs, shape (n,), N m.
        segments: The strands, those of tendons that rub at several places from place to place.
        sizes: a, s, n.
    """

    jacobian: Array
    equal: Array
    below: Array
    torque: Array
    weight: Array
    segments: Segments
    sizes: tuple[int, int, int]

    @classmethod
    def from_finger(cls, finger: Finger, theta: Array, friction: Friction, slip: Slip | None = None) -> TipStatics:
        """Collect the constraints; ``slip`` is read for HINDERING only."""
        a, segments = finger.routing.actuated, Segments.from_tendons(finger.tendons, theta)
        s, n = segments.coupling.shape
        loss, drag = segments.loss[:, None], segments.drag[:, None]
        command, strand, joint, one = np.split(np.eye(a + s + n + 1), [a, a + s, a + s + n])
        ends, pins = np.vstack([command, strand]), finger.joint_friction
        near, far = ends[segments.near_end], ends[segments.far_end]
        reaction = pins.kinetic[:, None] * (segments.loads @ strand) + pins.drag[:, None] * one
        asymmetry = (pins.drag * pins.drag_asymmetry)[:, None] * one
        below: list[Array] = []
        if friction is Friction.NONE:
            equal = [far - near, joint]
        elif friction is Friction.HINDERING:
            assert slip is not None
            ahead, idle = slip.tendons[segments.friction_of][:, None] > 0.0, slip.idle[segments.friction_of][:, None]
            source, target = np.where(ahead, near, far), np.where(ahead, far, near)
            arriving = loss * source - drag * one
            sides = slip.joints[:, None]
            equal = [np.where(idle, target, target - arriving), joint - sides * (reaction + sides * asymmetry)]
            below = [arriving[idle[:, 0]]]
        else:
            equal = []
            below = [loss * near - far - drag * one, loss * far - near - drag * one]
            below += [joint - asymmetry - reaction, asymmetry - joint - reaction]
        width = a + s + n
        return cls(
            jacobian=finger.rigid_body.jacobian(theta),
            equal=np.concatenate([np.zeros((0, width + 1)), *equal]),
            below=np.concatenate([np.zeros((0, width + 1)), *below]),
            torque=(segments.coupling.T @ strand - joint)[:, :width],
            weight=finger.static_torque(theta),
            segments=segments,
            sizes=(a, s, n),
        )

    def solve(
        self,
        cost: Array,
        extra: Array,
        bounds: list[tuple[float | None, float | None]],
        offset: Array,
        extra_rows: Array | None = None,
    ) -> Any:
        """Minimise over (z, x): the torque rows are extra @ z = torque @ x - weight - offset.

        Args:
            cost: Of z and x.
            extra: Shape (n, z).
            bounds: Of z and f^a.
            offset: Shape (n,), N m.
            extra_rows: Rows on z and f^a that are at most zero, shape (., z + a).
        """
        _, s, n = self.sizes
        count = extra.shape[1]
        zeros = np.zeros((len(self.equal), count))
        below = np.hstack([np.zeros((len(self.below), count)), self.below])
        if extra_rows is not None:
            below = np.vstack([below, np.hstack([extra_rows, np.zeros((len(extra_rows), s + n + 1))])])
        return scipy.optimize.linprog(
            cost,
            A_ub=below[:, :-1] if len(below) else None,
            b_ub=-below[:, -1] if len(below) else None,
            A_eq=np.vstack([np.hstack([-extra, self.torque]), np.hstack([zeros, self.equal[:, :-1]])]),
            b_eq=np.concatenate([self.weight + offset, -self.equal[:, -1]]),
            bounds=[*bounds, *[(0.0, None)] * s, *[(None, None)] * n],
        )


def slips(finger: Finger, jacobian: Array, force: Array, friction: Friction) -> list[list[Slip | None]]:
    """Return the ways to slip under a force E, shape (3,), each with choices of tendons that drag keeps idle.

    That is for HINDERING alone. A force that passes a joint's axis at no more than the coefficient M^d of its friction,
    inside of its friction circle, does not decide which way the joint slips: both ways must be looked at. Where it
    turns no joint at all the structure carries it, and nothing slips.
    """
    routing, kinetic = finger.routing, finger.joint_friction.kinetic
    if friction is not Friction.HINDERING:
        return [[None]]
    turn, size = jacobian.T @ force, float(np.linalg.norm(force))
    joints = [np.zeros(len(kinetic))]
    if np.max(np.abs(turn)) > _LEVER_TOLERANCE * size * np.max(np.abs(jacobian)):
        sides = [
            (np.sign(each),) if abs(each) >= least else (1.0, -1.0)
            for each, least in zip(turn, size * kinetic, strict=True)
        ]
        joints = [np.array(signs) for signs in product(*sides)]
    idle = [np.array(each) for each in product(*[(False, True) if d > 0.0 else (False,) for d in finger.tendons.drag])]
    tendons = [np.array(each) for each in product(*[(1.0,)] * routing.actuated, *[(1.0, -1.0)] * routing.passive)]
    return [[Slip(way, each, signs) for each in idle] for way, signs in product(tendons, joints)]


def posture(finger: Finger, position: Sequence[float] | Array) -> Array:
    """Return theta as an array of the right size; refuse a hand of several fingers."""
    one_finger(finger.description)
    refuse_without_tendons(finger.description)
    return finite_vector("position", position, len(finger.routing.joints))


def command_bounds(
    finger: Finger, minimum: float | tuple[float, ...], limit: float | tuple[float, ...]
) -> list[tuple[float | None, float | None]]:
    """Return least and greatest f^a of every actuated tendon; None for no limit."""
    count = finger.routing.actuated
    low, high = expand(minimum, count), expand(limit, count)
    if not (np.all(low >= 0.0) and np.all(high > low)):
        allowed = "must be above the least tension, which must not be negative"
        raise InputError("maximum_tension", allowed, high.tolist())
    return [(float(a), None if np.isinf(b) else float(b)) for a, b in zip(low, high, strict=True)]
