"""Links as bodies: the tree that a finger of links, or a hand of such fingers, is made of.

Frames are those of (1): a link starts at its joint, whose axis is z, and runs along x, its ``offset`` along the axis
away. A link touches as a capsule as wide as it is, from its joint to the next; the last one ends in the pad. Solids
follow from the sizes of links and the radii of tendons, so that a finger of other ones looks like itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from finger_pin.description.caching import memoised
from finger_pin.description.parameters import Joint, Link, Tendon
from finger_pin.description.primitives import Triple
from finger_pin.description.surface import BodyShape
from finger_pin.description.tree import Tree
from finger_pin.description.tree_parts import Body, Tip, TreeJoint, TreeSolid
from finger_pin.exceptions import InputError

#: Bodies without joints at both ends of a finger of links.
BASE, TIP = "base", "fingertip"

_ALONG_X = (0.0, math.sin(math.pi / 4.0), 0.0, math.cos(math.pi / 4.0))
_ORIGIN = (0.0, 0.0, 0.0)


def link_body(joint: str) -> str:
    """Return the name of the body that a link is."""
    return f"{joint}_link"


def _values(joints: Mapping[str, Joint], tendons: Mapping[str, Tendon]) -> tuple[object, ...]:
    links = ((name, joint.link) for name, joint in joints.items())
    sizes = ((name, link and tuple([getattr(link, key) for key in Link.model_fields])) for name, link in links)
    return (*sizes, *(_largest_radius(tendons, name) for name in joints))


@memoised(_values)
def tree_of_links(joints: Mapping[str, Joint], tendons: Mapping[str, Tendon]) -> Tree:
    """Return the bodies of a finger of links.

    Args:
        joints: By name, from the base to the tip.
        tendons: By name; their largest radius at a joint is that of its pulley.

    Raises:
        InputError: If a joint has no link, or the name of something else of a finger.
    """
    links: dict[str, Link] = {}
    for name, joint in joints.items():
        if joint.link is None:
            allowed = "is missing; the viewer shows a model of your own with finger=, all else needs sizes"
            raise InputError(f"finger.joints.{name}.link", allowed)
        if name in (TIP, f"{TIP}_fixed", "universe"):
            raise InputError(f"finger.joints.{name}", f"a joint cannot be called {TIP}, {TIP}_fixed or universe")
        links[name] = joint.link
    pulleys = [
        min(max(_largest_radius(tendons, name), 0.3 * link.width), 0.5 * link.width) for name, link in links.items()
    ]
    first, last = next(iter(links.values())), next(reversed(links.values()))
    bodies = {BASE: Body.model_construct(solids=_palm(first, pulleys[0]))}
    parent, position, twist = BASE, _ORIGIN, 0.0
    for k, (name, link) in enumerate(links.items()):
        room = 0.75 * pulleys[k + 1] if k + 1 < len(links) else _pad_radius(link)
        axial, transverse = link.inertia
        bodies[link_body(name)] = Body.model_construct(
            parent=parent,
            position=position,
            orientation=_about_x(twist),
            mass=link.mass,
            centre=(link.mass_centre, 0.0, link.offset),
            inertia=(axial, transverse, transverse, 0.0, 0.0, 0.0),
            solids=_phalanx(name, link, pulleys[k], room),
            shapes={name: _capsule(link, k + 1 == len(links))},
        )
        parent, position, twist = link_body(name), (link.length, 0.0, link.offset), link.twist
    radius = _pad_radius(last)
    pad = _solid("pad", kind="sphere", radius=radius, position=(-radius, 0.0, 0.0))
    bodies[TIP] = Body.model_construct(
        parent=parent, position=position, orientation=_about_x(twist), solids={"pad": pad}
    )
    hinges = {name: TreeJoint.model_construct(body=link_body(name)) for name in links}
    return Tree.model_construct(bodies=bodies, joints=hinges, tip=Tip.model_construct(body=TIP))


@memoised(lambda trees, places, size, centre: (*trees, *trees.values(), *places.values(), size, centre))
def placed_on_palm(
    trees: Mapping[str, Tree],
    places: Mapping[str, tuple[Triple, tuple[float, float, float, float]]],
    size: Triple,
    centre: Triple,
) -> Tree:
    """Return the bodies of several fingers of links on one base, whose names begin with that of their finger and a dot.

    Args:
        trees: By finger.
        places: Position, m, and orientation, a quaternion x, y, z, w, of each finger's base on the palm.
        size: Sides of the palm's box, m; none is drawn if one is zero.
        centre: Of the box, m.
    """
    bodies, joints, tips = {}, {}, {}
    if all(size):
        box = _solid("palm", kind="box", sides=size, position=centre)
        bodies["palm"] = Body.model_construct(solids={"palm": box})
    for finger, tree in trees.items():
        for name, body in tree.bodies.items():
            entries: dict[str, Any] = {
                part: {f"{finger}.{key}": each for key, each in getattr(body, part).items()}
                for part in ("solids", "shapes")
            }
            if body.parent is None:
                entries["position"], entries["orientation"] = places[finger]
            else:
                entries["parent"] = f"{finger}.{body.parent}"
            bodies[f"{finger}.{name}"] = body.updated(**entries)
        for name, joint in tree.joints.items():
            joints[f"{finger}.{name}"] = joint.updated(body=f"{finger}.{joint.body}")
        for name, tip in tree.fingertips.items():
            tips[".".join(filter(None, (finger, name)))] = tip.updated(body=f"{finger}.{tip.body}")
    return Tree.model_construct(bodies=bodies, joints=joints, tips=tips)


class _Capsule(BodyShape):
    """A link as it touches: its near end lies in the link before it."""

    continues: ClassVar[bool] = True


def _largest_radius(tendons: Mapping[str, Tendon], joint: str) -> float:
    crossings = (tendon.crossings.get(joint) for tendon in tendons.values())
    return max((abs(crossing.radius) for crossing in crossings if crossing), default=0.0)


def _solid(material: str, **entries: Any) -> TreeSolid:
    solid = TreeSolid.model_construct(**entries)
    solid._material = material
    return solid


def _about_x(angle: float) -> tuple[float, float, float, float]:
    return math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)


def _capsule(link: Link, is_last: bool) -> BodyShape:
    radius = 0.5 * link.width
    length = max(link.length - radius, 0.0) if is_last else link.length
    place = (0.5 * length, 0.0, link.offset)
    return _Capsule.model_construct(shape="capsule", radius=radius, length=length, position=place, orientation=_ALONG_X)


def _phalanx(joint: str, link: Link, pulley: float, room: float) -> dict[str, TreeSolid]:
    """Return a phalanx, which stops short of both its joints so that the hinges show, and the hinge at its first."""
    start, end = min(0.75 * pulley, 0.3 * link.length), link.length - min(room, 0.5 * link.length)
    centre, length = (0.5 * (start + end), 0.0, link.offset), end - start
    if link.section == "square":
        shell = _solid("shell", kind="box", sides=(length, link.width, link.width), position=centre)
    else:
        barrel = {"radius": 0.5 * link.width, "length": length, "position": centre, "orientation": (0.5, 0.5, 0.5, 0.5)}
        shell = _solid("shell", kind="cylinder", **barrel)
    hinge = {"pulley": (pulley, 0.9 * link.width), "axle": (0.35 * pulley, 1.1 * link.width)}
    return {f"{joint}_shell": shell} | {
        f"{joint}_{name}": _solid(name, kind="cylinder", radius=radius, length=long)
        for name, (radius, long) in hinge.items()
    }


def _palm(link: Link, pulley: float) -> dict[str, TreeSolid]:
    """Return the palm behind the first joint and the fork that holds it."""
    width, gap, reach, thickness = link.width, 1.15 * pulley, 0.75 * pulley, 0.14 * link.width
    block, plate = (1.6 * width, 1.9 * width, 1.5 * width), (gap + reach, 1.5 * pulley, thickness)
    x, z = 0.5 * (reach - gap), 0.5 * width + 0.6 * thickness
    boxes = {
        "palm": (block, (-gap - 0.5 * block[0], 0.0, 0.0)),
        "fork_1": (plate, (x, 0.0, z)),
        "fork_2": (plate, (x, 0.0, -z)),
    }
    return {
        name: _solid("palm", kind="box", sides=sides, position=position) for name, (sides, position) in boxes.items()
    }


def _pad_radius(link: Link) -> float:
    return min(0.5 * link.width, 0.5 * link.length)
