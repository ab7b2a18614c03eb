"""What drives and surrounds random trees: actuators, objects, paths of joints; and the table of all their features."""

from __future__ import annotations

import numpy as np
import random_trees as trees
from random_fingers import SHARED_FEATURES, Feature, Table, decades, direction, some, swing
from tree_kinematics import placements, point


def start(table: Table) -> Table:
    """Return the placements of a tree's bodies where runs start."""
    inner, given = table["finger"]["tree"], table["simulation"]["initial"]["position"]
    references = {name: joint.get("reference", 0.0) for name, joint in inner["joints"].items()}
    return placements(inner, references | given)


def _drive(rng: np.random.Generator, table: Table, name: str, **numbers: object) -> bool:
    """Let an actuator drive a joint, or a tendon that nothing else pulls."""
    inner = table["finger"]["tree"]
    tendons = [each for each in inner["tendons"] if each not in table["finger"]["tendons"]]
    what = {"joint": str(rng.choice([*inner["joints"]]))}
    if tendons and rng.random() < 0.5:
        what = {"tendon": str(rng.choice(tendons))}
    limits = (
        {} if "muscle" in numbers else {"input_range": [float(-rng.uniform(0.02, 0.1)), float(rng.uniform(0.1, 0.3))]}
    )
    inner["actuators"][name] = what | {"gear": float(rng.choice([-1.0, 1.0, 0.5]))} | limits | numbers
    table["controller"].setdefault("inputs", {})[name] = swing(rng, 0.01, 0.2)
    return True


def motor(rng: np.random.Generator, table: Table) -> bool:
    return _drive(rng, table, "motor", gain=decades(rng, 1e-2, 1.0))


def joint_servo(rng: np.random.Generator, table: Table) -> bool:
    gain = decades(rng, 1e-2, 5.0)
    limits = {"force_range": [-0.05, 0.05]} if rng.random() < 0.5 else {}
    return _drive(rng, table, "joint_servo", gain=gain, by_length=-gain, by_speed=-0.02 * gain, **limits)


def lag(rng: np.random.Generator, table: Table) -> bool:
    return _drive(rng, table, "lag", gain=decades(rng, 1e-2, 1.0), time_constant=decades(rng, 1e-3, 0.1))


def integrator(rng: np.random.Generator, table: Table) -> bool:
    gain = decades(rng, 1e-2, 1.0)
    return _drive(rng, table, "integrator", gain=gain, by_length=-gain, integrates=True, state_range=[-0.5, 0.5])


def integral(rng: np.random.Generator, table: Table) -> bool:
    gain = decades(rng, 1e-2, 1.0)
    return _drive(rng, table, "integral", gain=gain, by_length=-gain, integral=decades(rng, 0.1, 10.0))


def slew(rng: np.random.Generator, table: Table) -> bool:
    return _drive(rng, table, "slew", gain=decades(rng, 1e-2, 1.0), slew=decades(rng, 1.0, 100.0))


def delay(rng: np.random.Generator, table: Table) -> bool:
    return _drive(rng, table, "delay", gain=decades(rng, 1e-2, 1.0), delay=float(rng.uniform(1e-3, 8e-3)))


def muscle(rng: np.random.Generator, table: Table) -> bool:
    lengths = {"force": decades(rng, 0.1, 10.0), "length_range": [0.02, 0.1], "smoothing": float(rng.uniform(0.0, 0.3))}
    acted = _drive(rng, table, "muscle", muscle=lengths)
    table["finger"]["tree"]["actuators"]["muscle"]["gear"] = 1.0
    return acted


def wrench(rng: np.random.Generator, table: Table) -> bool:
    """Push a body at a point, along its own axes, or those of the base or a body that carries it."""
    inner = table["finger"]["tree"]
    body = str(rng.choice([*inner["bodies"]]))
    push = {"body": body, "position": rng.normal(0.0, 0.02, 3).tolist(), "force": rng.normal(size=3).tolist()}
    if rng.random() < 0.6:
        push["torque"] = rng.normal(0.0, 0.02, 3).tolist()
    if rng.random() < 0.6:
        push |= {"axes": "other", "other_position": rng.normal(0.0, 0.02, 3).tolist()}
        push |= {"other": parent} if (parent := inner["bodies"][body].get("parent")) else {}
    gain = decades(rng, 1e-2, 1.0)
    held = {"by_length": -gain} if push.get("axes") and "torque" not in push else {}
    inner["actuators"]["wrench"] = {"wrench": push, "gain": gain, "by_speed": -0.01 * gain, **held}
    inner["actuators"]["wrench"]["input_range"] = [-0.2, 0.3]
    table["controller"].setdefault("inputs", {})["wrench"] = swing(rng, 0.01, 0.2)
    return True


def _shape(rng: np.random.Generator) -> Table:
    shape = str(rng.choice([*trees.SHAPES]))
    return {"shape": shape, **trees.SHAPES[shape](rng), "orientation": direction(rng, 4).tolist()}


def _surface(rng: np.random.Generator) -> Table:
    surface = {"stiffness": decades(rng, 1e2, 1e4), "damping": decades(rng, 1e-2, 2.0), "friction": 0.5}
    surface |= {"exponent": float(rng.choice([1.0, 1.5])), "stiction_ratio": float(rng.uniform(1.0, 1.5))}
    if rng.random() < 0.4:
        surface["torsion"] = float(rng.uniform(1e-3, 5e-3))
    return {"surface": surface}


