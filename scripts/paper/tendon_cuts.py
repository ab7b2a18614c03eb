"""Cuts through the tendons at the joints: points of crossing from link to link, and directions of pull.

A cut frees everything distal of a joint. Each tendon that crosses it then pulls with its tension at the cut, along its
path and towards the actuator. A tendon meets its groove in the plane of the groove, across the joint axis: what turns
it into that plane from its span is a guide on the link where the span lies. So the moment of the cut forces about the
axis is r f, as in (10), whatever side of the joint the lanes lead it to.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pinocchio as pin

from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.mechanism.geometry.cord_pieces import Arc, Piece, WoundSpan
from finger_pin.typing import Array


class Groove(Enum):
    """The link that the grooves around a joint are part of, and so the side of them on which a cut goes.

    DISTAL: the link after the joint; tendons pull along the link before it, as in (17). PROXIMAL: the link before it;
    tendons that pass on pull along the link after it, and only those that end there stay as they are.
    """

    DISTAL = "distal"
    PROXIMAL = "proximal"


@dataclass(frozen=True, eq=False)
class Cut:
    """The crossing of a tendon over a joint, at rest in one of the two links.

    Attributes:
        tendon: Its name.
        joint: Index of the joint, 1 for the first.
        distal: Whether it is the half of a passive tendon beyond its lumped mass.
        link: Index of the link in whose frame point and direction are; 0 is the base.
        point: Point at which the tendon meets its groove, or leaves it, shape (3,), m.
        direction: Unit vector of the path from the actuator to the insertion, shape (3,).
    """

    tendon: str
    joint: int
    distal: bool
    link: int
    point: Array
    direction: Array


def tendon_cuts(geometry: TendonGeometry, groove: Groove = Groove.DISTAL) -> tuple[Cut, ...]:
    """Return the cuts of every tendon of a finger at the joints, tendon by tendon.

    Args:
        geometry: The wound tendons of a finger.
        groove: Link that the grooves are part of.
    """
    tendons = geometry.pieces.items()
    return tuple(cut for name, pieces in tendons for cut in _cuts(geometry.model, name, pieces, groove))


def _cuts(model: pin.Model, tendon: str, pieces: Sequence[Piece], groove: Groove) -> Iterator[Cut]:
    """Yield the cuts of a wound tendon, joint by joint.

    Args:
        model: Pinocchio model of the finger.
        tendon: Name of the tendon.
        pieces: Of the tendon.
        groove: Link that the grooves are part of.
    """
    spans = [piece for piece in pieces if isinstance(piece, WoundSpan)]
    arcs = {piece.joint: piece for piece in pieces if isinstance(piece, Arc)}
    after = {span.link: span for span in spans}
    for span in spans:
        joint, distal = span.link + 1, bool(span.distal[-1])
        axis = model.jointPlacements[joint].rotation[:, 2]
        if groove is Groove.DISTAL or joint not in after:
            yield Cut(tendon, joint, distal, span.link, span.points[-1], _across(span.points, axis))
            continue
        beyond = after[joint]
        point = _exit(arcs[joint]) if joint in arcs else beyond.points[0]
        # The first point of a span after an arc is the arc's last, which the span leaves out.
        yield Cut(tendon, joint, distal, joint, point, _across(beyond.points, np.array([0.0, 0.0, 1.0])))


def _across(points: Array, axis: Array) -> Array:
    along = points[-1] - points[0]
    along = along - (along @ axis) * axis
    return np.asarray(along / np.linalg.norm(along))


def _exit(arc: Arc) -> Array:
    direction = arc.entry + arc.turn
    return np.array([-arc.radius * np.sin(direction), arc.radius * np.cos(direction), arc.offset[-1]])
