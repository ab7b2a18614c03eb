"""Mechanisms that nobody would build: random trees, lumps and rows of all laws, wired at random; all of order one."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
from law_cases import every_law, random_parameters

from finger_pin.laws.contact_law import CONTACT, TORSIONAL_CONTACT
from finger_pin.laws.law import Law
from finger_pin.mechanism.gaps import ELLIPSOIDS, PRISM, prism_parameters
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.path_elements import PathElement, PathTerm, Place
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.spans import ANGLE, RISE, SPHERE, STRAIGHT
from finger_pin.mechanism.spans.span import SIDE_ON_OTHER_BODY

KINDS = (
    pin.JointModelRX,
    pin.JointModelRZ,
    pin.JointModelPY,
    lambda: pin.JointModelRevoluteUnaligned(np.array([0.48, -0.6, 0.64])),
    lambda: pin.JointModelPrismaticUnaligned(np.array([-0.6, 0.0, 0.8])),
)


def random_placement(rng):
    """A rotation of any size and a shift of about one."""
    return pin.SE3(pin.exp3(rng.normal(size=3)), 0.5 * rng.normal(size=3))


def random_inertia(rng):
    """That of an ellipsoid of about one, its mass centre beside the joint."""
    ellipsoid = pin.Inertia.FromEllipsoid(rng.uniform(1.0, 3.0), *rng.uniform(0.5, 1.5, 3))
    return random_placement(rng).act(ellipsoid)


def random_body(rng, free=False):
    """A tree of 1 to 8 joints in the order of a walk through it, with 1 to 3 tips; perhaps a free body in front."""
    model, walk = pin.Model(), [0]
    model.gravity.linear[:] = rng.normal(size=3)
    if free:
        for kind in (pin.JointModelTranslation(), pin.JointModelSpherical()):
            walk.append(model.addJoint(walk[-1], kind, random_placement(rng), f"free{len(walk)}"))
        model.appendBodyToJoint(walk[-1], random_inertia(rng), pin.SE3.Identity())
    for j in range(rng.integers(1, 9)):
        # A new branch leaves the way back to the base.
        walk = walk[: rng.integers(1, len(walk) + 1)] if rng.random() < 0.4 else walk
        walk.append(model.addJoint(walk[-1], KINDS[rng.integers(len(KINDS))](), random_placement(rng), f"joint{j}"))
        model.appendBodyToJoint(walk[-1], random_inertia(rng), pin.SE3.Identity())
    tips = [f"tip{t}" for t in range(rng.integers(1, 4))]
    for tip in tips:
        holder = int(rng.integers(0, model.njoints))
        model.addFrame(pin.Frame(tip, holder, 0, random_placement(rng), pin.FrameType.OP_FRAME))
    return RigidBody(model, tips)


def random_path(rng, joints):
    """Pieces one after the other, between points of any bodies; most begin where the last one ends.

    Some are polynomials of a coordinate, some wraps have their side point on another body, and some turns do not count.
    """
    legs, last = [], None
    # Drawn apart, so that the rest of a mechanism is the same without them.
    more = np.random.default_rng(joints)
    if more.random() < 0.4:
        shape, ends = (ANGLE, RISE)[int(more.integers(0, 2))], more.integers(0, joints + 1, 3)
        points = Place(int(ends[0]), more.normal(size=3)), Place(int(ends[1]), more.normal(size=3))
        numbers = np.append(more.normal(size=3), np.zeros(len(shape.parameters) - 3))
        legs.append(
            PathTerm(PathElement(shape, numbers, points, int(ends[2]), random_placement(more)), arm=more.normal())
        )
    for _ in range(rng.integers(1, 4)):
        follows = last is not None and rng.random() < 0.7
        first = last if follows else Place(int(rng.integers(0, joints + 1)), rng.normal(size=3))
        last = Place(int(rng.integers(0, joints + 1)), rng.normal(size=3))
        shape, numbers = (STRAIGHT, ()) if rng.random() < 0.6 else (SPHERE, (0.3, 0.0, 0.0, 0.0, 0.0, 0.0))
        side = ()
        if shape is SPHERE and more.random() < 0.5:
            numbers = (0.3, 0.0, 0.0, 0.0, SIDE_ON_OTHER_BODY, 0.0)
            side = (Place(int(more.integers(0, joints + 1)), 2.0 * more.normal(size=3)),)
        frame = int(rng.integers(0, joints + 1))
        piece = PathElement(shape, np.array(numbers), (first, last, *side), frame, random_placement(rng))
        bends = bool(more.random() < 0.8)
        legs.append(PathTerm(piece, arm=rng.normal(), follows=follows, bends=bends))
    return tuple(legs)


def random_contacts(rng, joints, width):
    """Contacts of capsules and ellipsoids with bodies so large that most are inside; they slide or stick, or spin too.

    Three or four of capsules with balls, one of an ellipsoid with a capsule, and one of two ellipsoids.
    """
    law = TORSIONAL_CONTACT if joints % 2 else CONTACT
    count = int(rng.integers(3, 5))
    paths = []
    for _ in range(count):
        holder, frame = int(rng.integers(0, joints + 1)), int(rng.integers(0, joints + 1))
        ends = Place(holder, rng.normal(size=3)), Place(holder, rng.normal(size=3))
        numbers = np.array([0.3, 0.0, 1.0, 0.0, *prism_parameters("sphere", [rng.uniform(2.0, 6.0)])])
        piece = PathElement(PRISM, numbers, ends, frame, random_placement(rng))
        paths += [(PathTerm(piece, column),) for column in range(law.arms)]
    for shape in (PRISM, ELLIPSOIDS):
        holder, frame, centre = int(rng.integers(0, joints + 1)), int(rng.integers(0, joints + 1)), rng.normal(size=3)
        axes = np.diag(rng.uniform(0.2, 0.5, 3)) @ random_placement(rng).rotation
        ends = tuple(Place(holder, point) for point in (centre, centre + axes[0], centre + axes[1]))
        sizes, third = rng.uniform(2.0, 6.0, 3), float(np.linalg.norm(axes[2]))
        numbers = [third, *sizes]
        if shape is PRISM:
            numbers = [0.0, 0.0, 0.0, third, *prism_parameters("capsule", sizes[:2])]
        piece = PathElement(shape, np.array(numbers), ends, frame, random_placement(rng))
        paths += [(PathTerm(piece, column),) for column in range(law.arms)]
    count += 2
    # Stiffness, damping, exponent; static and kinetic friction; stiffness and lag of bristles, Stribeck speed, floor;
    # radius of torsion.
    least = [1.0, 0.0, 1.0, 0.8, 0.3, 1.0, 0.1, 0.5, 0.1, 0.2]
    most = [2.0, 0.1, 1.5, 1.0, 0.7, 3.0, 1.0, 2.0, 0.2, 1.0]
    parameters = rng.uniform(least, most, (count, len(least))).T
    names = tuple(f"contact{k}" for k in range(count))
    return Rows("contacts", law, names, parameters, np.zeros((law.arms * count, width)), paths=paths)


def _read(row, p):
    force = -p[0] * row.length - (1.0 + row.reading) * row.state
    return force, row.speed - p[1] * row.state + row.reading * row.reading + 0.3 * row.command


def _read_slopes(row, p, signals):
    of_force = (-p[0], 0.0, -1.0 - row.reading, 0.0, 0.0, 0.0, 0.0, -row.state)
    return of_force, (0.0, 1.0, -p[1], 0.0, 0.3, 0.0, 2.0 * row.reading)


#: A row whose force and state depend on the states of others.
READER = Law(
    "reader", ("stiffness", "decay"), _read, _read_slopes, lambda row, p, force, *_: (0.0 * force,),
    scale=1.0, reads_states=True,
)  # fmt: skip


def random_readers(tables, width):
    """Two tables that read states of all, each other's and their own too; the first is fed by the second."""
    rng = np.random.default_rng(len(tables) + width)
    counts = {table.group: table.count for table in tables if table.states == table.count} | {"one": 2, "other": 1}

    def weights(count, others):
        return 0.3 * rng.normal(size=(count, others)) * (rng.random((count, others)) < 0.6)

    def reader(name, fed_by):
        count = counts[name]
        return Rows(
            group=name,
            law=READER,
            names=tuple(f"row{k}" for k in range(count)),
            parameters=random_parameters(READER, rng, count),
            arm=weights(count, width),
            inputs={fed_by.group: weights(count, fed_by.count)},
            readings={group: weights(count, size) for group, size in counts.items()},
        )

    other = reader("other", tables[-1])
    return [reader("one", other), other]


