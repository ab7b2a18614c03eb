"""URDF of a tree of bodies: links, joints and shapes; tendons and what drives and holds joints have no place in it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.surface import BodyShape
from finger_pin.description.tree_parts import Body, Coupling, TreeJoint, TreeSolid
from finger_pin.mechanism.tendon_paths import joint_placement, rotation
from finger_pin.mechanism.xml_numbers import numbers as _numbers

# The geometry of a solid in a body's frame: its kind, sizes, m, place and attitude.
_Geometry = tuple[str, Sequence[float], pin.SE3]
_SIZES = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length")}
# Mass and moments of the links between several joints of a body, kg and kg m2: MuJoCo refuses moving ones without.
_SLIGHT = 1e-14
_SLIGHT_INERTIA = (_SLIGHT,) * 3 + (0.0,) * 3
_NOTES = """
  {title}

  Written from a tree of bodies. A body with several joints has a link for each, of which the last has its mass
  and the others 1e-14 kg.
  Left out, because a URDF has no place for it: tendons, actuators, loops, springs, the inertia of rotors;
  couplings by more than a ratio and an offset, meshes, ellipsoids, objects.{rest}
"""


def tree_to_urdf(description: FingerDescription, drawn: bool, base: str, tip: str, effort: float, speed: float) -> str:
    """Return the URDF of a finger that has a tree of bodies, as text.

    Args:
        description: The finger.
        drawn: With shapes.
        base: Name of the base's link.
        tip: Name of the fingertip's link; of several with their names and _ before it.
        effort: Effort limit of every joint, N m or N, for readers that want one.
        speed: Velocity limit, likewise.
    """
    tree = description.tree
    root = ET.Element("robot", name=description.name)
    asymmetry = "by how much the drag of joints differs by direction (drag_asymmetry): friction is the mean"
    left_out = (*tree.left_out, *[asymmetry] * bool(np.any(description.joint_friction.drag_asymmetry)))
    rest = "".join(f"\n  - {line}" for line in left_out)
    notes = _NOTES.format(title=description.title or description.name, rest=rest)
    root.append(ET.Comment(notes.replace("--", "- -")))
    _add_massless_link(root, base)
    placed: dict[str | None, tuple[str, pin.SE3]] = {None: (base, pin.SE3.Identity())}
    courses = {each.joint: each for each in tree.couplings.values() if each.other and not any(each.higher)}
    for name, body in tree.bodies.items():
        link, place = placed[body.parent]
        place = place * pin.SE3(rotation(body.orientation), np.array(body.position))
        joints = [key for key, joint in tree.joints.items() if joint.body == name]
        for key in joints:
            moved, child = tree.joints[key], name if key == joints[-1] else f"{name}_{key}"
            joint = _add_joint(root, key, _kind(description, key), link, child, joint_placement(place, moved))
            ET.SubElement(joint, "axis", xyz=_numbers(*moved.axis))
            _complete(joint, description, key, moved, courses.get(key), (effort, speed))
            if child != name:
                add_inertial(ET.SubElement(root, "link", name=child), pin.SE3.Identity(), _SLIGHT, _SLIGHT_INERTIA)
            link, place = child, pin.SE3(np.eye(3), np.array(moved.anchor)).inverse()
        if not joints:
            _add_joint(root, f"{name}_fixed", "fixed", link, name, place)
            place = pin.SE3.Identity()
        placed[name] = name, place
        _add_link(root, name, body, place, drawn)
    for name, end in tree.fingertips.items():
        (link, place), last = placed[end.body], f"{name}_{tip}" if name else tip
        while last in tree.bodies:
            last += "_"
        _add_joint(root, f"{last}_fixed", "fixed", link, last, place * pin.SE3(np.eye(3), np.array(end.position)))
        _add_massless_link(root, last)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _kind(description: FingerDescription, joint: str) -> str:
    if description.tree.joints[joint].kind == "slide":
        return "prismatic"
    return "revolute" if description.joints[joint].limited else "continuous"


def _complete(
    joint: ET.Element,
    description: FingerDescription,
    name: str,
    moved: TreeJoint,
    course: Coupling | None,
    limits: tuple[float, float],
) -> None:
    """Add limits, damping and friction of a joint, and the joint that it follows."""
    place, spring = list(description.joints).index(name), description.joints[name].spring
    friction = description.numbers["joint_friction"]
    lower, upper = description.joints[name].range
    ends = {} if joint.get("type") == "continuous" else {"lower": _numbers(lower), "upper": _numbers(upper)}
    ET.SubElement(joint, "limit", ends | {"effort": _numbers(limits[0]), "velocity": _numbers(limits[1])})
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
            for kind, sizes, where in _geometries(solid):
                element = ET.SubElement(link, role)
                _add_origin(element, place * where)
                geometry = ET.SubElement(element, "geometry")
                values = [_numbers(*sizes)] if kind == "box" else map(_numbers, sizes)
                ET.SubElement(geometry, kind, dict(zip(_SIZES[kind], values, strict=True)))


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


def _geometries(solid: TreeSolid | BodyShape) -> Iterator[_Geometry]:
    """Yield the geometry of a solid; a capsule is a cylinder and two spheres."""
    place = pin.SE3(rotation(solid.orientation), np.array(solid.position))
    kind = solid.kind if isinstance(solid, TreeSolid) else solid.shape
    radius, length = float(solid.radius or 0.0), float(solid.length or 0.0)
    if kind == "box":
        yield "box", solid.sides or (0.0,) * 3, place
    elif kind == "sphere":
        yield "sphere", (radius,), place
    elif kind in ("cylinder", "capsule"):
        yield "cylinder", (radius, length), place
    for end in (-0.5, 0.5) if kind == "capsule" else ():
        yield "sphere", (radius,), place * pin.SE3(np.eye(3), np.array([0.0, 0.0, end * length]))
