"""Shapes of a finger: phalanges, hinge pulleys, a soft fingertip and a palm, from primitives only.

Sizes follow from the description, so that a finger of other links or tendons looks like itself. Frames are
those of the URDF: a link starts at its joint, whose axis is z, and runs along x.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.parameters import Link

#: Red, green, blue and opacity of each material, 0 to 1.
MATERIALS: dict[str, tuple[float, float, float, float]] = {
    "shell": (0.80, 0.81, 0.82, 1.0),
    "pulley": (0.16, 0.17, 0.20, 1.0),
    "axle": (0.72, 0.56, 0.28, 1.0),
    "pad": (0.90, 0.38, 0.18, 1.0),
    "palm": (0.30, 0.34, 0.40, 1.0),
}

_ALONG_X = (0.0, math.pi / 2, 0.0)
_ALONG_Z = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shape:
    """A primitive fixed to a link.

    Attributes:
        kind: Primitive; a cylinder runs along its own z axis.
        size: Box: sides; cylinder: radius and length; sphere: radius; m.
        position: Of its centre in the frame of the link, m.
        rotation: Roll, pitch and yaw in the frame of the link, rad.
        material: Key of `MATERIALS`.
        collides: Whether it is also a collision shape.
    """

    kind: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]
    position: tuple[float, float, float]
    rotation: tuple[float, float, float] = _ALONG_Z
    material: str = "shell"
    collides: bool = False


def largest_radius(description: FingerDescription, joint: str) -> float:
    """Return the largest winding radius, without sign, of the tendons that cross a joint, m."""
    crossings = (tendon.crossings.get(joint) for tendon in description.tendons.values())
    return max((abs(crossing.radius) for crossing in crossings if crossing), default=0.0)


def link_shapes(description: FingerDescription, links: Mapping[str, Link]) -> dict[str, list[Shape]]:
    """Return the shapes of the links of a finger, by the name of the joint that moves them.

    A phalanx stops short of both its joints, by a part of the pulleys there, so that the hinges show.

    Args:
        description: The finger.
        links: Its links by joint, from the base to the tip.
    """
    names = list(links)
    radii = [_pulley_radius(description, name, links[name]) for name in names]
    shapes = {}
    for index, (name, link) in enumerate(links.items()):
        last = index + 1 == len(names)
        room = _pad_radius(link) if last else 0.75 * radii[index + 1]
        start, end = min(0.75 * radii[index], 0.3 * link.length), link.length - min(room, 0.5 * link.length)
        shapes[name] = [_phalanx(link, start, end), *_hinge(link, radii[index])]
    return shapes


def pad_shapes(link: Link) -> list[Shape]:
    """Return the soft end of the last link, in the fingertip frame."""
    radius = _pad_radius(link)
    return [Shape("sphere", (radius,), (-radius, 0.0, 0.0), material="pad", collides=True)]


def palm_shapes(description: FingerDescription, joint: str, link: Link) -> list[Shape]:
    """Return the palm behind the first joint and the fork that holds it, in the base frame."""
    width, radius = link.width, _pulley_radius(description, joint, link)
    gap, reach, thickness = 1.15 * radius, 0.75 * radius, 0.14 * width
    block = (1.6 * width, 1.9 * width, 1.5 * width)
    plate = (gap + reach, 1.5 * radius, thickness)
    x, z = 0.5 * (reach - gap), 0.5 * width + 0.6 * thickness
    return [
        Shape("box", block, (-gap - 0.5 * block[0], 0.0, 0.0), material="palm", collides=True),
        Shape("box", plate, (x, 0.0, z), material="palm"),
        Shape("box", plate, (x, 0.0, -z), material="palm"),
    ]


def _pulley_radius(description: FingerDescription, joint: str, link: Link) -> float:
    return min(max(largest_radius(description, joint), 0.3 * link.width), 0.5 * link.width)


def _pad_radius(link: Link) -> float:
    return min(0.5 * link.width, 0.5 * link.length)


def _phalanx(link: Link, start: float, end: float) -> Shape:
    centre, length = (0.5 * (start + end), 0.0, link.offset), end - start
    if link.section == "square":
        return Shape("box", (length, link.width, link.width), centre, collides=True)
    return Shape("cylinder", (0.5 * link.width, length), centre, _ALONG_X, collides=True)


def _hinge(link: Link, radius: float) -> list[Shape]:
    origin = (0.0, 0.0, 0.0)
    return [
        Shape("cylinder", (radius, 0.9 * link.width), origin, material="pulley"),
        Shape("cylinder", (0.35 * radius, 1.1 * link.width), origin, material="axle"),
    ]