def _tip_shape(rng: np.random.Generator, table: Table) -> tuple[str, np.ndarray]:
    """Return the name of the last body, which has a shape, and where that is as runs start, m."""
    name = [*table["finger"]["tree"]["bodies"]][-1]
    shapes = table["finger"]["tree"]["bodies"][name].setdefault("shapes", {})
    if "pad" not in shapes:
        shapes["pad"] = _shape(rng) | {"position": rng.normal(0.0, 5e-3, 3).tolist()} | _surface(rng)
    return name, point(start(table), name, shapes["pad"]["position"])


def fixed_object(rng: np.random.Generator, table: Table) -> bool:
    """Put a solid or a half-space near the last body."""
    _, place = _tip_shape(rng, table)
    away = direction(rng)
    if rng.random() < 0.2:
        # Upside is along z: the shortest turn from there.
        turn = np.append(np.cross([0.0, 0.0, 1.0], away), 1.0 + away[2])
        found = {"shape": "half_space", "orientation": turn.tolist()}
        found["position"] = (place - 0.8 * trees.REACH * away).tolist()
    else:
        found = _shape(rng) | {"position": (place + 1.6 * trees.REACH * away).tolist()}
    table["finger"]["tree"]["objects"]["fixed"] = found | (_surface(rng) if rng.random() < 0.5 else {})
    return True


def free_object(rng: np.random.Generator, table: Table) -> bool:
    """Throw a solid at the last body."""
    _, place = _tip_shape(rng, table)
    away = direction(rng)
    thrown = {
        "velocity": (-rng.uniform(0.5, 2.0) * away).tolist(),
        "angular_velocity": rng.normal(0.0, 5.0, 3).tolist(),
    }
    thrown |= {"position": (place + 2.0 * trees.REACH * away).tolist(), "mass": decades(rng, 1e-3, 0.1)}
    objects = table["finger"]["tree"]["objects"]
    objects["free"] = _shape(rng) | thrown | _surface(rng) | {"apart": [*objects]}
    if rng.random() < 0.5:
        objects["free"] |= {"damping": decades(rng, 1e-3, 1.0), "angular_damping": decades(rng, 1e-7, 1e-4)}
    return True


def moved_object(rng: np.random.Generator, table: Table) -> bool:
    """Move a solid to and fro beside the last body."""
    _, place = _tip_shape(rng, table)
    moved = {"path": {str(rng.choice(["x", "y", "z"])): {"amplitude": 0.01, "frequency": 20.0}}}
    moved |= {"position": (place + 2.5 * trees.REACH * direction(rng)).tolist()}
    objects = table["finger"]["tree"]["objects"]
    objects["moved"] = _shape(rng) | moved | {"apart": [*objects]}
    return True


def joint_path(rng: np.random.Generator, table: Table) -> bool:
    """Move a joint that carries no mass along a path, whatever that takes."""
    inner, finger = table["finger"]["tree"], table["finger"]
    inner["bodies"]["led"] = {"position": rng.uniform(-0.04, 0.04, 3).tolist()}
    inner["joints"]["led"] = {"body": "led", "kind": "slide", "axis": direction(rng).tolist(), "bearing": False}
    inner["joints"]["led"]["path"] = {"amplitude": 5e-3, "frequency": 20.0}
    finger["joints"]["led"] = {"range": [-0.05, 0.05], "limited": False}
    tied = {"start": {"kind": "point", "body": "led"}, "end": {"kind": "point", "body": "body_0"}}
    tied["end"]["position"] = rng.uniform(-0.03, 0.03, 3).tolist()
    inner["tendons"]["led"] = {"path": tied, "stiffness": decades(rng, 10.0, 1e3), "rest": [0.0, 0.01]}
    return True


def keyframe(rng: np.random.Generator, table: Table) -> bool:
    """Write the start as a keyframe that moves."""
    position = table["simulation"].pop("initial")["position"]
    velocity = {name: float(rng.normal()) for name in position}
    for name in position:
        velocity[name] *= 0.01 if table["finger"]["tree"]["joints"][name].get("kind") == "slide" else 1.0
    table["finger"]["tree"]["keyframes"] = {"first": {"position": position, "velocity": velocity}}
    return True


def moving_start(rng: np.random.Generator, table: Table) -> bool:
    initial = table["simulation"].get("initial")
    if initial is None:
        return False
    slides = {name for name, joint in table["finger"]["tree"]["joints"].items() if joint.get("kind") == "slide"}
    initial["velocity"] = {
        name: float(rng.normal()) * (0.02 if name in slides else 2.0) for name in some(rng, initial["position"])
    }
    return True


#: Features of trees, in the order in which they are added.
TREE_FEATURES: dict[str, Feature] = {
    "second joints": trees.second_joints,
    "slides": trees.slides,
    "several tips": trees.several_tips,
    "any order": trees.any_order,
    "anchors and references": trees.anchors_and_references,
    "armatures": trees.armatures,
    "welded bodies": trees.welded_bodies,
    "gravity compensation": trees.gravity_compensation,
    "cord": trees.cord,
    "wraps": trees.wraps,
    "pulleys": trees.pulleys,
    "sum of joints": trees.sum_of_joints,
    "tendon range": trees.tendon_range,
    "pulled cord": trees.pulled_cord,
    "joint path": joint_path,
    "coupling": trees.coupling,
    "loop": trees.loop,
    "motor": motor,
    "joint servo": joint_servo,
    "lag": lag,
    "integrator": integrator,
    "integral": integral,
    "slew": slew,
    "delay": delay,
    "muscle": muscle,
    "fixed object": fixed_object,
    "free object": free_object,
    "moved object": moved_object,
    "moving start": moving_start,
    "keyframe": keyframe,
} | SHARED_FEATURES
