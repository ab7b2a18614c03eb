"""What may touch what: shapes of links and objects, and the table of contacts between them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.objects import Object, Surface
from finger_pin.description.parameters import Link
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.laws.contact import CONTACT
from finger_pin.mechanism.gaps import PRISM, prism_parameters
from finger_pin.mechanism.pieces import Leg, Piece, Place, reach
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows

#: Points around each rim of a cylinder that stands or rolls on something flat.
_RIM = 8
#: How deep bodies may be in each other at the start, m.
DEEPEST_START = 1e-3


@dataclass(frozen=True, eq=False)
class Solid:
    """A body as contacts see it.

    Attributes:
        name: Of the link or the object.
        group: Solids of one group never touch, such as the links of a finger.
        joint: Index of the joint of the Pinocchio model that carries it, 0 for the base.
        position: Of its shape in the frame of that joint, shape (3,), m.
        rotation: Likewise, shape (3, 3).
        shape: Its shape as rounded prism, from `prism_parameters`.
        reach: No point is farther from ``position``, m; infinite for a half-space.
        segment: Ends of the segment of a capsule or sphere in the frame of the joint, shape (2, 3), m; None for others.
        radius: Of the segment, m.
        points: Where it touches what is flat: spheres in the frame of the joint, shape (m, 3), m.
        rounding: Their radius, m.
        home: Centre of a ball, base frame, shape (3,), m, that it never leaves.
        range: Radius of that ball, m; infinite for what is free.
        led: Whether nothing moves it but a path, if that: it is fixed, or moved.
        surface: Its surface; None for links and where it is left out, which touch with that of what they touch.
    """

    name: str
    group: str
    joint: int
    position: Array
    rotation: Array
    shape: tuple[float, ...]
    reach: float
    segment: Array | None
    radius: float
    points: Array
    rounding: float
    home: Array
    range: float
    led: bool = False
    surface: Surface | None = None

    def never_meets(self, other: Solid) -> bool:
        """Return whether it stays away from another solid, whatever both do."""
        for one, two in ((self, other), (other, self)):
            if np.isinf(two.reach):
                # One that is moved may come from anywhere.
                return two.joint == 0 and bool(two.rotation[:, 2] @ (one.home - two.position) > one.range)
        return float(np.linalg.norm(self.home - other.home)) > self.range + other.range


def contact_rows(solids: Sequence[Solid], width: int) -> Rows:
    """Return the contacts of all pairs that can touch: not of one group, not both fixed, and within reach.

    Args:
        solids: Links and objects.
        width: Number of coordinates.

    Returns:
        A table of contacts named ``link-object``, numbered where a pair has several.
    """
    names: list[str] = []
    numbers: list[tuple[float, ...]] = []
    paths: list[tuple[Leg, ...]] = []
    for one, other in itertools.combinations(solids, 2):
        if one.group == other.group or (one.led and other.led) or one.never_meets(other):
            continue
        found = list(_touching(one, other))
        for index, (a, w, ends, radius) in enumerate(found):
            half = 0.5 * float(np.linalg.norm(ends[1] - ends[0]))
            piece = Piece(
                PRISM,
                np.array([radius, *w.shape]),
                (Place(a.joint, ends[0]), Place(a.joint, ends[1])),
                w.joint,
                pin.SE3(w.rotation, w.position),
                half + radius + w.reach,
            )
            names.append(f"{a.name}-{w.name}" + (f".{index}" if len(found) > 1 else ""))
            numbers.append(law_numbers(a.surface, w.surface))
            paths += [(Leg(piece, column),) for column in range(CONTACT.arms)]
    parameters = np.array(numbers).reshape(-1, len(CONTACT.parameters)).T
    return Rows("contacts", CONTACT, tuple(names), parameters, np.zeros((len(paths), width)), paths=tuple(paths))


def check_start(contacts: Rows, body: RigidBody, q: Array) -> None:
    """Refuse a configuration of shape (nq,) in which bodies are deep in each other.

    Raises:
        InputError: Naming the pair and how deep it is.
    """
    gaps = reach(body, q, contacts.paths, np.shape(contacts.arm)[1]).length[:: CONTACT.arms]
    if gaps.size and gaps.min() < -DEEPEST_START:
        allowed = f"starts {-1e3 * gaps.min():.3g} mm deep in each other, at most {1e3 * DEEPEST_START:g} mm"
        pair = contacts.names[int(np.argmin(gaps))]
        raise InputError(
            f"environment.objects: {pair}", f"{allowed}; move the object, or let the joints start elsewhere"
        )


def law_numbers(one: Surface | None, other: Surface | None) -> tuple[float, ...]:
    """Return the numbers of the law where two surfaces meet: of each the smaller; None leaves it to the other."""
    surfaces = [each for each in (one, other) if each is not None] or [Surface()]
    number = {name: min(getattr(each, name) for each in surfaces) for name in Surface.model_fields}
    kinetic = number["friction"]
    return (
        number["stiffness"],
        number["damping"],
        number["exponent"],
        kinetic * number["stiction_ratio"],
        kinetic,
        number["tangential_stiffness"],
        number["lag"],
        number["stribeck_velocity"],
        number["floor"],
    )


def _touching(one: Solid, other: Solid) -> Iterator[tuple[Solid, Solid, Array, float]]:
    """Yield the contacts of two solids: A, W, the ends of A's segment and its radius."""
    # A capsule lies on a plane with both ends, and meets any other shape where it is nearest.
    for a, w in ((one, other), (other, one)):
        if np.isinf(w.reach):
            yield from ((a, w, np.stack([point, point]), a.rounding) for point in a.points)
            return
    for a, w in ((one, other), (other, one)):
        if a.segment is not None:
            yield a, w, a.segment, a.radius
            return
    for a, w in ((one, other), (other, one)):
        if a.joint:
            yield from ((a, w, np.stack([point, point]), a.rounding) for point in a.points)


