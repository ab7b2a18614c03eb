"""Winding of a tendon around joints: straight spans at rest in the links, and arcs around the joints between them.

Between two joints the common tangent of their pulleys is at rest in the link, so only the arcs change when a joint
turns, by r theta, and the path obeys (3) for any constant radius. The signed radius r puts the path at y = r in the
frame of its joint, whose axis is z and whose link runs along x. A path that would leave its pulley on the inner side
of a bend goes once around it, as on an idler. The last arc ends on the pulley of the link that the tendon moves.
Angles are directions of the path against x, about the joint axis.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from finger_pin.description.cords import Cord
from finger_pin.mechanism.geometry.cord_pieces import Arc, WoundSpan
from finger_pin.mechanism.geometry.lateral_offsets import Lanes
from finger_pin.typing import Array

#: Least wrap over the range of a joint, rad: of a path that passes, and of one that ends there.
PASSING_WRAP, ENDING_WRAP = 0.05, 0.35
#: Largest tilt of the first span that is preferred to a full turn around the first pulley, rad.
LARGEST_TILT = 0.6
#: Length of the first span behind the base, in widths of the first link; inside a link, in lengths of that link.
BASE_LEAD, LINK_LEAD = 2.5, 0.6


def joint_chains(cord: Cord, joints: Mapping[str, int], model: pin.Model) -> list[dict[int, float]]:
    """Return the arms of a cord by joint, m, for every chain of joints, and 0 at those in between.

    Args:
        cord: A cord of arms.
        joints: Indices of the joints by name.
        model: Pinocchio model; the joints that carry a joint come before it.
    """
    arms = {joints[element.name]: element.radius for element in cord.elements if element.radius is not None}
    chains = []
    while arms:
        support = [int(joint) for joint in model.supports[max(arms)]]
        first = next(index for index, joint in enumerate(support) if joint in arms)
        chains.append({joint: arms.pop(joint, 0.0) for joint in support[first:]})
    return chains[::-1]


def wind(
    radius: Mapping[int, float],
    ranges: Mapping[int, tuple[float, float]],
    model: pin.Model,
    lanes: Lanes,
    tendon: str,
    resolution: int,
    mass_link: int,
) -> tuple[WoundSpan | Arc, ...]:
    """Return the pieces of a tendon from its actuator or proximal anchor to its insertion.

    Args:
        radius: Its arms, m, by joint: each joint carries the next.
        ranges: Of the joints, rad.
        model: Pinocchio model whose joints turn about z.
        lanes: Of its tendons.
        tendon: Which one.
        resolution: Points per span and per radian of arc.
        mass_link: Link that carries the lumped mass of a passive tendon; of others one beyond all links.
    """
    path = tuple(radius)
    side = {j: math.copysign(1.0, r) if r else 0.0 for j, r in radius.items()}
    # How far each joint can unwrap its arc.
    unwrap = {j: min(max(side[j] * limit for limit in ranges[j]), 2.0 * math.pi) for j in path}

    def directions(skew: dict[int, float]) -> tuple[dict[int, float], dict[int, float]]:
        entry, leave = {}, {}
        for a, b in itertools.pairwise(path):
            leave[a], entry[b] = _tangent(
                model.jointPlacements[b],
                (radius[a], lanes.offset[tendon, a] + skew[a]),
                (radius[b], lanes.offset[tendon, b] - skew[b]),
            )
        first, last = path[0], path[-1]
        tilt = unwrap[first] + side[first] * leave[first] + PASSING_WRAP if first != last else 0.0
        entry[first] = side[first] * tilt if 0.0 < tilt < LARGEST_TILT else 0.0
        leave[last] = entry[last] - side[last] * (ENDING_WRAP + unwrap[last])
        return entry, leave

    entry, leave = directions(dict.fromkeys(path, 0.0))
    least = {j: -unwrap[j] - side[j] * (leave[j] - entry[j]) for j in path}
    turns = {j: math.ceil(max(0.0, -least[j] - PASSING_WRAP) / (2.0 * math.pi)) for j in path}
    # The two ends of a full turn lie beside each other.
    skew = {j: 0.25 * lanes.spacing * turns[j] for j in path}
    entry, leave = directions(skew)
    first = path[0]
    begin = _on_pulley(radius[first], lanes.offset[tendon, first] - skew[first], entry[first])
    ends = _lead_in(model.jointPlacements[first], begin, entry[first], _start(lanes, model, first))
    pieces: list[WoundSpan | Arc] = [_span(int(model.parents[first]), ends, resolution, mass_link, whole=True)]
    for j, after in itertools.zip_longest(path, path[1:]):
        offset = lanes.offset[tendon, j]
        if radius[j]:
            turn = leave[j] - entry[j] - side[j] * 2.0 * math.pi * turns[j]
            fraction = _arc_fractions(turn, ranges[j], resolution, last=after is None)
            distal = np.full(len(fraction), j > mass_link)
            pieces.append(Arc(j, radius[j], entry[j], turn, offset, skew[j], fraction, distal))
        if after is not None:
            leaving = _on_pulley(radius[j], offset + skew[j], leave[j])
            arriving = _on_pulley(radius[after], lanes.offset[tendon, after] - skew[after], entry[after])
            ends = np.array([leaving, model.jointPlacements[after].act(arriving)])
            pieces.append(_span(j, ends, resolution, mass_link, whole=radius[j] != 0.0))
    return tuple(pieces)


def _lead_in(placement: pin.SE3, begin: Array, entry: float, length: float) -> Array:
    """Return the ends of the straight piece from the actuator to the first pulley, shape (2, 3), m."""
    back = np.array([math.cos(entry), math.sin(entry), 0.0])
    return np.array([placement.act(begin - length * back), placement.act(begin)])


def _arc_fractions(turn: float, limits: tuple[float, float], resolution: int, last: bool) -> Array:
    """Return the places of the points of an arc, from 0 to 1, shape (k,), as many as the joint's range needs."""
    widest = max(abs(turn + limit) for limit in limits)
    count = max(3, math.ceil(resolution * min(widest, 4.0 * math.pi)))
    return np.asarray(np.arange(1, count + 1) / (count if last else count + 1))


