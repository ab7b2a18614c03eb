"""Finger of a picture: its wound tendons, its solids, and the index of its first joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.mechanism.bodies import build_rigid_body
from finger_pin.mechanism.from_pinocchio import chain, finger_width, placed_solids, turned_model
from finger_pin.mechanism.geometry.cord_pieces import Arc, Leg, WoundSpan
from finger_pin.mechanism.geometry.lateral_offsets import Lanes, tendon_lanes
from finger_pin.mechanism.geometry.visuals import Visual, model_visual
from finger_pin.mechanism.geometry.wound_tendon import BASE_LEAD, joint_chains, wind
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class Pulley:
    """The winding surface of one tendon at one joint.

    Attributes:
        tendon: Name of the tendon.
        joint: Index of the joint, 1 for the first.
        radius: r, signed, m.
        offset: Along the joint axis, m.
        frame: Rotation of the pulley, whose axis is z, in the frame of the link after the joint, shape (3, 3).
    """

    tendon: str
    joint: int
    radius: float
    offset: float
    frame: Array = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True, eq=False)
class WoundFinger:
    """A finger with its tendons wound.

    Attributes:
        pieces: Of its tendons, by name.
        pulleys: Winding surfaces whose radius is not zero.
        lanes: Offset of each tendon along the joint axes.
        widths: Of its links, m.
        size: Largest distance of its tip from its base, about, m.
        legs: Of its cords through space, by name.
    """

    pieces: dict[str, tuple[WoundSpan | Arc, ...]]
    pulleys: tuple[Pulley, ...]
    lanes: Lanes
    widths: tuple[float, ...]
    size: float
    legs: dict[str, tuple[Leg, ...]] = field(default_factory=dict)

    @classmethod
    def from_links(cls, description: FingerDescription, resolution: int) -> WoundFinger:
        """Wind the tendons of a finger that is made of links."""
        model = build_rigid_body(description).model
        links = [joint.link for joint in description.joints.values() if joint.link is not None]
        widths = tuple(link.width for link in links)
        size = BASE_LEAD * widths[0] + sum(link.length for link in links)
        return cls._wound(description, model, widths, size, resolution)

    @classmethod
    def from_chain(cls, description: FingerDescription, model: pin.Model, resolution: int) -> WoundFinger:
        """Wind the tendons of a finger on the joints of a chain, which carries solids of its own."""
        width = finger_width(description)
        lengths = [float(np.linalg.norm(each.translation)) for each in list(model.jointPlacements)[2:]]
        size = BASE_LEAD * width + sum(lengths) + max(lengths, default=width)
        return cls._wound(description, model, (width,) * len(description.joints), size, resolution)

    @classmethod
    def _wound(
        cls, description: FingerDescription, model: pin.Model, widths: tuple[float, ...], size: float, resolution: int
    ) -> WoundFinger:
        indices = {name: index for index, name in enumerate(description.joints, start=1)}
        ranges = dict(enumerate((joint.range for joint in description.joints.values()), start=1))
        arms = {
            name: {indices[joint]: crossing.radius for joint, crossing in tendon.crossings.items()}
            for name, tendon in description.tendons.items()
        }
        lanes = tendon_lanes(arms, model, widths)
        pieces = {}
        for name in description.tendons:
            (radius,) = joint_chains(description.cord(name), indices, model)
            mass_link = _mass_link(description, name, list(arms[name]))
            pieces[name] = wind(radius, ranges, model, lanes, name, resolution, mass_link)
        return cls(pieces, winding_surfaces(arms, lanes), lanes, widths, size)

    def placed(self, name: str, place: pin.SE3, first: int) -> WoundFinger:
        """Return the finger as part of a hand: under dotted names, at its place, after ``first`` other joints."""
        lanes = replace(
            self.lanes,
            offset={(f"{name}.{tendon}", first + joint): at for (tendon, joint), at in self.lanes.offset.items()},
            families=tuple(tuple(first + joint for joint in family) for family in self.lanes.families),
        )
        pulleys = (replace(each, tendon=f"{name}.{each.tendon}", joint=first + each.joint) for each in self.pulleys)
        return replace(
            self,
            pieces={
                f"{name}.{key}": tuple(each.moved(place, first) for each in pieces)
                for key, pieces in self.pieces.items()
            },
            pulleys=tuple(pulleys),
            lanes=lanes,
            size=self.size + float(np.linalg.norm(place.translation)),
        )


def fingers_of_links(description: FingerDescription, resolution: int) -> list[WoundFinger]:
    """Return the fingers of a hand that is made of links, or the only one."""
    hand, first, fingers = description.hand, 0, []
    if hand is None:
        return [WoundFinger.from_links(description, resolution)]
    for name, finger in hand.built().items():
        placed = hand.fingers[name]
        place = pin.SE3(placed.rotation, np.array(placed.position))
        fingers.append(WoundFinger.from_links(finger, resolution).placed(name, place, first))
        first += len(finger.joints)
    return fingers


def fingers_on_model(
    description: FingerDescription, body: RigidBody, solids: pin.GeometryModel | None, resolution: int
) -> tuple[pin.Model, list[WoundFinger], tuple[Visual, ...]]:
    """Return a model whose joint axes are z, the fingers on it, and its solids."""
    model, turns = turned_model(body)
    hand, first, fingers = description.hand, 0, []
    for name, finger in {"": description}.items() if hand is None else hand.built().items():
        wound = WoundFinger.from_chain(finger, chain(model, first + 1, len(finger.joints)), resolution)
        fingers.append(wound.placed(name, pin.SE3.Identity(), first) if name else wound)
        first += len(finger.joints)
    placed = placed_solids(solids, turns) if solids is not None else ()
    return model, fingers, tuple(model_visual(each, placement) for each, placement in placed)


def winding_surfaces(arms: Mapping[str, Mapping[int, float]], lanes: Lanes) -> tuple[Pulley, ...]:
    """Return the winding surfaces of tendons, by their arms, m, of each tendon by joint."""
    return tuple(
        Pulley(name, joint, radius, lanes.offset[name, joint])
        for name, by_joint in arms.items()
        for joint, radius in by_joint.items()
        if radius
    )


def _mass_link(description: FingerDescription, tendon: str, crossed: list[int]) -> int:
    # The lumped mass is drawn on the link after its last proximal crossing; nowhere on an actuated tendon.
    if description.tendons[tendon].kind == "actuated":
        return len(description.joints) + 1
    before = description.tendons[tendon].proximal_crossings
    return crossed[before - 1] if before else crossed[0] - 1