def random_mechanism(rng, free=False):
    """Tables of rows of all laws in any order, each fed and pressed by some others; those that read states first."""
    body = random_body(rng, free)
    lumps = tuple(f"lump{i}" for i in range(rng.integers(0, 3)))
    width, joints = body.model.nv + len(lumps), body.model.njoints - 1

    def weights(count, others):
        return np.where(rng.random((count, others)) < 0.6, rng.normal(size=(count, others)), 0.0)

    tables, channels = [], int(rng.integers(1, 4))
    if rng.random() < 0.5:
        tables.append(random_contacts(rng, joints, width))
    laws = list(every_law().values())
    for index in rng.permutation(len(laws)):
        law, count = laws[index], int(rng.integers(1, 4))
        earlier = {table.group: weights(count, table.count) for table in tables if rng.random() < 0.4}
        pressing = {table.group: weights(count, table.count) for table in tables if rng.random() < 0.5}
        tables.append(
            Rows(
                group=f"table{len(tables)}",
                law=law,
                names=tuple(f"row{k}" for k in range(count)),
                parameters=random_parameters(law, rng, count),
                arm=weights(count, width),
                measure=weights(count, width) if rng.random() < 0.4 else None,
                offset=0.3 * rng.normal(size=count),
                channels=rng.integers(-1, channels, count),
                inputs=earlier,
                loads=pressing,
                pins=rng.integers(0, joints, count) if rng.random() < 0.5 else None,
                bends=np.abs(weights(count, width)) if rng.random() < 0.5 else None,
                curvature_offset=rng.uniform(0.1, 1.0, count),
                paths=[random_path(rng, joints) for _ in range(count)] if rng.random() < 0.3 else (),
            )
        )
    return Mechanism(body, [*random_readers(tables, width), *tables], lumps, rng.uniform(0.5, 2.0, len(lumps)))


