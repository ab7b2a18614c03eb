"""A finger that is given as a tree, in space: its solids, and its cords around hinges and along paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree import LARGEST_RADIUS
from finger_pin.mechanism.from_pinocchio import turned_model
from finger_pin.mechanism.geometry.cord_pieces import Leg, Piece, link_poses
from finger_pin.mechanism.geometry.fingers import DrawnFinger, branch_name, wind_cords
from finger_pin.mechanism.geometry.lateral_offsets import joint_axes
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.tree_mechanism import build_body

# Of the extent of a tree: distance between neighbouring tendons, and width of a link.
_SPACING, _WIDTH = 0.012, 0.06


def finger_of_tree(description: FingerDescription, resolution: int) -> DrawnFinger:
    """Return the cords of a tree.

    A cord that is a sum of joint positions winds around its hinges at radii of its coefficients. A sum over a slide, or
    with a coefficient that is no radius, is a transmission: it lies nowhere in space and is not drawn. Branches behind
    pulleys and on other chains of joints have a dot and a number after the name of the cord.
    """
    body, routes = build_body(description)
    model = body.model
    legs = _legs(description, routes)
    still, taut = link_poses(model, np.zeros(model.nq)), (np.zeros(model.nq), np.zeros(1))
    places = [
        still.translation[1:],
        *(each.place(*taut, still, np.zeros(3)) for cord in legs.values() for each in cord),
    ]
    reach = float(np.linalg.norm(np.concatenate(places), axis=1).max()) or 0.1
    extent = float(np.ptp(np.concatenate(places), axis=0).max()) or reach

    turned, turns = turned_model(body, slides=True)
    cords, joints = _wound_cords(description), range(1, turned.njoints)
    wound = wind_cords(cords, description, turned, turns, joints, (_WIDTH * extent,), resolution)
    places += [piece.place(*taut, still, np.zeros(3)) for each in wound.pieces.values() for piece in each]
    axes = joint_axes(model)
    along = np.where(axes.any(axis=1), np.abs(axes @ np.array(description.gravity)), np.inf)
    return replace(
        wound,
        pieces=legs | wound.pieces,
        lanes=replace(wound.lanes, spacing=_SPACING * extent, families=((1 + int(np.argmin(along)),),)),
        size=float(np.linalg.norm(np.concatenate(places), axis=1).max()) or reach,
    )


def _legs(description: FingerDescription, paths: TendonPaths) -> dict[str, tuple[Piece, ...]]:
    """Return the legs of paths through space: those that motors pull, then other cords of the tree."""
    driven = {tendon.along: name for name, tendon in description.tendons.items() if tendon.along is not None}
    found: dict[str, tuple[Piece, ...]] = {}
    for along in (*driven, *(name for name in paths.cords if name not in driven)):
        legs = ([paths.pieces[leg] for leg in part.elements if leg.points] for part in paths.cords[along].parts)
        for number, pieces in enumerate(filter(None, legs)):
            found[branch_name(driven.get(along, along), number)] = tuple(Leg(piece) for piece in pieces)
    return found


def _wound_cords(description: FingerDescription) -> dict[str, Cord]:
    """Return the cords that wind around hinges: tendons, and sums of joint positions that something pulls."""
    joints, driven = description.tree.joints, {tendon.along for tendon in description.tendons.values()}
    names = (*description.tendons, *(name for name in description.canals if name not in driven))
    return {
        name: cord
        for name, cord in zip(names, map(description.cord, names), strict=True)
        if not cord.through_space
        and all(joints[arm.name].kind == "hinge" and abs(arm.radius or 0.0) <= LARGEST_RADIUS for arm in cord.elements)
    }
