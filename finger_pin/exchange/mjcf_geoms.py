"""Geoms of a tree of bodies as MJCF: solids that are drawn, shapes and objects that touch, and which pairs do."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.primitives import KINDS
from finger_pin.description.surface import Shaped, Surface
from finger_pin.description.tree import Tree
from finger_pin.description.tree_parts import MATERIALS, Body
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf_compliance import Mobility, impact_ratio, quaternion, soft
from finger_pin.exchange.mujoco_sizes import mujoco_sizes
from finger_pin.mechanism.contact_rows import law_parameters
from finger_pin.mechanism.solids import pairs_apart
from finger_pin.mechanism.xml_numbers import numbers

#: Attributes of geoms that touch nothing, and the group that MuJoCo's viewer hides.
IDLE, HIDDEN = {"contype": "0", "conaffinity": "0"}, "4"
# Attributes of geoms that touch objects of MuJoCo's default type, and not each other.
_CONTACT = {"contype": "0", "conaffinity": "1"}
# Half sides and spacing of the grid with which MuJoCo draws a plane, m.
_DRAWN_PLANE = (1.0, 1.0, 0.1)


def add_assets(root: ET.Element, tree: Tree) -> None:
    """Add the materials and meshes of solids."""
    assets = ET.SubElement(root, "asset")
    used = {solid.material for body in tree.bodies.values() for solid in body.solids.values()}
    for material, colour in MATERIALS.items():
        if material in used:
            ET.SubElement(assets, "material", name=material, rgba=numbers(*colour))
    for name, mesh in tree.meshes.items():
        points, faces = mesh.unpacked()
        corners = {"vertex": numbers(*points.ravel()), "face": " ".join(map(str, faces.ravel().tolist()))}
        ET.SubElement(assets, "mesh", {"name": name, "inertia": "shell", **corners})


def add_body_geoms(element: ET.Element, body: Body) -> None:
    """Add the solids and shapes of a body; those of one name are one geom."""
    for key, solid in body.solids.items():
        drawn = IDLE | {"material": solid.material}
        if key not in body.shapes and solid.kind == "mesh":
            pose = {"pos": numbers(*solid.position), "quat": quaternion(solid.orientation)}
            mesh_attributes = {"name": key, "type": "mesh", "mesh": str(solid.mesh), "mass": "0"}
            ET.SubElement(element, "geom", mesh_attributes | pose | drawn)
        elif key not in body.shapes:
            add_geom(element, key, solid.kind, solid.sizes, solid.position, solid.orientation, drawn)
    for key, shape in body.shapes.items():
        contact = _CONTACT | _friction(shape.surface) | ({} if key in body.solids else {"group": HIDDEN})
        add_geom(element, key, shape.shape, shape.sizes, shape.position, shape.orientation, contact)


def add_geom(
    element: ET.Element,
    name: str,
    kind: str,
    sizes: Sequence[float],
    position: Sequence[float],
    orientation: Sequence[float],
    attributes: Mapping[str, str],
) -> None:
    """Add a geom of a kind of this package, with its sizes, m, and its place in a body."""
    geom = KINDS[kind].geom
    if geom is None:
        raise InputError(name, f"is not written: MuJoCo has no {kind}; make it a mesh, or leave it out")
    shape = {"type": geom, "size": numbers(*mujoco_sizes(kind, sizes) or _DRAWN_PLANE)}
    pose = {"pos": numbers(*position), "quat": quaternion(orientation)}
    ET.SubElement(element, "geom", {"name": name, "mass": "0", **shape, **pose, **attributes})


def add_objects(world: ET.Element, tree: Tree) -> dict[str, str]:
    """Add objects, free bodies and geoms that stand; return the names of their geoms."""
    geoms = {}
    for name, item in tree.objects.items():
        if item.path:
            raise InputError(f"finger.tree.objects.{name}.path", "is not written: MuJoCo moves no body along a path")
        contact = _CONTACT | _friction(item.surface)
        geoms[name] = name
        if item.mass is None:
            add_geom(world, name, item.shape, item.sizes, item.position, item.orientation, contact)
            continue
        pose = {"pos": numbers(*item.position), "quat": quaternion(item.orientation)}
        body = ET.SubElement(world, "body", {"name": name, **pose})
        # A freejoint has no attributes.
        ET.SubElement(
            body, *(("joint", {"type": "free", "damping": numbers(item.damping)}) if item.damping else ("freejoint",))
        )
        inertia = {"pos": numbers(*item.centre), "mass": numbers(item.mass), "fullinertia": numbers(*item.moments)}
        ET.SubElement(body, "inertial", inertia)
        geoms[name] = f"{name}_geom"
        add_geom(body, geoms[name], item.shape, item.sizes, (0.0,) * 3, (0.0, 0.0, 0.0, 1.0), contact)
    return geoms


def add_pairs(
    contact: ET.Element, description: FingerDescription, geoms: Mapping[str, str], mobility: Mobility
) -> None:
    """Add the pairs that touch, with the friction, stiffness and damping of both surfaces."""
    tree, owner = description.tree, {key: name for name, body in description.tree.bodies.items() for key in body.shapes}
    solids: dict[str, Shaped] = {key: tree.bodies[name].shapes[key] for key, name in owner.items()} | dict(tree.objects)
    apart = pairs_apart(tree.objects, [*solids, *tree.bodies])
    pairs = [*tree.touching] if description.touches_itself else []
    for k, (name, item) in enumerate(tree.objects.items()):
        earlier = [other for other in [*tree.objects][:k] if item.moves or tree.objects[other].moves]
        pairs += [(other, name) for other in (*owner, *earlier) if frozenset((name, other)) not in apart]
    for pair in pairs:
        law = law_parameters(*(solids[item].surface for item in pair))
        mu, torsion = law["kinetic"], law["torsion_radius"] * law["kinetic"]
        friction = _rubbing(mu, torsion, numbers(mu, mu, torsion or 0.005, 1e-4, 1e-4))
        pair_mobility = sum(mobility.bodies[owner.get(item, item)] for item in pair)
        # A spring of Hertz's exponent has no stiffness of its own.
        is_linear, ratio = law["exponent"] == 1.0, impact_ratio(law["damping"])
        softness = soft(law["stiffness"], ratio, pair_mobility, is_ratio=True) if is_linear else {}
        geom_names = {f"geom{k}": geoms.get(item, item) for k, item in enumerate(pair, 1)}
        ET.SubElement(contact, "pair", geom_names | friction | softness)


#: What of a surface is not written.
CONTACTS_LEFT_OUT = (
    "stiction and bristles of contacts: stiction_ratio, tangential_stiffness, lag, stribeck_velocity, floor",
    "stiffness and damping of contacts whose exponent is not 1, which are MuJoCo's own",
)


def _friction(surface: Surface | None) -> dict[str, str]:
    surface = surface or Surface()
    return _rubbing(surface.friction, surface.torsion, numbers(surface.friction, surface.torsion or 0.005, 1e-4))


def _rubbing(mu: float, torsion: float, friction: str) -> dict[str, str]:
    """Return friction with the dimension of contacts in which MuJoCo heeds what there is of it."""
    return {"condim": "4" if torsion else "3", "friction": friction} if mu else {"condim": "1"}
