"""Fingers of a picture: their cords side by side, wound around the joints that they cross."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.mechanism.geometry.cord_pieces import Piece
from finger_pin.mechanism.geometry.lateral_offsets import Lanes, tendon_lanes
from finger_pin.mechanism.geometry.wound_tendon import BASE_LEAD, joint_chains, wind
from finger_pin.typing import Array

#: Width of a finger whose links are not known, in parts of the largest radius that a tendon winds at.
_WIDTH = 1.8


@dataclass(frozen=True, eq=False)
class DrawnFinger:
    """A finger with its tendons.

    Attributes:
        pieces: Of its tendons, by name.
        lanes: Offset of each tendon along the joint axes.
        widths: Of its links, m.
        size: Largest distance of its tip from the base, about, m.
    """

    pieces: dict[str, tuple[Piece, ...]]
    lanes: Lanes
    widths: tuple[float, ...]
    size: float = 0.0


def wind_cords(
    cords: Mapping[str, Cord],
    description: FingerDescription,
    model: pin.Model,
    turns: Sequence[Array],
    joints: Sequence[int],
    widths: Sequence[float],
    resolution: int,
) -> DrawnFinger:
    """Wind the cords of a finger around its joints; what is on another chain of joints has a number after its name.

    Args:
        cords: Its tendons, by name.
        description: Whose joints are those of the model.
        model: Pinocchio model whose joints turn about z.
        turns: Rotations from the model's frames to those of the links that are drawn, the base first.
        joints: Indices of its joints, 1 for the model's first.
        widths: Of its links, m.
        resolution: Points per span and per radian of arc.
    """
    indices = {name: index for index, name in enumerate(description.joints, start=1)}
    ranges = {indices[name]: joint.range for name, joint in description.joints.items()}
    arms, mass_links = {}, {}
    for name, cord in cords.items():
        for number, chain in enumerate(joint_chains(cord, indices, model)):
            arms[branch_name(name, number)] = chain
            mass_links[branch_name(name, number)] = _mass_link(cord, indices, model)
    lanes = tendon_lanes(arms, model, widths, joints)
    pieces: dict[str, tuple[Piece, ...]] = {}
    for name, chain in arms.items():
        wound = wind(chain, ranges, model, lanes, name, resolution, mass_links[name])
        pieces[name] = tuple(piece.turned(turns) for piece in wound)
    return DrawnFinger(pieces, lanes, tuple(widths))


def wound_fingers(description: FingerDescription, model: pin.Model, resolution: int) -> list[DrawnFinger]:
    """Return the fingers of a hand on a model whose joints turn about z, or the only one.

    Those without links are as wide as their tendons' radii say.
    """
    routing, fingers = Routing.from_description(description), []
    for joints, tendons in routing.fingers:
        cords = {routing.tendons[k]: routing.cords[routing.tendons[k]] for k in tendons}
        links = [link for k in joints if (link := description.joints[routing.joints[k]].link) is not None]
        base, *lengths = [float(np.linalg.norm(model.jointPlacements[1 + int(k)].translation)) for k in joints]
        if links:
            widths, lengths = [link.width for link in links], [base, *(link.length for link in links)]
        else:
            widths = [_WIDTH * float(np.abs(routing.coupling[tendons]).max())] * len(joints)
            lengths = [*lengths, max(lengths, default=widths[0])]
        still = [np.eye(3)] * model.njoints
        finger = wind_cords(cords, description, model, still, (1 + joints).tolist(), widths, resolution)
        fingers.append(replace(finger, size=BASE_LEAD * widths[0] + sum(lengths)))
    return fingers


def branch_name(name: str, number: int) -> str:
    """Return the name of a part of a cord, which has a dot and a number behind the first."""
    return f"{name}.{number}" if number else name


def _mass_link(cord: Cord, indices: Mapping[str, int], model: pin.Model) -> int:
    # The lumped mass is drawn on the link after its last proximal crossing; nowhere on an actuated tendon.
    if cord.mass_after is None:
        return int(model.njoints)
    crossed = [indices[element.name] for element in cord.elements]
    return crossed[cord.mass_after - 1] if cord.mass_after else int(model.parents[crossed[0]])
