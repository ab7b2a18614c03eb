"""Bodies as contacts see them: links, objects, and shapes of a tree's bodies."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.objects import Object, inertia_matrix
from finger_pin.description.placement import Palm
from finger_pin.description.primitives import KINDS
from finger_pin.description.surface import Surface
from finger_pin.description.tree import Tree
from finger_pin.exceptions import InputError
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.typing import Array

# Mass and moments of joints of the world, which carry nothing yet, kg and kg m2.
_LEAST_MASS = 1e-9
#: Joints of the world that a palm sees: less than its roll, pitch, yaw, x, y and z, one carrying the next.
WORLD = tuple(f"world {name}" for name in ("roll", "pitch", "yaw", "x", "y", "z"))
_WORLD_JOINTS = (
    pin.JointModelRX,
    pin.JointModelRY,
    pin.JointModelRZ,
    pin.JointModelPX,
    pin.JointModelPY,
    pin.JointModelPZ,
)


@dataclass(frozen=True, eq=False)
class Solid:
    """A body as contacts see it.

    Attributes:
        name: Of the link or the object.
        group: Solids of one group never touch, such as the links of a finger.
        joint: Index of the joint of the Pinocchio model that carries it, 0 for the base.
        place: Of its shape in the frame of that joint.
        shape: A key of `KINDS`.
        sizes: Of that kind, m.
        home: Centre of a ball, base frame, shape (3,), m, that it never leaves.
        range: Radius of that ball, m; infinite for what is free.
        joined: Whether it is a capsule whose near end lies in another one, which stands for it on a plane.
        prescribed: Whether nothing moves it but a path, if that: it is fixed, or moved.
        surface: Its surface; None for links and where it is left out, which touch with that of what they touch.
    """

    name: str
    group: str
    joint: int
    place: pin.SE3
    shape: str
    sizes: tuple[float, ...]
    home: Array = field(default_factory=lambda: np.zeros(3))
    range: float = np.inf
    joined: bool = False
    prescribed: bool = False
    surface: Surface | None = None

    @property
    def reach(self) -> float:
        """Largest distance of a point from the origin of its shape, m; infinite for a half-space."""
        return KINDS[self.shape].reach(self.sizes)

    def never_meets(self, other: Solid) -> bool:
        """Return whether no motion can bring the solid to another one."""
        for one, two in ((self, other), (other, self)):
            if two.shape == "half_space":
                # One that is moved may come from anywhere.
                away = two.place.rotation[:, 2] @ (one.home - two.place.translation)
                return two.joint == 0 and bool(away > one.range)
        return float(np.linalg.norm(self.home - other.home)) > self.range + other.range

    def kept_near(self, body: RigidBody) -> Solid:
        """Return the solid with the ball, about its first joint, that it never leaves while hinges turn."""
        if not self.joint:
            return replace(self, home=np.array(self.place.translation), range=self.reach, prescribed=True)
        first, *others = [each for each in body.model.supports[self.joint] if each]
        radius = float(np.linalg.norm(self.place.translation)) + self.reach
        radius += sum(float(np.linalg.norm(body.model.jointPlacements[each].translation)) for each in others)
        slides = any(body.slides[each - 1] for each in (first, *others))
        home = np.array(body.model.jointPlacements[first].translation)
        return replace(self, home=home, range=np.inf if slides else radius)


def body_solids(tree: Tree, placed: Mapping[str | None, Placed], body: RigidBody) -> list[Solid]:
    """Return the shapes of bodies, those of a finger as one group; ``placed`` has the bodies' places."""
    solids = []
    for name, part in tree.bodies.items():
        for key, shape in part.shapes.items():
            place = placed[name].frame * pin.SE3(rotation(shape.orientation), np.array(shape.position))
            group = f"{name.rpartition('.')[0]}."
            solid = Solid(key, group, placed[name].joint, place, shape.shape, shape.sizes, joined=shape.continues)
            solid = replace(solid, surface=shape.surface).kept_near(body)
            led = all(body.model.names[k] in tree.on_paths for k in body.model.supports[solid.joint] if k)
            solids.append(replace(solid, prescribed=led))
    return solids


def pairs_within(description: FingerDescription) -> set[frozenset[str]]:
    """Return the names of links, or of shapes, of one finger that touch each other: no neighbours among links."""
    hand = description.hand
    fingers = {"": description} if hand is None else {f"{key}.": each.finger for key, each in hand.fingers.items()}
    pairs: set[frozenset[str]] = set()
    for prefix, finger in fingers.items():
        if finger.touches_itself:
            names = [prefix + name for name in finger.links]
            pairs |= {frozenset((names[i], names[k])) for k in range(len(names)) for i in range(k - 1)}
            pairs |= {frozenset(prefix + name for name in pair) for pair in finger.tree.touching}
    return pairs


