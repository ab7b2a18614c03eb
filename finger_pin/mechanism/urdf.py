"""URDF of a finger, a hand or a tree: links, joints and shapes; tendons and what drives joints have no place in it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.links import BASE, TIP, is_base
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.primitives import KINDS
from finger_pin.description.scenario import Scenario
from finger_pin.description.tree_couplings import Coupling
from finger_pin.description.tree_parts import MATERIALS, Body, TreeJoint, TreeSolid
from finger_pin.mechanism.body_places import joint_placement, rotation
from finger_pin.mechanism.xml_numbers import numbers as _numbers

#: Tension that the effort limits allow each tendon, N, and the velocity limit of each joint, rad/s.
#: They are for readers of the URDF that want some; the simulation applies neither.
TENSION_LIMIT = 100.0
VELOCITY_LIMIT = 20.0

# The element of a geometry, and its attributes from the scale.
_ELEMENTS: dict[str, Callable[[Sequence[float]], tuple[str, dict[str, str]]]] = {
    "box": lambda scale: ("box", {"size": _numbers(*scale)}),
    "ball": lambda scale: ("sphere", {"radius": _numbers(scale[0])}),
    "cylinder": lambda scale: ("cylinder", {"radius": _numbers(scale[0]), "length": _numbers(scale[2])}),
}
# Mass and moments of the links between several joints of a body, kg and kg m2: MuJoCo refuses moving ones without.
_SLIGHT = 1e-14
_SLIGHT_INERTIA = (_SLIGHT,) * 3 + (0.0,) * 3
_NOTES = """
  {title}

  Written from a tree of bodies. A body with several joints has a link for each, of which the last has its mass
  and the others 1e-14 kg.
  Left out, because a URDF has no place for it: tendons, actuators, loops, springs, the inertia of rotors;
  couplings by more than a ratio and an offset, meshes, {kinds}, objects.{rest}
