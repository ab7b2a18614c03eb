"""URDF of a finger, and the Pinocchio model read from it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription, HandSettings
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.parameters import Link
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.rigid_body import RigidBody, Topology
from finger_pin.mechanism.shapes import MATERIALS, Shape, link_shapes, pad_shapes, palm_shapes
from finger_pin.mechanism.urdf_tree import add_inertial, tree_to_urdf
from finger_pin.mechanism.xml_numbers import numbers as _numbers

BASE_FRAME = "base"
TIP_FRAME = "fingertip"

#: Tension that the effort limits allow each tendon, N, and the velocity limit of each joint, rad/s.
#: They are for readers of the URDF that want some; the simulation applies neither.
TENSION_LIMIT = 100.0
VELOCITY_LIMIT = 20.0

# Names that the URDF or Pinocchio gives to something else, so that looking them up would be ambiguous.
_RESERVED = (TIP_FRAME, f"{TIP_FRAME}_fixed", "universe")


def to_urdf(description: DescriptionLike | Scenario, drawn: bool = True) -> str:
    """Return the URDF of a finger as text: Table I, inertias, joint ranges and shapes.

    Links are named ``base``, ``<joint>_link`` and ``fingertip``. A link's frame is its joint's: the axis is z
    and the link runs along x, its ``offset`` along the axis away. Numbers are written so that reading them gives the
    same floats.

    Args:
        description: The finger, its name, the path of its file, or the scenario that has it; not a hand of several.
        drawn: With shapes, and indented. Its motion needs neither.

    Of a tree of bodies, links have the names of these, and the frame of their last joint; tendons, actuators and what
    else a URDF has no place for are named in it.

    Raises:
        InputError: If it is no finger, it has a joint without a link, or a name that the URDF needs itself.
    """
    description = describe(description.finger if isinstance(description, Scenario) else description)
    if description.tree.bodies:
        return tree_to_urdf(description, drawn, BASE_FRAME, TIP_FRAME, TENSION_LIMIT, VELOCITY_LIMIT)
    if description.hand is not None:
        allowed = "is a hand; write its fingers one by one: description.hand.built()"
        raise InputError("finger", allowed, description.name)
    links = _links(description)
    shapes = _shapes(description, links) if drawn else {}
    robot = ET.Element("robot", name=description.name)
    for material, colour in (MATERIALS if drawn else {}).items():
        ET.SubElement(ET.SubElement(robot, "material", name=material), "color", rgba=_numbers(*colour))
    _add_link(robot, BASE_FRAME, shapes.get(BASE_FRAME, ()))
    parent, place, twist = BASE_FRAME, (0.0, 0.0, 0.0), 0.0
    for name, link in links.items():
        child = f"{name}_link"
        _add_link(robot, child, shapes.get(name, ()), inertia_of=link)
        joint = _add_joint(robot, name, "revolute", parent, child, place, twist)
        ET.SubElement(joint, "axis", xyz=_numbers(0, 0, 1))
        lower, upper = description.joints[name].range
        limits = {"lower": lower, "upper": upper, "effort": effort_limit(description, name)}
        limits["velocity"] = VELOCITY_LIMIT
        ET.SubElement(joint, "limit", {key: _numbers(value) for key, value in limits.items()})
        parent, place, twist = child, (link.length, 0.0, link.offset), link.twist
    _add_link(robot, TIP_FRAME, shapes.get(TIP_FRAME, ()))
    _add_joint(robot, f"{TIP_FRAME}_fixed", "fixed", parent, TIP_FRAME, place, twist)
    if drawn:
        ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"


def effort_limit(description: FingerDescription, joint: str) -> float:
    """Return the torque on a joint, N m, when the tendons on its stronger side all carry `TENSION_LIMIT`."""
    crossings = [tendon.crossings.get(joint) for tendon in description.tendons.values()]
    radii = [crossing.radius for crossing in crossings if crossing]
    return TENSION_LIMIT * max(sum(r for r in radii if r > 0.0), -sum(r for r in radii if r < 0.0))


def build_rigid_body(description: FingerDescription) -> RigidBody:
    """Return the rigid body of a finger or of a hand's fingers: URDF read by Pinocchio, with its gravity."""
    return _build(description) if description.hand is None else build_hand(description.hand)


def _body_key(description: FingerDescription) -> tuple[object, ...]:
    """Return all that a finger's body depends on, by value."""
    links = (joint.link for joint in description.joints.values())
    values = (link and tuple(getattr(link, name) for name in Link.model_fields) for link in links)
    return (description.name, description.gravity, *description.joints, *values)


@memoised(_body_key)
def _build(description: FingerDescription) -> RigidBody:
    model = _read(to_urdf(description, drawn=False)).copy()
    model.gravity.linear[:] = description.gravity
    body = RigidBody(model, TIP_FRAME)
    places = [(name, each.length, each.offset, each.twist) for name, each in _links(description).items()]
    body.topology = _topology(*places)
    return body


@memoised(lambda *places: places)
def _topology(*places: object) -> Topology:
    """Return the topology shared by links of equal lengths, offsets and twists."""
    return Topology()


@lru_cache(maxsize=16)
def _read(text: str) -> pin.Model:
    """Return the model of a URDF; a hand is read as a whole and finger by finger."""
    return pin.buildModelFromXML(text)