def _tangent(placement: pin.SE3, first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    # Directions in which a taut path leaves one pulley and meets the next, each (signed radius, offset). Each end is
    # the tangent from the other end's point; for parallel axes this converges quadratically to the common tangent.
    leave, entry = 0.0, 0.0
    for _ in range(8):
        x, y, _ = placement.act(_on_pulley(*second, entry))
        leave = math.atan2(y, x) - _asin(first[0], math.hypot(x, y))
        x, y, _ = placement.actInv(_on_pulley(*first, leave))
        entry = math.atan2(-y, -x) + _asin(second[0], math.hypot(x, y))
    return leave, entry


def _asin(radius: float, distance: float) -> float:
    return math.asin(max(-1.0, min(1.0, radius / distance))) if distance else 0.0


def _on_pulley(radius: float, offset: float, direction: float) -> Array:
    return np.array([-radius * math.sin(direction), radius * math.cos(direction), offset])


def _start(lanes: Lanes, model: pin.Model, joint: int) -> float:
    if not model.parents[joint]:
        return BASE_LEAD * lanes.lead
    return LINK_LEAD * float(np.linalg.norm(model.jointPlacements[joint].translation))


def _span(link: int, ends: Array, resolution: int, mass_link: int, *, whole: bool) -> WoundSpan:
    # Not whole: without the first point, which the piece before has already.
    fraction = np.linspace(0.0, 1.0, max(3, resolution))[0 if whole else 1 :]
    points = ends[0] + fraction[:, None] * (ends[1] - ends[0])
    sag = 4.0 * fraction * (1.0 - fraction) * np.linalg.norm(ends[1] - ends[0])
    distal = fraction > 0.5 if link == mass_link else np.full(len(fraction), link > mass_link)
    return WoundSpan(link, points, sag, distal)
