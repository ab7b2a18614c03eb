"""A tree of bodies, the places at which it stands on a palm, and scenarios of it."""

import numpy as np
from changed_tables import with_entries

import finger_pin as fp
from finger_pin.description.loading import read_scenario
from finger_pin.description.meshes import Mesh
from finger_pin.description.placement import rotation

SIZES = {"mass": 0.02, "inertia": [3e-6, 5e-6, 4e-6, 1e-7, 0.0, -2e-7], "centre": [0.012, 0.001, -0.002]}
CORNERS = 0.01 * np.vstack([np.zeros(3), np.eye(3)])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
PAD = {"kind": "mesh", "mesh": "shell"}
#: Two branches, whose joints have anchors, references and armatures; cords from the base, over a wrap, with a spring.
TREE = {
    "name": "own",
    "joints": {
        "swing": {"range": [-1.0, 1.0], "spring": {"stiffness": 0.02, "rest": 0.2, "damping": 1e-4}},
        "bend": {"range": [-0.2, 1.5]},
        "follow": {"range": [-0.2, 1.5]},
        "thrust": {"range": [-0.01, 0.02], "spring": {"stiffness": 20.0, "rest": 0.002}},
    },
    "tendons": {"pull": {"along": "upper"}},
    "joint_friction": {"coulomb": [1e-4, 2e-4, 3e-4, 0.1], "stiction": [2e-4, 3e-4, 4e-4, 0.1]},
    "tendon_friction": {"coulomb": [0.1, 0.2]},
    "tree": {
        "bodies": {
            "stem": {
                **SIZES,
                "position": [0.01, 0.0, 0.005],
                "orientation": [0.0, 0.0, 0.1, 0.9949874371066199],
                "solids": {"shell": PAD, "core": {"kind": "sphere", "radius": 0.006}},
                "shapes": {"core": {"shape": "sphere", "radius": 0.006}},
            },
            "tip": {
                **SIZES,
                "parent": "stem",
                "position": [0.03, 0.0, 0.0],
                "gravity_compensation": 0.4,
                "shapes": {"end": {"shape": "sphere", "radius": 0.005, "position": [0.02, 0.0, 0.0]}},
            },
            "last": {**SIZES, "parent": "tip", "position": [0.03, 0.002, 0.0]},
            "slider": {**SIZES, "position": [0.0, 0.03, 0.0]},
        },
        "joints": {
            "swing": {"body": "stem", "axis": [0.0, 1.0, 0.0], "anchor": [-0.002, 0.0, 0.001], "armature": 1e-6},
            "bend": {"body": "tip", "reference": 0.1},
            "follow": {"body": "last"},
            "thrust": {
                "body": "slider",
                "kind": "slide",
                "axis": [0.6, 0.0, 0.8],
                "reference": 0.001,
                "armature": 0.01,
            },
        },
        "tendons": {
            "upper": {
                "path": {
                    "a": {"kind": "point", "position": [-0.02, 0.0, 0.02]},
                    "over": {
                        "kind": "cylinder",
                        "radius": 0.004,
                        "body": "stem",
                        "orientation": [0.7071067811865476, 0.0, 0.0, 0.7071067811865476],
                        "side_point": {"position": [0.01, 0.0, 0.05]},
                    },
                    "b": {"kind": "point", "body": "tip", "position": [0.0, 0.001, 0.012]},
                }
            },
            "sum": {"joints": {"bend": 0.008, "thrust": 0.5}, "stiffness": 30.0, "rest": [-1e-3, 1e-3]},
            "cord": {"joints": {"bend": 0.006}, "stiffness": 500.0, "slack": 1e-4},
        },
        "couplings": {"course": {"joint": "follow", "other": "bend", "ratio": 0.7, "powers": [0.1], "stiffness": 5.0}},
        "loops": {"pin": {"body": "slider", "other_position": [0.0, 0.03, 0.0], "stiffness": 50.0, "damping": 0.5}},
        "actuators": {"motor": {"joint": "swing", "gain": 0.05}, "servo": {"tendon": "sum", "gain": 2.0}},
        "keyframes": {
            "open": {"position": {"bend": 0.3, "follow": 0.2}, "inputs": {"motor": 0.4, "pull": 1.5}},
            "shut": {"position": {"bend": 0.9, "swing": -0.2}, "velocity": {"bend": 0.5}},
        },
        "tip": {"body": "last", "position": [0.02, 0.0, 0.0]},
        "meshes": {"shell": Mesh.packed(CORNERS, FACES)},
    },
}
ON_PATH = {"body": "slider", "kind": "slide", "path": {"amplitude": 0.01, "frequency": 1.0}}
PLACES = {
    "left": {"position": [0.02, 0.2, -0.01], "orientation": [0.4, -0.7, 1.1]},
    "right": {"position": [0.0, -0.2, 0.0], "orientation": [-0.2, 0.0, 2.0]},
}
GRAVITY = [1.0, -3.0, -9.0]
OPEN = {"controller": {"kind": "tensions"}, "simulation": {"duration": 0.02}}


def scenario_of(fingers, **more):
    """Return the scenario of a hand, whose fingers stand at `PLACES`."""
    placed = {
        name: {**PLACES[name], **(each if "finger" in each else {"finger": each})} for name, each in fingers.items()
    }
    hand = {"name": "hand", "gravity": GRAVITY, "palm": {"size": [0.05, 0.3, 0.01]}, "fingers": placed}
    return read_scenario({"name": "palm", "hand": hand, **OPEN, **more})


def alone_under_turned_gravity(name, finger=TREE, **more):
    """Return the scenario of the finger alone, in its own frame."""
    gravity = rotation(*PLACES[name]["orientation"]).T @ GRAVITY
    return read_scenario({"name": "alone", "finger": finger | {"gravity": gravity.tolist()}, **OPEN, **more})


def as_bodies(name):
    """Return a finger of links as the table of its bodies."""
    finger = fp.load_finger(name)
    table = finger.model_dump(mode="python", exclude_none=True)
    for joint in table["joints"].values():
        del joint["link"]
    return table | {"tree": finger.bodies.model_dump(mode="python", exclude_none=True)}


def changed(**entries):
    """Return the tree with entries at keys whose dots are double underscores; None takes one away."""
    return with_entries(TREE, entries)


def states(finger, count=8):
    """Return packed states around rest states within the ranges."""
    rng, limiter = np.random.default_rng(3), finger.stroke_limiter
    for _ in range(count):
        q = limiter.lower + rng.uniform(0.1, 0.9, len(limiter.lower)) * (limiter.upper - limiter.lower)
        x = finger.rest_state(q, rng.normal(size=len(q)) * 0.1)
        yield x + rng.normal(size=len(x)) * 1e-2 * finger.layout.scales()
