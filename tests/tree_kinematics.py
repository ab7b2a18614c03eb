"""Kinematics and energies of a described tree from its table alone; positions of joints may be complex."""

import numpy as np


def rotation_of(quaternion):
    """Return the rotation of a quaternion x, y, z, w of any length, shape (3, 3)."""
    x, y, z, w = np.asarray(quaternion) / np.linalg.norm(quaternion)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def about(axis, angle):
    """Return the rotation about an axis of any length by an angle, by Rodrigues' formula, shape (3, 3)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def placements(tree, position):
    """Return origin, m, and rotation of every body in the base frame, at positions of the joints by name."""
    placed = {None: (np.zeros(3), np.eye(3))}
    for name, body in tree["bodies"].items():
        origin, turn = placed[body.get("parent")]
        origin = origin + turn @ body.get("position", [0.0, 0.0, 0.0])
        turn = turn @ rotation_of(body.get("orientation", [0.0, 0.0, 0.0, 1.0]))
        for joint_name, joint in tree["joints"].items():
            if joint["body"] != name:
                continue
            travel, axis = position[joint_name] - joint.get("reference", 0.0), np.array(joint.get("axis", [0, 0, 1.0]))
            if joint.get("kind") == "slide":
                origin = origin + turn @ (axis / np.linalg.norm(axis)) * travel
                continue
            anchor = np.array(joint.get("anchor", [0.0, 0.0, 0.0]))
            turned = turn @ about(axis, travel)
            origin, turn = origin + turn @ anchor - turned @ anchor, turned
        placed[name] = origin, turn
    return placed


def body_inertia(body):
    """Return a body's inertia about its mass centre in its own frame, kg m2, shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = body.get("inertia", [0.0] * 6)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def point(placed, body, position):
    """Return a point of a body in the base frame, m."""
    origin, turn = placed[body]
    return origin + turn @ np.array(position)


def mass_matrix(tree, position, step=1e-20):
    """Return the mass matrix of the kinetic energy, whose speeds are complex steps of placements, joints in order."""
    names, bodies = list(tree["joints"]), tree["bodies"]
    placed = placements(tree, position)
    slopes = [placements(tree, position | {name: position[name] + 1j * step}) for name in names]
    matrix = np.diag([tree["joints"][name].get("armature", 0.0) for name in names])
    for name, body in bodies.items():
        centre, turn = body.get("centre", [0.0, 0.0, 0.0]), placed[name][1]
        speeds = np.array([np.imag(point(slope, name, centre)) / step for slope in slopes])
        # R' R^T is the cross product with the angular velocity.
        spins = [(np.imag(slope[name][1]) / step) @ turn.T for slope in slopes]
        spins = np.array([[spin[2, 1], spin[0, 2], spin[1, 0]] for spin in spins])
        inertia = turn @ body_inertia(body) @ turn.T
        matrix = matrix + body.get("mass", 0.0) * speeds @ speeds.T + spins @ inertia @ spins.T
    return matrix


def potential(tree, gravity, position):
    """Return the potential energy of the weights that nothing holds up, J."""
    placed = placements(tree, position)
    return -sum(
        body.get("mass", 0.0) * (1.0 - body.get("gravity_compensation", 0.0)) * (np.array(gravity) @ centre)
        for name, body in tree["bodies"].items()
        for centre in [point(placed, name, body.get("centre", [0.0, 0.0, 0.0]))]
    )


def bias(tree, gravity, position, velocity, step=1e-5):
    """Return C v + G by Lagrange's equations: Christoffel's symbols of differences, the weight of complex steps."""
    names = list(tree["joints"])
    slopes = []
    for name in names:
        ends = [mass_matrix(tree, position | {name: position[name] + k * step}) for k in (-2, -1, 1, 2)]
        slopes.append((ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * step))
    v, slopes = np.array([velocity[name] for name in names]), np.array(slopes)
    coriolis = np.einsum("kij,j,k->i", slopes, v, v) - 0.5 * np.einsum("ijk,j,k->i", slopes, v, v)
    weight = [np.imag(potential(tree, gravity, position | {name: position[name] + 1e-20j})) / 1e-20 for name in names]
    return coriolis + np.array(weight)


def described_tree(table):
    """Return bodies, joints and tips of any described finger or hand as a tree, with its gravity."""
    if "hand" not in table:
        finger = table["finger"]
        return (finger["tree"] if "tree" in finger else _of_links(finger, {}, "", 1.0)), finger["gravity"]
    whole = {"bodies": {}, "joints": {}, "tips": {}}
    for name, placed in table["hand"]["fingers"].items():
        roll, pitch, yaw = placed["orientation"]
        turn = about([0, 0, 1], yaw) @ about([0, 1, 0], pitch) @ about([1, 0, 0], roll)
        base = {"position": placed["position"], "orientation": quaternion_of(turn)}
        part = _of_links(placed["finger"], base, f"{name}.", placed["scale"])
        for key, entries in whole.items():
            entries.update(part[key])
    return whole, table["hand"]["gravity"]


def quaternion_of(turn):
    """Return the quaternion x, y, z, w of a rotation by less than half a turn."""
    w = 0.5 * np.sqrt(1.0 + np.trace(turn))
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (4.0 * w)
    return [*vector.tolist(), float(w)]


def _of_links(finger, base, prefix, scale):
    """Return a chain of links as a tree: a link turns about z, goes by its offset along z and its length along x."""
    bodies, joints, parent, place = {f"{prefix}base": base}, {}, f"{prefix}base", {}
    for name, joint in finger["joints"].items():
        link = joint["link"]
        length, width, offset = (scale * link.get(key, 0.0) for key in ("length", "width", "offset"))
        mass, square = link["mass"] * scale**3, link.get("section") == "square"
        across = mass * (width**2 / (12.0 if square else 16.0) + length**2 / 12.0)
        along = mass * width**2 / (6.0 if square else 8.0)
        across, along = (
            link[key] * scale**5 if key in link else solid
            for key, solid in (("transverse_inertia", across), ("axial_inertia", along))
        )
        centre = scale * link["centre_of_mass"] if "centre_of_mass" in link else 0.5 * length
        body = {"parent": parent, "mass": mass, "centre": [centre, 0.0, offset], **place}
        parent, joints[prefix + name] = prefix + name, {"body": prefix + name}
        bodies[parent] = body | {"inertia": [along, across, across, 0.0, 0.0, 0.0]}
        half = 0.5 * link.get("twist", 0.0)
        place = {"position": [length, 0.0, offset], "orientation": [np.sin(half), 0.0, 0.0, np.cos(half)]}
    tips = {prefix or "tip": {"body": parent, "position": [length, 0.0, offset]}}
    return {"bodies": bodies, "joints": joints, "tips": tips}
