"""The tree of bodies that a finger of links, or a hand of fingers of links or bodies, is made of.

Frames are those of (1): a link starts at its joint, whose axis is z, and runs along x, its ``offset`` along the axis
away. A link touches as a capsule as wide as it is, from its joint to the next; the last one ends in the pad. Solids
follow from the sizes of links and the radii of tendons, so that a finger of other ones looks like itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from finger_pin.description.caching import memoised
from finger_pin.description.parameters import Joint, Link, Tendon
from finger_pin.description.primitives import Triple
from finger_pin.description.surface import BodyShape
from finger_pin.description.tree import Tree
from finger_pin.description.tree_actuators import Wrench
from finger_pin.description.tree_parts import Body, Keyframe, Tip, TreeJoint, TreeSolid
from finger_pin.description.waypoints import SidePoint
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


def is_base(tree: Tree, name: str) -> bool:
    """Return whether a body is the base itself: fixed on it, in its place."""
    body = tree.bodies[name]
    is_placed = any(body.position) or any(body.orientation[:3])
    return body.parent is None and not is_placed and not tree.joints_of(name)


@memoised(lambda trees, places, size, centre: (*trees, *trees.values(), *places.values(), size, centre))
def placed_on_palm(
    trees: Mapping[str, Tree],
    places: Mapping[str, tuple[Triple, tuple[float, float, float, float]]],
    size: Triple,
    centre: Triple,
) -> Tree:
    """Return the trees of several fingers as one, on one base; names begin with that of their finger and a dot.

    The base of a finger is the body that stands there alone, or else a body of its own, ``<finger>_mount``. A keyframe
    of a finger has the first ones of the others.

    Args:
        trees: By finger.
        places: Position, m, and orientation, a quaternion x, y, z, w, of each finger's base on the palm.
        size: Sides of the palm's box, m; none is drawn if one is zero.
        centre: Of the box, m.
    """
    joined: dict[str, Any] = {group: {} for group in _TABLES}
    if all(size):
        box = _solid("palm", kind="box", sides=size, position=centre)
        joined["bodies"]["palm"] = Body.model_construct(solids={"palm": box})
    keyframes: dict[str, dict[str, Keyframe]] = {}
    for finger, tree in trees.items():
        roots = [name for name, body in tree.bodies.items() if body.parent is None]
        alone = len(roots) == 1 and is_base(tree, roots[0])
        base = f"{finger}.{roots[0]}" if alone else f"{finger}_mount"
        tables = _named_in_hand(tree, finger, base)
        position, orientation = places[finger]
        stand = tables["bodies"].pop(base, None) or Body.model_construct()
        stand = stand.updated(parent=None, position=position, orientation=orientation)
        tables["bodies"] = {base: stand, **tables["bodies"]}
        for group, table in tables.items():
            joined[group].update(table)
        keyframes[finger] = tables["keyframes"]
    joined["keyframes"] = _of_all(keyframes)
    touching = tuple(
        (f"{finger}.{one}", f"{finger}.{two}") for finger, tree in trees.items() for one, two in tree.touching
    )
    left_out = tuple(dict.fromkeys(line for tree in trees.values() for line in tree.left_out))
    return Tree.model_construct(**joined, touching=touching, left_out=left_out)


# Tables of a tree whose names those of a hand are made of.
_TABLES = ("bodies", "joints", "tendons", "couplings", "loops", "actuators", "keyframes", "tips", "meshes")


def _named_in_hand(tree: Tree, finger: str, base: str) -> dict[str, dict[str, Any]]:
    """Return the tables of a tree with the names of a hand; what is on the base is on a body."""

    def named(name: str | None) -> str | None:
        return name and f"{finger}.{name}"

    def on_body(name: str | None) -> str:
        return f"{finger}.{name}" if name else base

    def keyed(table: Mapping[str, Any] | None, **entries: Callable[[Any], Any]) -> dict[str, Any]:
        return {
            f"{finger}.{key}": each.updated(**{entry: name(getattr(each, entry)) for entry, name in entries.items()})
            if entries
            else each
            for key, each in (table or {}).items()
        }

    def solids(table: Mapping[str, TreeSolid]) -> dict[str, TreeSolid]:
        return {
            f"{finger}.{key}": each if each.mesh is None else each.updated(mesh=named(each.mesh))
            for key, each in table.items()
        }

    def side(point: SidePoint | None) -> SidePoint | None:
        return point and point.updated(body=on_body(point.body))

    def wrench(one: Wrench | None) -> Wrench | None:
        other = on_body(one.other) if one and one.axes == "other" else None
        return one and one.updated(body=on_body(one.body), other=other)

    return {
        "bodies": keyed(tree.bodies, parent=on_body, solids=solids, shapes=keyed),
        "joints": keyed(tree.joints, body=on_body),
        "tendons": keyed(
            tree.tendons,
            joints=lambda gains: gains and keyed(gains),
            path=lambda path: path and keyed(path, body=on_body, side_point=side),
        ),
        "couplings": keyed(tree.couplings, joint=named, tendon=named, other=named),
        "loops": keyed(tree.loops, body=on_body, other=on_body),
        "actuators": keyed(tree.actuators, joint=named, tendon=named, wrench=wrench),
        "keyframes": keyed(tree.keyframes, position=keyed, velocity=keyed, inputs=keyed),
        "tips": {
            ".".join(filter(None, (finger, name))): tip.updated(body=on_body(tip.body))
            for name, tip in tree.fingertips.items()
        },
        "meshes": keyed(tree.meshes),
    }


def _of_all(keyframes: Mapping[str, Mapping[str, Keyframe]]) -> dict[str, Keyframe]:
    """Return the keyframes of all fingers, each with the first ones of the others."""
    firsts = {finger: next(iter(table.values())) for finger, table in keyframes.items() if table}
    joined = {}
    for finger, table in keyframes.items():
        for name, keyframe in table.items():
            postures = (firsts | {finger: keyframe}).values()
            entries = ("position", "velocity", "inputs")
            joined[name] = keyframe.updated(
                **{
                    entry: {key: value for each in postures for key, value in getattr(each, entry).items()}
                    for entry in entries
                }
            )
    return joined


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
