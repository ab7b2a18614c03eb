"""Other ways to write one model down: what comes out may not change by them."""

from __future__ import annotations

import copy
import json
import re

import numpy as np
from random_fingers import Table, direction
from random_models import RandomModel
from random_trees import any_order
from tree_kinematics import about, body_inertia, quaternion_of, rotation_of

from finger_pin.description.commands import BY_NAME

#: Mirrored at y = 0.
MIRROR = np.array([1.0, -1.0, 1.0])
_VECTORS = ("position", "other_position", "force", "anchor", "centre", "side", "velocity")


def renamed(model: RandomModel) -> tuple[Table, Table]:
    """Return a model, and the same with names that sort the other way round."""
    text = json.dumps(model.table)
    other = re.sub(r"\b(body|joint|finger)_(\d)", lambda found: f"{found[1]}_{9 - int(found[2])}", text)
    return model.table, json.loads(other)


def name_before(name: str) -> str:
    """Return the name of a joint that `renamed` has changed."""
    return re.sub(r"(joint|finger)_(\d)", lambda found: f"{found[1]}_{9 - int(found[2])}", name)


def reordered(model: RandomModel) -> tuple[Table, Table]:
    """Return a tree, and the same with bodies, tendons and actuators in another order."""
    other = copy.deepcopy(model.table)
    any_order(model.rng(20), other)
    for key in ("tendons", "actuators", "objects"):
        other["finger"]["tree"][key] = dict(reversed(other["finger"]["tree"].get(key, {}).items()))
    # Of numbers that are listed joint by joint the order would be another.
    for table in (model.table, other):
        drag = table["finger"].get("joint_friction", {}).get("drag")
        if isinstance(drag, list):
            table["finger"]["joint_friction"]["drag"] = drag[0]
    return model.table, other


def mirrored(model: RandomModel) -> tuple[Table, Table]:
    """Return a tree, and its mirror image, whose joints turn as far."""
    other = copy.deepcopy(model.table)
    _mirror(other["finger"]["tree"])
    for key, value in (("gravity", other["finger"]), ("fingertip_force", other["environment"])):
        value |= {key: (MIRROR * value[key]).tolist()} if key in value else {}
    return model.table, other


def _mirror(value: Table) -> None:
    for key, each in value.items():
        if isinstance(each, dict):
            _mirror(each)
        elif key in _VECTORS and isinstance(each, list) and len(each) == 3:
            value[key] = (MIRROR * each).tolist()
        elif key == "orientation":
            value[key] = (np.array([-1.0, 1.0, -1.0, 1.0]) * each).tolist()
        elif key == "axis":
            value[key] = ((1.0 if value.get("kind") == "slide" else -1.0) * MIRROR * each).tolist()
        elif key in ("angular_velocity", "torque"):
            value[key] = (-MIRROR * each).tolist()
        elif key == "inertia":
            value[key] = (np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0]) * each).tolist()
    if "path" in value and set(value["path"]) == {"y"}:
        value["path"]["y"]["amplitude"] *= -1.0


def turned(model: RandomModel) -> tuple[Table, Table]:
    """Return a tree, and the same turned and shifted as a whole, with its weight and all that stands around it."""
    other, rng = copy.deepcopy(model.table), model.rng(21)
    turn, shift = about(direction(rng), rng.uniform(-2.0, 2.0)), rng.uniform(-0.1, 0.1, 3)
    finger, inner = other["finger"], other["finger"]["tree"]
    based = [body for body in inner["bodies"].values() if "parent" not in body]
    based += [each for tendon in inner["tendons"].values() for each in tendon.get("path", {}).values()]
    based = [each for each in based if "body" not in each and each.get("kind") != "pulley"]
    for each in [*based, *inner["objects"].values()]:
        each["position"] = (shift + turn @ each.get("position", [0.0, 0.0, 0.0])).tolist()
        own = rotation_of(each.get("orientation", [0.0, 0.0, 0.0, 1.0]))
        if each.get("kind") != "point":
            each["orientation"] = quaternion_of(turn @ own)
        if "velocity" in each:
            each["velocity"] = (turn @ each["velocity"]).tolist()
    for loop in inner.get("loops", {}).values():
        loop["other_position"] = (shift + turn @ loop["other_position"]).tolist()
    for push in (each["wrench"] for each in inner.get("actuators", {}).values() if "wrench" in each):
        if push.get("axes") == "other" and "other" not in push:
            push["other_position"] = (shift + turn @ push["other_position"]).tolist()
            push |= {key: (turn @ push[key]).tolist() for key in ("force", "torque") if key in push}
    finger["gravity"] = (turn @ finger["gravity"]).tolist()
    if "fingertip_force" in other["environment"]:
        other["environment"]["fingertip_force"] = (turn @ other["environment"]["fingertip_force"]).tolist()
    return model.table, other