def pairs_apart(objects: Mapping[str, Object], names: Collection[str]) -> set[frozenset[str]]:
    """Return the names of objects, with those of links, shapes or other objects that they never touch."""
    for name, obj in objects.items():
        for other in obj.apart:
            if other not in names or other == name:
                allowed = f"no such link, shape or other object; there are {', '.join(k for k in names if k != name)}"
                raise InputError(f"environment.objects.{name}.apart", allowed, other)
    return {frozenset((name, other)) for name, obj in objects.items() for other in obj.apart}


def object_solids(objects: Mapping[str, Object], body: RigidBody) -> list[Solid]:
    """Return objects; those that move are carried by the joints that `add_free_objects` has made."""
    solids = []
    for name, obj in objects.items():
        joint = WORLD[-1] if obj.frame == "world" else f"{name}_attitude"
        solids.append(
            object_solid(name, obj, int(body.model.getJointId(joint)) if body.model.existJointName(joint) else 0)
        )
    return solids


def object_solid(name: str, described: Object, joint: int) -> Solid:
    """Return the solid of an object, in the frame of its joint if it moves, at its place if it is fixed."""
    place = pin.SE3.Identity()
    if not joint or described.frame == "world":
        place = pin.SE3(pin.Quaternion(described.quaternion).matrix(), np.array(described.position))
    solid = Solid(
        name,
        name,
        joint,
        place,
        described.shape,
        described.sizes,
        np.array(place.translation),
        prescribed=described.mass is None,
        surface=described.surface,
    )
    return solid if joint else replace(solid, range=solid.reach)


def add_free_objects(body: RigidBody, objects: Mapping[str, Object], palm: Palm | None = None) -> RigidBody:
    """Return a rigid body with those of some objects that are free or moved as further bodies, after its joints.

    Each is a translation joint with the name of the object, at the origin of the base, and a spherical one, whose name
    ends in ``_attitude``, that carries it.

    What stands in the world while a ``palm`` moves is carried by the joints of `WORLD`, which come last: the world as
    the palm sees it, R^T (w - p) with R^T = Rx(-roll) Ry(-pitch) Rz(-yaw), of a palm at p and R.
    """
    moved = tuple(name for name, each in objects.items() if each.moves)
    world: tuple[float, ...] = ()
    if palm is not None and any(each.frame == "world" for each in objects.values()):
        world = tuple(palm.on_path(name.split()[1]).greatest for name in WORLD)
    return _with_masses(_extended(body, moved, world), body, [objects[name] for name in moved])


def _with_masses(extended: RigidBody, body: RigidBody, moved: Sequence[Object]) -> RigidBody:
    """Return an extended body with the inertias of the body itself, and those of objects that move."""
    # Any inertia that is too little to count will do for what moves on a path.
    slight, none = pin.Inertia(_LEAST_MASS, np.zeros(3), _LEAST_MASS * np.eye(3)), pin.Inertia.Zero()
    inertias = body.inertias
    for obj in moved:
        inertias += [none, slight if obj.mass is None else _inertia(obj)]
    # Of the joints of the world the last one carries all.
    missing = extended.model.njoints - 1 - len(inertias)
    inertias += [*[none] * (missing - 1), slight][-missing:] if missing else []
    return extended.with_inertias(inertias, body.model.gravity.linear)


@memoised(lambda body, moved, world: (body.topology, *moved, world))
def _extended(body: RigidBody, moved: Sequence[str], world: Sequence[float]) -> RigidBody:
    """Return a rigid body with further joints for moving objects and for the world seen by a palm."""
    model, place = pin.Model(body.model), pin.SE3.Identity()
    for name in moved:
        slid = model.addJoint(0, pin.JointModelTranslation(), place, name)
        model.addJoint(slid, pin.JointModelSpherical(), place, f"{name}_attitude")
    carried = 0
    for name, kind, greatest in zip(WORLD, _WORLD_JOINTS, world, strict=False):
        most = np.full(1, greatest)
        carried = model.addJoint(carried, kind(), place, name, np.full(1, np.inf), np.full(1, np.inf), -most, most)
    extended = RigidBody(model, [model.frames[tip].name for tip in body.tips])
    count = body.model.njoints
    extended.proximal_axes[:count], extended.parent_links[:count] = body.proximal_axes, body.parent_links
    return extended


def _inertia(free: Object) -> pin.Inertia:
    return pin.Inertia(free.mass or 0.0, np.array(free.centre), inertia_matrix(free.moments))
