"""A finger that is given as a tree, in space: its solids, and its cords around hinges and along paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree import LARGEST_RADIUS, Tree
from finger_pin.mechanism.from_pinocchio import turned_model
from finger_pin.mechanism.geometry.cord_pieces import Leg, link_poses
from finger_pin.mechanism.geometry.fingers import WoundFinger, winding_surfaces
from finger_pin.mechanism.geometry.lateral_offsets import joint_axes, tendon_lanes
from finger_pin.mechanism.geometry.wound_tendon import joint_chains, wind
from finger_pin.mechanism.path_elements import PathTerm
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.tree_mechanism import build_body

# Of the extent of a tree: distance between neighbouring tendons, and width of a link.
_SPACING, _WIDTH = 0.012, 0.06


def finger_of_tree(description: FingerDescription, resolution: int) -> WoundFinger:
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
    indices = {name: index for index, name in enumerate(description.joints, start=1)}
    ranges = {indices[name]: joint.range for name, joint in description.joints.items()}
    arms = {
        _branch_name(name, number): chain
        for name, cord in _wound_cords(description).items()
        for number, chain in enumerate(joint_chains(cord, indices, turned))
    }
    lanes = tendon_lanes(arms, turned, (_WIDTH * extent,))
    pieces = {}
    for name, chain in arms.items():
        wound = wind(chain, ranges, turned, lanes, name, resolution, model.njoints)
        pieces[name] = tuple(piece.turned(turns) for piece in wound)
        places += [piece.place(*taut, still, np.zeros(3)) for piece in pieces[name]]
    axes = joint_axes(model)
    along = np.where(axes.any(axis=1), np.abs(axes @ np.array(description.gravity)), np.inf)
    return WoundFinger(
        pieces,
        tuple(replace(pulley, frame=turns[pulley.joint]) for pulley in winding_surfaces(arms, lanes)),
        replace(lanes, spacing=_SPACING * extent, families=((1 + int(np.argmin(along)),),)),
        (_WIDTH * extent,),
        float(np.linalg.norm(np.concatenate(places), axis=1).max()) or reach,
        legs,
    )


def _branch_name(name: str, number: int) -> str:
    return f"{name}.{number}" if number else name


def _legs(description: FingerDescription, routes: TendonPaths) -> dict[str, tuple[Leg, ...]]:
    """Return the legs of paths through space: those that motors pull, then other cords of the tree."""
    driven = {tendon.along: name for name, tendon in description.tendons.items() if tendon.along is not None}
    return {
        _branch_name(driven.get(along, along), number): tuple(Leg(term.piece) for term in branch)
        for along in (*driven, *(name for name in routes.routes if name not in driven))
        for number, branch in enumerate(_branches(routes.routes[along].legs))
    }


def _wound_cords(description: FingerDescription) -> dict[str, Cord]:
    """Return the cords that wind around hinges: tendons, and sums of joint positions that something pulls."""
    tree = description.tree
    driven = {tendon.along for tendon in description.tendons.values()}
    names = (*description.tendons, *(name for name in tree.rubbing if name not in driven))
    cords = {name: description.cord(name) for name in names}
    return {name: cord for name, cord in cords.items() if not cord.through_space and _winds(cord, tree)}


def _winds(cord: Cord, tree: Tree) -> bool:
    arms = {element.name: abs(element.radius or 0.0) for element in cord.elements}
    return all(tree.joints[name].kind == "hinge" and arm <= LARGEST_RADIUS for name, arm in arms.items())


def _branches(legs: Sequence[PathTerm]) -> list[list[PathTerm]]:
    """Return the connected parts of a path, which pulleys divide."""
    branches: list[list[PathTerm]] = []
    for leg in legs:
        if branches and leg.follows:
            branches[-1].append(leg)
        else:
            branches.append([leg])
    return branches