def link_solid(name: str, group: str, joint: int, link: Link, last: bool) -> Solid:
    """Return a link as a capsule as wide as it is, from its joint to the next; the last one ends in the pad.

    Args:
        name: Of its joint.
        group: Of the finger.
        joint: Index of its joint in the Pinocchio model.
        link: Its sizes.
        last: Whether it is the last link.
    """
    radius = 0.5 * link.width
    length = max(link.length - radius, 0.0) if last else link.length
    segment = np.array([[0.0, 0.0, link.offset], [length, 0.0, link.offset]])
    # Its own z axis along the link.
    rotation = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    shape, middle = prism_parameters("capsule", (radius, length)), segment.mean(axis=0)
    # On a plane, the near end is where the link before it ends.
    return Solid(
        name,
        group,
        joint,
        middle,
        rotation,
        shape,
        0.5 * length + radius,
        segment,
        radius,
        segment[1:],
        radius,
        np.zeros(3),
        np.inf,
    )


def finger_solids(links: Mapping[str, Link], body: RigidBody) -> list[Solid]:
    """Return the links of a finger or a hand, given by the names of their joints, from the base to each tip."""
    fingers = {name: name.rpartition(".")[0] for name in links}
    last = {finger: name for name, finger in fingers.items()}
    found = []
    for name, link in links.items():
        joint = int(body.model.getJointId(name))
        solid = link_solid(name, f"{fingers[name]}.", joint, link, name == last[fingers[name]])
        # Joints that turn keep all beyond them in a ball about the first.
        first, *others = [each for each in body.model.supports[joint] if each]
        radius = float(np.linalg.norm(solid.position)) + solid.reach
        radius += sum(float(np.linalg.norm(body.model.jointPlacements[each].translation)) for each in others)
        slides = any("JointModelP" in body.model.joints[each].shortname() for each in (first, *others))
        home = np.array(body.model.jointPlacements[first].translation)
        found.append(replace(solid, home=home, range=np.inf if slides else radius))
    return found


def object_solids(objects: Mapping[str, Object], body: RigidBody) -> list[Solid]:
    """Return objects; those that move are carried by the joints that `add_free_objects` has made."""
    return [
        object_solid(name, each, int(body.model.getJointId(f"{name}_attitude")) if each.moves else 0)
        for name, each in objects.items()
    ]


def object_solid(name: str, described: Object, joint: int) -> Solid:
    """Return an object; one that a joint carries has its frame, one that is fixed its own place."""
    place = pin.SE3.Identity() if joint else pin.SE3(pin.Quaternion(described.quaternion).matrix(), np.zeros(3))
    if not joint:
        place.translation = np.array(described.position)
    sizes, shape = described.sizes, described.shape
    rounding, segment, points = 0.0, None, np.zeros((0, 3))
    reach = {
        "half_space": lambda: np.inf,
        "sphere": lambda: sizes[0],
        "box": lambda: 0.5 * float(np.linalg.norm(sizes)),
        "cylinder": lambda: float(np.hypot(sizes[0], 0.5 * sizes[1])),
        "capsule": lambda: sizes[0] + 0.5 * sizes[1],
    }[shape]()
    if shape in ("sphere", "capsule"):
        half = 0.5 * sizes[1] if shape == "capsule" else 0.0
        segment, rounding = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), sizes[0]
        points = segment if half else segment[:1]
    elif shape == "box":
        points = 0.5 * np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * sizes
    elif shape == "cylinder":
        turn = 2.0 * np.pi * np.arange(_RIM) / _RIM
        rim = sizes[0] * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(_RIM)])
        up = np.array([0.0, 0.0, 0.5 * sizes[1]])
        points = np.concatenate([rim - up, rim + up])

    def placed(local: Array) -> Array:
        return np.asarray(local @ place.rotation.T + place.translation)

    return Solid(
        name,
        name,
        joint,
        np.array(place.translation),
        np.array(place.rotation),
        prism_parameters(shape, sizes),
        reach,
        None if segment is None else placed(segment),
        rounding,
        placed(points),
        rounding,
        np.array(place.translation),
        np.inf if joint else reach,
        described.mass is None,
        described.surface,
    )


def add_free_objects(body: RigidBody, objects: Mapping[str, Object]) -> RigidBody:
    """Return a rigid body with those of some objects that are free or moved as further bodies, after its joints.

    Each is a translation joint with the name of the object, at the origin of the base, and a spherical one, whose name
    ends in ``_attitude``, that carries it.
    """
    model = pin.Model(body.model)
    for name, each in objects.items():
        if each.moves:
            place = pin.SE3.Identity()
            moved = model.addJoint(0, pin.JointModelTranslation(), place, name)
            turned = model.addJoint(moved, pin.JointModelSpherical(), place, f"{name}_attitude")
            # Of one that is moved any will do.
            moments = np.ones(3) if each.mass is None else each.inertia
            model.inertias[turned] = pin.Inertia(each.mass or 1.0, np.zeros(3), np.diag(moments))
    extended = RigidBody(model, [model.frames[tip].name for tip in body.tips])
    count = body.model.njoints
    extended.proximal_axes[:count], extended.carriers[:count] = body.proximal_axes, body.carriers
    return extended