def build_hand(hand: HandSettings) -> RigidBody:
    """Return the rigid body of a hand: its fingers in their places, in the palm's frame."""
    pulled = {"gravity": hand.gravity}
    parts = {name: build_rigid_body(finger.model_copy(update=pulled)) for name, finger in hand.built().items()}
    placed = tuple((name, each.position, each.orientation) for name, each in hand.fingers.items())
    return _weighed_hand(hand, placed, parts)


@memoised(lambda hand, placed, parts: (hand.gravity, *placed, *parts.values()))
def _weighed_hand(hand: HandSettings, placed: tuple[object, ...], parts: Mapping[str, RigidBody]) -> RigidBody:
    joined = _joined_hand(hand, placed, parts)
    return joined.with_inertias([each for part in parts.values() for each in part.inertias], hand.gravity)


@memoised(lambda hand, placed, parts: (*placed, *(part.topology for part in parts.values())))
def _joined_hand(hand: HandSettings, placed: tuple[object, ...], parts: Mapping[str, RigidBody]) -> RigidBody:
    places = {name: pin.SE3(each.rotation, np.array(each.position)) for name, each in hand.fingers.items()}
    return join_bodies(parts, places)


def _links(description: FingerDescription) -> dict[str, Link]:
    links = {}
    for name, joint in description.joints.items():
        if name in _RESERVED:
            raise InputError(f"finger.joints.{name}", f"a joint cannot be called {' or '.join(_RESERVED)}")
        if joint.link is None:
            raise InputError(f"finger.joints.{name}.link", "is needed to generate a URDF")
        links[name] = joint.link
    return links


def _shapes(description: FingerDescription, links: dict[str, Link]) -> dict[str, list[Shape]]:
    """Return the shapes of the links, by joint, of the palm and of the fingertip, by frame."""
    first, last = next(iter(links)), next(reversed(links.values()))
    palm, pad = palm_shapes(description, first, links[first]), pad_shapes(last)
    return {BASE_FRAME: palm, **link_shapes(description, links), TIP_FRAME: pad}


def _add_link(robot: ET.Element, name: str, shapes: Iterable[Shape], inertia_of: Link | None = None) -> None:
    element = ET.SubElement(robot, "link", name=name)
    if inertia_of is None:
        add_inertial(element, pin.SE3.Identity(), 0.0)
    else:
        axial, transverse = inertia_of.inertia
        place = pin.SE3(np.eye(3), np.array([inertia_of.mass_centre, 0.0, inertia_of.offset]))
        add_inertial(element, place, inertia_of.mass, (axial, transverse, transverse, 0.0, 0.0, 0.0))
    for shape in shapes:
        visual = _add_shape(element, "visual", shape)
        ET.SubElement(visual, "material", name=shape.material)
    for shape in shapes:
        if shape.collides:
            _add_shape(element, "collision", shape)


def _add_shape(link: ET.Element, role: str, shape: Shape) -> ET.Element:
    element = ET.SubElement(link, role)
    ET.SubElement(element, "origin", xyz=_numbers(*shape.position), rpy=_numbers(*shape.rotation))
    geometry = ET.SubElement(element, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=_numbers(*shape.size))
    else:
        sizes = zip(("radius", "length"), shape.size, strict=False)
        ET.SubElement(geometry, shape.kind, {key: _numbers(value) for key, value in sizes})
    return element


def _add_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, place: tuple[float, float, float], twist: float
) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=_numbers(*place), rpy=_numbers(twist, 0, 0))
    return joint


def join_bodies(parts: Mapping[str, RigidBody], places: Mapping[str, pin.SE3] | None = None) -> RigidBody:
    """Return several bodies on one base; names of joints and tips begin with that of their part and a dot.

    Args:
        parts: By name.
        places: Placements of the parts' base frames on the common base; there itself by default. Gravity is that
            of the common base.

    Raises:
        InputError: If gravity is not the same for all.
    """
    model, tips = pin.Model(), []
    axes, carriers = [np.array([1.0, 0.0, 0.0])], [0]
    model.gravity = next(iter(parts.values())).model.gravity
    for part, body in parts.items():
        part_model, shift = body.model, model.njoints - 1
        place = (places or {}).get(part, pin.SE3.Identity())
        if part_model.gravity != model.gravity:
            raise InputError(f"{part}.gravity", f"must be {model.gravity.linear}", part_model.gravity.linear)
        for index in range(1, part_model.njoints):
            parent = int(part_model.parents[index])
            joint, placement = part_model.joints[index], part_model.jointPlacements[index]
            placement = placement if parent else place * placement
            at = model.addJoint(parent and parent + shift, joint, placement, f"{part}.{part_model.names[index]}")
            # Appending bodies, or frames with theirs, would round.
            model.inertias[at] = part_model.inertias[index]
            at, moved = model.joints[at].idx_v, part_model.joints[index]
            model.armature[at : at + moved.nv] = part_model.armature[moved.idx_v : moved.idx_v + moved.nv]
        for tip in body.tips:
            frame = part_model.frames[tip]
            holder = frame.parentJoint and frame.parentJoint + shift
            tips.append(f"{part}.{frame.name}")
            frame_placement = frame.placement if holder else place * frame.placement
            model.addFrame(pin.Frame(tips[-1], holder, 0, frame_placement, pin.FrameType.OP_FRAME), False)
        along = zip(body.proximal_axes[1:], body.parent_links[1:], strict=True)
        axes += [axis if carrier else place.rotation @ axis for axis, carrier in along]
        carriers += [carrier and carrier + shift for carrier in body.parent_links[1:]]
    joined = RigidBody(model, tips)
    joined.proximal_axes, joined.parent_links = axes, carriers
    return joined