def with_other_numbers(mechanism, rng):
    """The same mechanism, wired alike, with other inertias, places, parameters, arms, weights and paths."""
    model = mechanism.body.model.copy()
    model.gravity.linear[:] = rng.normal(size=3)
    for joint in range(1, model.njoints):
        model.inertias[joint] = random_inertia(rng)
        model.jointPlacements[joint] = random_placement(rng)
    for tip in mechanism.body.tips:
        model.frames[tip].placement = random_placement(rng)
    body = RigidBody(model, [model.frames[tip].name for tip in mechanism.body.tips])
    moved: dict[int, PathElement] = {}

    def elsewhere(leg):
        piece = leg.piece
        if id(piece) not in moved:
            ends = tuple(Place(end.joint, end.point + 0.1 * rng.normal(size=3)) for end in piece.ends)
            moved[id(piece)] = replace(piece, ends=ends, frame=random_placement(rng))
        return leg._replace(piece=moved[id(piece)])

    def scaled(matrix):
        return matrix * rng.uniform(0.5, 1.5, np.shape(matrix))

    def other(table):
        contact = table.law.arms > 1
        return replace(
            table,
            parameters=1.1 * table.parameters if contact else random_parameters(table.law, rng, table.count),
            arm=scaled(table.arm),
            measure=scaled(table.measure),
            offset=scaled(table.offset),
            inputs={group: scaled(weights) for group, weights in table.inputs.items()},
            loads={group: scaled(weights) for group, weights in table.loads.items()},
            readings={group: scaled(weights) for group, weights in table.readings.items()},
            bends=scaled(table.bends),
            curvature_offset=scaled(table.curvature_offset),
            paths=tuple(tuple(map(elsewhere, legs)) for legs in table.paths),
        )

    inertia = rng.uniform(0.5, 2.0, len(mechanism.lumps))
    return Mechanism(body, [other(table) for table in mechanism.listed], mechanism.lumps, inertia, mechanism.channels)


def random_states(mechanism, rng, count):
    """Packed states of order one, with unit quaternions."""
    x = rng.normal(size=(count, mechanism.size))
    for joint in mechanism.body.model.joints[1:]:
        if joint.nq != joint.nv:
            part = x[:, joint.idx_q : joint.idx_q + joint.nq]
            part /= np.linalg.norm(part, axis=1, keepdims=True)
    return x


def kinds_of(mechanism):
    """Indices of positions, velocities of joints and of lumps, and states in a packed state, by kind."""
    q, v, z = mechanism.split(np.arange(mechanism.size))
    return [each for each in (q, *np.split(v, [mechanism.body.model.nv]), z) if len(each)]


def by_listing(mechanism, order):
    """Return the mechanism with its tables listed in another order, and where its numbers of a packed state stand."""
    tables = [mechanism.rows[k] for k in order]
    listed = Mechanism(mechanism.body, tables, mechanism.lumps, mechanism.inertia, mechanism.channels)
    places = np.arange(mechanism.size)
    of = {table.group: part for table, part in zip(mechanism.rows, mechanism.states, strict=True)}
    moving = mechanism.size - mechanism.state_count
    for table, part in zip(listed.rows, listed.states, strict=True):
        places[moving:][part] = moving + np.arange(mechanism.state_count)[of[table.group]]
    return listed, places