def halved(model: RandomModel) -> tuple[Table, Table]:
    """Return a tree, and the same with every body cut into halves that are welded together."""
    other, rng, bodies = copy.deepcopy(model.table), model.rng(22), {}
    for name, body in other["finger"]["tree"]["bodies"].items():
        turn, place = rotation_of(direction(rng, 4)), rng.uniform(-0.02, 0.02, 3)
        if "mass" in body:
            body["mass"] *= 0.5
            body["inertia"] = (0.5 * np.array(body["inertia"])).tolist()
            moments = turn.T @ body_inertia(body) @ turn
            half = {"parent": name, "position": place.tolist(), "orientation": quaternion_of(turn)}
            half |= {"mass": body["mass"], "centre": (turn.T @ (body["centre"] - place)).tolist()}
            half["inertia"] = [float(moments[k]) for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            half |= {key: each for key, each in body.items() if key == "gravity_compensation"}
            bodies |= {name: body, f"{name}_half": half}
        else:
            bodies[name] = body
    other["finger"]["tree"]["bodies"] = bodies
    return model.table, other


def one_by_one(model: RandomModel) -> tuple[Table, Table]:
    """Return a model, and the same with numbers of friction written for every joint and tendon."""
    other = copy.deepcopy(model.table)
    fingers = [each["finger"] for each in other["hand"]["fingers"].values()] if "hand" in other else [other["finger"]]
    for finger in fingers:
        for group, count in (("joint_friction", len(finger["joints"])), ("tendon_friction", len(finger["tendons"]))):
            numbers = finger.get(group, {})
            for key, value in numbers.items():
                # Cords of a tree that nothing pulls have none of their own.
                if isinstance(value, int | float) and count and (group == "joint_friction" or "tree" not in finger):
                    numbers[key] = [value] * count
    return model.table, other


def later(model: RandomModel) -> tuple[Table, Table]:
    """Return a model, and the same by a clock that is ahead, with the phases of all signals as late."""
    other, ahead = copy.deepcopy(model.table), 0.37
    other["simulation"]["start_time"] = other["simulation"].get("start_time", 0.0) + ahead

    def shift(value: Table) -> None:
        for each in value.values():
            if isinstance(each, dict):
                if "frequency" in each:
                    each["phase"] = each.get("phase", 0.0) - 2.0 * np.pi * each["frequency"] * ahead
                shift(each)

    shift(other)
    return model.table, other


def gravity_turned(model: RandomModel) -> tuple[Table, Table]:
    """Return a hand whose palm rests askew in the world, and the same with its weight askew instead."""
    rng = model.rng(23)
    roll, pitch, yaw = rng.uniform(-1.0, 1.0, 3)
    turn = about([0, 0, 1], yaw) @ about([0, 1, 0], pitch) @ about([1, 0, 0], roll)
    askew, straight = copy.deepcopy(model.table), copy.deepcopy(model.table)
    path = {"roll": roll, "pitch": pitch, "yaw": yaw, "x": 0.2}
    askew["hand"]["palm"] = {"path": {name: {"offset": float(value)} for name, value in path.items()}}
    straight["hand"]["gravity"] = (turn.T @ straight["hand"]["gravity"]).tolist()
    return askew, straight


def on_palm(model: RandomModel) -> tuple[Table, Table]:
    """Return a tree, and a hand of which it is one finger, turned with its weight; another one is the same tree."""
    finger, rng = model.table["finger"], model.rng(24)
    placed = {}
    for name in ("left", "right"):
        angles, place = rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.1, 0.1, 3)
        placed[name] = {"finger": finger, "position": place.tolist(), "orientation": angles.tolist()}
    roll, pitch, yaw = placed["left"]["orientation"]
    turn = about([0, 0, 1], yaw) @ about([0, 1, 0], pitch) @ about([1, 0, 0], roll)
    other = copy.deepcopy({key: each for key, each in model.table.items() if key != "finger"})
    own = {key: other["controller"].pop(key) for key in BY_NAME if key in other["controller"]}
    initial = other["simulation"].get("initial", {})
    other["simulation"]["initial"] = {key: dict.fromkeys(placed, each) for key, each in initial.items()}
    other["controller"]["fingers"] = dict.fromkeys(placed, own)
    if "fingertip_force" in other["environment"]:
        other["environment"]["fingertip_force"] = (turn @ other["environment"]["fingertip_force"]).tolist()
    return model.table, other | {"hand": {"gravity": (turn @ finger["gravity"]).tolist(), "fingers": placed}}