"""


def to_urdf(description: DescriptionLike | Scenario, drawn: bool = True) -> str:
    """Return the URDF of a finger, a hand or a tree as text: Table I, inertias, joint ranges and shapes.

    Links are named ``base``, ``<joint>_link`` and ``fingertip``, those of a tree as its bodies. A link's frame is that
    of its (last) joint: of a finger of links the axis is z and the link runs along x, its ``offset`` along the axis
    away. Numbers are written so that reading them gives the same floats. What a URDF has no place for is named in that
    of a tree.

    Args:
        description: The finger, its name, the path of its file, or the scenario that has it.
        drawn: With shapes, and indented. Its motion needs neither.

    Raises:
        InputError: If it is no finger, it has a joint without a link, or a name that the URDF needs itself.
    """
    description = describe(description.finger if isinstance(description, Scenario) else description)
    tree = description.bodies
    root = ET.Element("robot", name=description.name)
    if description.tree.bodies:
        root.append(ET.Comment(_notes(description)))
    used = {solid.material for body in tree.bodies.values() for solid in body.solids.values()} if drawn else set()
    for material, colour in MATERIALS.items():
        if material in used:
            ET.SubElement(ET.SubElement(root, "material", name=material), "color", rgba=_numbers(*colour))
    base = BASE
    while base in tree.bodies and not is_base(tree, base):
        base += "_"
    if base not in tree.bodies:
        _add_massless_link(root, base)
    placed: dict[str | None, tuple[str, pin.SE3]] = {None: (base, pin.SE3.Identity())}
    courses = {each.joint: each for each in tree.couplings.values() if each.other and not any(each.higher)}
    for name, body in tree.bodies.items():
        link, place = placed[body.parent]
        place = place * pin.SE3(rotation(body.orientation), np.array(body.position))
        joints = tree.joints_of(name)
        for key in joints:
            moved, child = tree.joints[key], name if key == joints[-1] else f"{name}_{key}"
            joint = _add_joint(root, key, _kind(description, key, moved), link, child, joint_placement(place, moved))
            ET.SubElement(joint, "axis", xyz=_numbers(*moved.axis))
            _complete(joint, description, key, moved, courses.get(key))
            if child != name:
                add_inertial(ET.SubElement(root, "link", name=child), pin.SE3.Identity(), _SLIGHT, _SLIGHT_INERTIA)
            link, place = child, pin.SE3(np.eye(3), np.array(moved.anchor)).inverse()
        if not joints and name != base:
            _add_joint(root, f"{name}_fixed", "fixed", link, name, place)
            place = pin.SE3.Identity()
        placed[name] = name, place
        _add_link(root, name, body, place, drawn)
    for name, end in tree.fingertips.items():
        (link, place), last = placed[end.body], f"{name}_{TIP}" if name else TIP
        if end.body is not None and end.body.split(".")[-1] == TIP and not any(end.position):
            continue  # Of a finger of links it is a body.
        while last in tree.bodies:
            last += "_"
        _add_joint(root, f"{last}_fixed", "fixed", link, last, place * pin.SE3(np.eye(3), np.array(end.position)))
        _add_massless_link(root, last)
    if drawn:
        ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def effort_limit(description: FingerDescription, joint: str) -> float:
    """Return the torque on a joint, N m, when the tendons on its stronger side all carry `TENSION_LIMIT`.

    On a joint about which no tendon winds it is as many N m, or N.
    """
    crossings = [tendon.crossings.get(joint) for tendon in description.tendons.values()]
    radii = [crossing.radius for crossing in crossings if crossing]
    return TENSION_LIMIT * (max(sum(r for r in radii if r > 0.0), -sum(r for r in radii if r < 0.0)) or 1.0)


def _notes(description: FingerDescription) -> str:
    """Return the comment that says what of a tree is left out."""
    asymmetry = "by how much the drag of joints differs by direction (drag_asymmetry): friction is the mean"
    is_asymmetric = bool(np.any(description.joint_friction.drag_asymmetry))
    left_out = (*description.tree.left_out, *[asymmetry] * is_asymmetric)
    rest = "".join(f"\n  - {line}" for line in left_out)
    kinds = ", ".join(f"{name}s" for name, kind in KINDS.items() if not kind.in_urdf)
    title = description.title or description.name
    return _NOTES.format(title=title, kinds=kinds, rest=rest).replace("--", "- -")


def _kind(description: FingerDescription, joint: str, moved: TreeJoint) -> str:
    if moved.kind == "slide":
        return "prismatic"
    # Continuous joints have two coordinates in Pinocchio, which reads fingers of links from here.
    return "revolute" if description.joints[joint].limited or joint in description.links else "continuous"


def _complete(
    joint: ET.Element, description: FingerDescription, name: str, moved: TreeJoint, course: Coupling | None
) -> None:
    """Add limits, damping and friction of a joint, and the joint that it follows."""
    place, spring = list(description.joints).index(name), description.joints[name].spring
    friction = description.numbers["joint_friction"]
    lower, upper = description.joints[name].range
    ends = {} if joint.get("type") == "continuous" else {"lower": _numbers(lower), "upper": _numbers(upper)}
    ET.SubElement(
        joint,
        "limit",
        ends | {"effort": _numbers(effort_limit(description, name)), "velocity": _numbers(VELOCITY_LIMIT)},
    )
    damping = float(friction["viscous"][place]) * moved.bearing + (spring.damping if spring else 0.0)
    loss = max(float(friction[entry][place]) for entry in ("floor", "drag")) * moved.bearing
    ET.SubElement(joint, "dynamics", damping=_numbers(damping), friction=_numbers(loss))
    if course is not None and course.other is not None:
        followed = {"joint": course.other, "multiplier": _numbers(course.slope), "offset": _numbers(course.offset)}
        ET.SubElement(joint, "mimic", followed)


def _add_joint(root: ET.Element, name: str, kind: str, parent: str, child: str, place: pin.SE3) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    _add_origin(joint, place)
    return joint


def _add_origin(element: ET.Element, place: pin.SE3) -> None:
    ET.SubElement(
        element, "origin", xyz=_numbers(*place.translation), rpy=_numbers(*pin.rpy.matrixToRpy(place.rotation))
    )


def _add_massless_link(root: ET.Element, name: str) -> None:
    add_inertial(ET.SubElement(root, "link", name=name), pin.SE3.Identity(), 0.0)


def _add_link(root: ET.Element, name: str, body: Body, place: pin.SE3, drawn: bool) -> None:
    """Add a link whose frame is that of its body's last joint, in which the body has a place."""
    link = ET.SubElement(root, "link", name=name)
    add_inertial(link, place * pin.SE3(np.eye(3), np.array(body.centre)), body.mass, body.inertia)
    for role, solids in (("visual", body.solids), ("collision", body.shapes)) if drawn else ():
        for solid in solids.values():
            where = pin.SE3(rotation(solid.orientation), np.array(solid.position))
            for shape, height in solid.parts if solid.in_urdf else ():
                element = ET.SubElement(link, role)
                _add_origin(element, place * (where * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))))
                geometry = ET.SubElement(element, "geometry")
                if isinstance(solid, TreeSolid):
                    ET.SubElement(element, "material", name=solid.material)
                ET.SubElement(geometry, *_ELEMENTS[shape.kind](shape.scale))


def add_inertial(link: ET.Element, place: pin.SE3, mass: float, inertia: Sequence[float] = (0.0,) * 6) -> None:
    """Add what a link weighs, also nothing: of links that do not say, MuJoCo weighs the shapes, and Bullet takes 1 kg.

    Args:
        link: Its element.
        place: Of the mass centre, and the axes of the moments, in its frame.
        mass: In kg.
        inertia: Moments about the mass centre, xx, yy, zz, xy, xz, yz, kg m2.
    """
    inertial = ET.SubElement(link, "inertial")
    _add_origin(inertial, place)
    ET.SubElement(inertial, "mass", value=_numbers(mass))
    moments = dict(zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), map(_numbers, inertia), strict=True))
    ET.SubElement(inertial, "inertia", moments)
