"""Random trees of bodies in any order, and the table of their features; numbers go over decades."""

from __future__ import annotations

from typing import Any

import numpy as np
from random_fingers import Table, decades, direction, some, swing
from tree_kinematics import placements, point, rotation_of

#: Sizes of shapes, m, at random.
SHAPES: dict[str, Any] = {
    "sphere": lambda rng: {"radius": float(rng.uniform(4e-3, 1e-2))},
    "box": lambda rng: {"sides": rng.uniform(6e-3, 2e-2, 3).tolist()},
    "cylinder": lambda rng: {"radius": float(rng.uniform(3e-3, 8e-3)), "length": float(rng.uniform(6e-3, 2e-2))},
    "capsule": lambda rng: {"radius": float(rng.uniform(3e-3, 8e-3)), "length": float(rng.uniform(6e-3, 2e-2))},
    "ellipsoid": lambda rng: {"semi_axes": rng.uniform(4e-3, 1.2e-2, 3).tolist()},
}
#: Farther than this from its centre no shape reaches, m.
REACH = 0.018


def _inertia(rng: np.random.Generator, mass: float) -> list[float]:
    """Return the moments of an ellipsoid that is turned anyhow."""
    squares = rng.uniform(3e-3, 2e-2, 3) ** 2
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moments = axes @ np.diag(0.2 * mass * (squares.sum() - squares)) @ axes.T
    return [float(moments[k]) for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _body(rng: np.random.Generator, parent: str | None) -> Table:
    mass = decades(rng, 1e-3, 0.1)
    body = {"position": rng.uniform(-0.04, 0.04, 3).tolist(), "orientation": direction(rng, 4).tolist(), "mass": mass}
    body |= {"centre": rng.normal(0.0, 5e-3, 3).tolist(), "inertia": _inertia(rng, mass)}
    return body | ({"parent": parent} if parent else {})


def tree(rng: np.random.Generator) -> Table:
    """Return a finger of 1 to 5 bodies in the order of a walk through their tree, each with a hinge on its parent."""
    bodies, joints, ranges, walk = {}, {}, {}, [None]
    for k in range(int(rng.integers(1, 6))):
        # A new branch leaves the way back to the base.
        walk = walk[: rng.integers(1, len(walk) + 1)] if rng.random() < 0.5 else walk
        bodies[f"body_{k}"] = _body(rng, walk[-1])
        walk.append(f"body_{k}")
        joints[f"joint_{k}"] = {"body": f"body_{k}", "axis": direction(rng).tolist()}
        ranges[f"joint_{k}"] = {"range": [float(-rng.uniform(0.5, 1.5)), float(rng.uniform(0.5, 1.5))]}
    gravity = (9.81 * direction(rng)).tolist()
    inner = {"bodies": bodies, "joints": joints, "tips": {}, "tendons": {}, "actuators": {}, "objects": {}}
    inner["tips"] = {"tip": {"body": f"body_{k}", "position": rng.normal(0.0, 0.02, 3).tolist()}}
    return {"name": "random", "gravity": gravity, "joints": ranges, "tendons": {}, "tree": inner}


def any_order(rng: np.random.Generator, table: Table) -> bool:
    """List bodies in any order with parents first, and joints in that of their bodies."""
    inner = table["finger"]["tree"]
    left, listed = dict(inner["bodies"]), {}
    while left:
        ready = [name for name, body in left.items() if body.get("parent") in (None, *listed)]
        listed[name] = left.pop(name := str(rng.choice(ready)))
    order = list(listed)
    joints = dict(sorted(inner["joints"].items(), key=lambda item: order.index(item[1]["body"])))
    changed = list(joints) != list(inner["joints"])
    inner |= {"bodies": listed, "joints": joints}
    table["finger"]["joints"] = {name: table["finger"]["joints"][name] for name in joints}
    return changed


def several_tips(rng: np.random.Generator, table: Table) -> bool:
    inner = table["finger"]["tree"]
    inner["tips"]["other"] = {
        "body": str(rng.choice([*inner["bodies"]])),
        "position": rng.normal(0.0, 0.02, 3).tolist(),
    }
    return True


def slides(rng: np.random.Generator, table: Table) -> bool:
    for name, joint in some(rng, table["finger"]["tree"]["joints"].items()):
        joint["kind"] = "slide"
        table["finger"]["joints"][name]["range"] = [float(-rng.uniform(0.01, 0.03)), float(rng.uniform(0.01, 0.03))]
        if name in table["simulation"]["initial"]["position"]:
            table["simulation"]["initial"]["position"][name] *= 0.01
    return True


def second_joints(rng: np.random.Generator, table: Table) -> bool:
    """Give some bodies a second joint."""
    finger, joints = table["finger"], {}
    chosen = some(rng, finger["tree"]["joints"])
    for name, joint in finger["tree"]["joints"].items():
        joints[name] = joint
        if name in chosen:
            joints[f"{name}_b"] = {"body": joint["body"], "axis": direction(rng).tolist()}
            finger["joints"][f"{name}_b"] = {"range": [-0.8, 0.8]}
    finger["tree"]["joints"] = joints
    finger["joints"] = {name: finger["joints"][name] for name in joints}
    return True


def anchors_and_references(rng: np.random.Generator, table: Table) -> bool:
    for joint in some(rng, table["finger"]["tree"]["joints"].values()):
        if joint.get("kind") != "slide":
            joint |= {"anchor": rng.normal(0.0, 5e-3, 3).tolist(), "reference": float(rng.uniform(-0.3, 0.3))}
    return True


def armatures(rng: np.random.Generator, table: Table) -> bool:
    for joint in some(rng, table["finger"]["tree"]["joints"].values()):
        joint["armature"] = decades(rng, 1e-7, 1e-4) * (1e3 if joint.get("kind") == "slide" else 1.0)
    return True


def welded_bodies(rng: np.random.Generator, table: Table) -> bool:
    """Fix bodies without joints on others."""
    bodies = table["finger"]["tree"]["bodies"]
    listed = {}
    for name, body in bodies.items():
        listed[name] = body
        if rng.random() < 0.5:
            listed[f"{name}_piece"] = _body(rng, name)
    changed = len(listed) > len(bodies)
    table["finger"]["tree"]["bodies"] = listed
    return changed


def gravity_compensation(rng: np.random.Generator, table: Table) -> bool:
    for body in some(rng, table["finger"]["tree"]["bodies"].values()):
        body["gravity_compensation"] = float(rng.uniform(0.2, 1.5))
    return True


def _place(rng: np.random.Generator, body: str | None) -> Table:
    return {"kind": "point", "position": rng.uniform(-0.03, 0.03, 3).tolist()} | ({"body": body} if body else {})


def _path(rng: np.random.Generator, inner: Table, least: int = 2) -> Table:
    """Return points on the base and on some bodies, as they are listed."""
    bodies = some(rng, inner["bodies"])
    holders = [None, *bodies, *([bodies[-1]] if len(bodies) + 1 < least else [])]
    return {f"p{k}": _place(rng, body) for k, body in enumerate(holders)}


def cord(rng: np.random.Generator, table: Table) -> bool:
    """Lead a cord with a spring through points."""
    inner = table["finger"]["tree"]
    spring = {"stiffness": decades(rng, 10.0, 5e3), "damping": decades(rng, 1e-2, 5.0)}
    ends = {"slack": float(rng.uniform(-2e-3, 1e-3))} if rng.random() < 0.5 else {"rest": [0.0, 0.03]}
    inner["tendons"]["cord"] = {"path": _path(rng, inner, 3), **spring, **ends}
    return True


def wraps(rng: np.random.Generator, table: Table) -> bool:
    """Let a cord wrap a sphere or cylinder, perhaps on a side that is said."""
    inner = table["finger"]["tree"]
    body = str(rng.choice([*inner["bodies"]]))
    kind, radius = str(rng.choice(["sphere", "cylinder"])), float(rng.uniform(3e-3, 7e-3))
    wrap = {"kind": kind, "body": body, "radius": radius, "position": rng.normal(0.0, 3e-3, 3).tolist()}
    wrap["orientation"] = direction(rng, 4).tolist()
    if rng.random() < 0.5:
        wrap["side"] = (1.5 * radius * direction(rng)).tolist()
    ends = _place(rng, None), _place(rng, body)
    # Far from the axis in any direction.
    ends[1]["position"] = (np.array(wrap["position"]) + _across(rng, wrap) * 0.02).tolist()
    spring = {"stiffness": decades(rng, 10.0, 5e3), "slack": float(rng.uniform(-2e-3, 1e-3))}
    inner["tendons"]["wrapped"] = {"path": {"from": ends[0], "over": wrap, "to": ends[1]}, **spring}
    return True


def _across(rng: np.random.Generator, wrap: Table) -> np.ndarray:
    axis = rotation_of(wrap["orientation"])[:, 2]
    across = np.cross(axis, direction(rng))
    return across / np.linalg.norm(across)


def pulleys(rng: np.random.Generator, table: Table) -> bool:
    """Lead a cord over a pulley to two branches."""
    inner = table["finger"]["tree"]
    path = {f"a_{name}": place for name, place in _path(rng, inner).items()}
    for branch in ("b", "c"):
        path[f"over_{branch}"] = {"kind": "pulley", "divisor": float(rng.integers(2, 4))}
        path |= {f"{branch}_{name}": place for name, place in _path(rng, inner).items()}
    spring = {"stiffness": decades(rng, 10.0, 5e3), "slack": float(rng.uniform(-2e-3, 1e-3))}
    inner["tendons"]["branched"] = {"path": path, **spring}
    return True


def pulled_cord(rng: np.random.Generator, table: Table) -> bool:
    """Let an ideal source pull a cord through points."""
    inner = table["finger"]["tree"]
    inner["tendons"]["pulled"] = {"path": _path(rng, inner, 3), "curvature_offset": float(rng.uniform(0.0, 1.0))}
    table["finger"]["tendons"]["pulled"] = {"along": "pulled"}
    table["controller"].setdefault("tensions", {})["pulled"] = swing(rng, 0.5, 5.0)
    return True


def sum_of_joints(rng: np.random.Generator, table: Table) -> bool:
    """Add a transmission that is a sum of joint positions."""
    inner = table["finger"]["tree"]
    radii = {name: float(rng.uniform(-8e-3, 8e-3)) for name in some(rng, inner["joints"])}
    sums = {"joints": radii, "stiffness": decades(rng, 1.0, 1e3), "damping": decades(rng, 1e-3, 1.0)}
    inner["tendons"]["sum"] = sums | {"rest": [-1e-3, 1e-3], "friction": float(0.1 * (rng.random() < 0.5))}
    return True


def tendon_range(rng: np.random.Generator, table: Table) -> bool:
    tendons = table["finger"]["tree"]["tendons"].values()
    for tendon in tendons:
        tendon |= {"range": [-0.01, 0.08], "limit_stiffness": decades(rng, 1e3, 1e5)}
    return bool(tendons)


def coupling(rng: np.random.Generator, table: Table) -> bool:
    """Let a joint follow another along a polynomial, or hold one."""
    inner = table["finger"]["tree"]
    names = [str(name) for name in rng.permutation([*inner["joints"]])]
    held = {"joint": names[0], "stiffness": decades(rng, 1.0, 100.0), "damping": decades(rng, 1e-3, 0.1)}
    if len(names) > 1:
        held |= {"other": names[1], "ratio": float(rng.normal()), "powers": rng.normal(0.0, 0.3, 3).tolist()}
    inner["couplings"] = {"coupling": held | {"offset": float(rng.normal(0.0, 0.1))}}
    return True


def tendon_coupling(rng: np.random.Generator, table: Table) -> bool:
    """Let a tendon that no ideal source pulls follow another, or hold one."""
    inner, pulled = table["finger"]["tree"], [each.get("along") for each in table["finger"]["tendons"].values()]
    names = [str(name) for name in rng.permutation([name for name in inner["tendons"] if name not in pulled])]
    if not names:
        return False
    held = {"tendon": names[0], "stiffness": decades(rng, 1e2, 1e4), "damping": decades(rng, 0.1, 10.0)}
    if len(names) > 1:
        held |= {"other": names[1], "ratio": float(rng.normal())}
    inner.setdefault("couplings", {})["bar"] = held | {"offset": float(rng.normal(0.0, 1e-3))}
    return True


def loop(rng: np.random.Generator, table: Table) -> bool:
    """Pin a point of the last body near to where it starts."""
    inner = table["finger"]["tree"]
    body = [*inner["bodies"]][-1]
    place, references = (
        rng.normal(0.0, 0.01, 3),
        {name: each.get("reference", 0.0) for name, each in inner["joints"].items()},
    )
    there = point(placements(inner, references | table["simulation"]["initial"]["position"]), body, place) + rng.normal(
        0.0, 1e-3, 3
    )
    ends = {"body": body, "position": place.tolist(), "other_position": there.tolist()}
    inner["loops"] = {"pin": ends | {"stiffness": decades(rng, 10.0, 1e3), "damping": decades(rng, 0.1, 10.0)}}
    return True
