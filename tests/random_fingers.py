"""Random fingers with links, and the table of their features; numbers go over decades."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Table = dict[str, Any]
#: What adds a feature to a table, and says whether there was a place for it.
Feature = Callable[[np.random.Generator, Table], bool]


def decades(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number of any order of magnitude between two."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def direction(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    """Return a unit vector, or with four numbers the quaternion of any rotation."""
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


def swing(rng: np.random.Generator, low: float, high: float) -> dict[str, float]:
    """Return a signal that rests at a number; the feature of swinging inputs makes it a sinusoid."""
    return {"offset": float(rng.uniform(low, high))}


def some(rng: np.random.Generator, values: Any) -> list[Any]:
    """Return some values, at least one, in their order."""
    values = list(values)
    chosen = rng.random(len(values)) < 0.5
    chosen[rng.integers(len(values))] = True
    return [value for value, is_chosen in zip(values, chosen, strict=True) if is_chosen]


def chain(rng: np.random.Generator) -> Table:
    """Return a finger of 1 to 4 joints; tendon i pulls joints 0 to i, and one more pulls back at all: force closure."""
    joints = {}
    for k in range(int(rng.integers(1, 5))):
        low, high = -rng.uniform(0.2, 0.8), rng.uniform(0.5, 1.5)
        link = {"length": float(rng.uniform(0.02, 0.05)), "width": float(rng.uniform(0.008, 0.016))}
        joints[f"joint_{k}"] = {"range": [low, high], "link": link | {"mass": decades(rng, 1e-3, 3e-2)}}
    rows = np.tril(rng.uniform(4e-3, 9e-3, (len(joints), len(joints))))
    # Minus a positive combination of the others balances them.
    rows = np.vstack([rows, -rng.uniform(0.5, 1.0, len(joints)) @ rows / len(joints)])
    tendons = {}
    for k, row in enumerate(rows):
        crossings = {
            name: {"radius": float(r), "bends": bool(rng.random() < 0.6)}
            for name, r in zip(joints, row, strict=True)
            if r
        }
        tendons[f"T{k}"] = {"curvature_offset": float(rng.uniform(0.0, 1.5)), "crossings": crossings}
    gravity = 9.81 * direction(rng)
    return {"name": "random", "gravity": gravity.tolist(), "joints": joints, "tendons": tendons}


def twists_and_offsets(rng: np.random.Generator, table: Table) -> bool:
    for joint in table["finger"]["joints"].values():
        joint["link"] |= {"twist": float(rng.uniform(-1.6, 1.6)), "offset": float(rng.normal(0.0, 5e-3))}
    return True


def uneven_links(rng: np.random.Generator, table: Table) -> bool:
    """Give links mass centres and inertias of their own."""
    for joint in some(rng, table["finger"]["joints"].values()):
        link, inertia = joint["link"], joint["link"]["mass"] * decades(rng, 1e-5, 1e-3)
        link |= {"centre_of_mass": float(rng.uniform(-0.2, 1.2) * link["length"]), "transverse_inertia": inertia}
        link |= {"axial_inertia": float(inertia * rng.uniform(0.2, 1.9))}
        link["section"] = str(rng.choice(["round", "square"]))
    return True


def springs(rng: np.random.Generator, table: Table) -> bool:
    for joint in some(rng, table["finger"]["joints"].values()):
        rest = float(rng.uniform(-1.0, 1.0))
        joint["spring"] = {"stiffness": decades(rng, 1e-3, 1.0), "rest": rest, "damping": decades(rng, 1e-5, 1e-2)}
    return True


def spring_hysteresis(rng: np.random.Generator, table: Table) -> bool:
    sprung = [joint["spring"] for joint in table["finger"]["joints"].values() if "spring" in joint]
    for spring in sprung:
        spring["hysteresis"] = float(rng.uniform(0.05, 0.5))
    return bool(sprung)


def joint_friction(rng: np.random.Generator, table: Table) -> bool:
    """Choose a law of the joints and its numbers."""
    law = str(rng.choice(["lugre", "dahl", "coulomb"]))
    coulomb = decades(rng, 1e-5, 3e-3)
    numbers = {"law": law, "coulomb": coulomb, "viscous": decades(rng, 1e-6, 1e-2)}
    if law == "lugre":
        numbers |= {"stiction": coulomb * float(rng.uniform(1.0, 2.0)), "stribeck_velocity": decades(rng, 1e-2, 1.0)}
        numbers["stribeck_exponent"] = int(rng.integers(1, 3))
    if law == "coulomb":
        numbers["reversal_speed"] = decades(rng, 1e-2, 1.0)
    elif rng.random() < 0.5:
        numbers["stiffness"] = decades(rng, 0.5, 50.0)
    if law == "lugre" and rng.random() < 0.5:
        numbers["micro_damping"] = decades(rng, 1e-5, 1e-2)
    table["finger"]["joint_friction"] = table["finger"].get("joint_friction", {}) | numbers
    return True


def joint_drag(rng: np.random.Generator, table: Table) -> bool:
    drag = {"drag": decades(rng, 1e-4, 1e-2), "drag_asymmetry": float(rng.uniform(-0.8, 0.8))}
    table["finger"]["joint_friction"] = table["finger"].get("joint_friction", {}) | drag
    return True


def one_per_joint(rng: np.random.Generator, table: Table) -> bool:
    """Write the drag of the joints one by one."""
    drag = [decades(rng, 1e-4, 1e-2) for _ in table["finger"]["joints"]]
    if len(drag) > 1:
        table["finger"]["joint_friction"] = table["finger"].get("joint_friction", {}) | {"drag": drag}
    return len(drag) > 1


def tendon_friction(rng: np.random.Generator, table: Table) -> bool:
    numbers = {"coulomb": decades(rng, 1e-2, 0.5), "stiction_ratio": float(rng.uniform(1.0, 2.0))}
    numbers |= {"viscous": decades(rng, 1e-2, 10.0), "stribeck_velocity": decades(rng, 1e-3, 0.1)}
    if rng.random() < 0.5:
        numbers |= {"drag": decades(rng, 1e-3, 0.5), "stribeck_exponent": 2}
    if rng.random() < 0.5:
        numbers |= {"stiffness": decades(rng, 1e4, 1e6), "micro_damping": decades(rng, 1e-2, 3.0)}
    return _of_cords(table["finger"], numbers)


def at_bends(rng: np.random.Generator, table: Table) -> bool:
    return _of_cords(table["finger"], {"place": "bends"})


def _of_cords(finger: Table, numbers: Table) -> bool:
    """Add to the friction of cords where there is one."""
    cords = {*finger["tendons"], *finger.get("tree", {}).get("tendons", {})} - {"sum"}
    if cords:
        finger["tendon_friction"] = finger.get("tendon_friction", {}) | numbers
    return bool(cords)


def _free_tendons(table: Table) -> list[str]:
    """Return the tendons that nothing but an ideal source pulls."""
    taken = {name for each in table["finger"].get("actuators", {}).values() for name in each["tendons"]}
    tendons = table["finger"]["tendons"].items()
    return [name for name, each in tendons if name not in taken and not {"winch", "kind", "maximum_tension"} & {*each}]


def _motor(rng: np.random.Generator) -> Table:
    friction = {"coulomb": decades(rng, 1e-3, 2e-2), "by_load": float(rng.uniform(0.0, 0.3))}
    friction |= {"stribeck": decades(rng, 1e-4, 1e-2), "stribeck_by_load": float(rng.uniform(0.0, 0.1))}
    friction |= {"viscous": decades(rng, 1e-4, 1e-2)}
    motor = {
        "voltage": 6.0,
        "torque_constant": float(rng.uniform(0.2, 0.6)),
        "resistance": float(rng.uniform(2.0, 6.0)),
    }
    motor |= {"maximum_current": 1.5, "inertia": decades(rng, 1e-4, 3e-3), "friction": friction}
    return motor | {"encoder": {"range": [-1000.0, 1000.0], "resolution": 1.5e-3 * bool(rng.random() < 0.5)}}


def _servo(rng: np.random.Generator, table: Table, name: str, motor: Table, **more: Any) -> bool:
    free = _free_tendons(table)
    if not free:
        return False
    tendon = str(rng.choice(free))
    servo = {"motor": motor, "tendons": [tendon], "spool_radius": float(rng.uniform(4e-3, 1e-2))}
    servo |= {"tendon_length": float(rng.uniform(0.05, 0.4)), "pretension": float(rng.uniform(0.0, 5.0))}
    servo["tendon_hysteresis"] = float(rng.uniform(0.0, 0.3) * (rng.random() < 0.5))
    table["finger"].setdefault("actuators", {})[name] = servo | more
    if "drive" in more:
        table["controller"]["tensions"].pop(tendon)
        table["controller"].setdefault("spool_angle", {})[name] = swing(rng, 0.0, 0.5)
    return True


def servo(rng: np.random.Generator, table: Table) -> bool:
    """Let a servo pull a tendon with its commanded tension."""
    return _servo(rng, table, "servo", _motor(rng))


def play(rng: np.random.Generator, table: Table) -> bool:
    """Let a servo whose gears have play pull a tendon."""
    motor = _motor(rng)
    motor["friction"]["backlash"] = float(rng.uniform(5e-3, 5e-2))
    return _servo(rng, table, "loose", motor)


def position_drive(rng: np.random.Generator, table: Table) -> bool:
    """Let a servo turn its spool to an angle."""
    loop = {"proportional": decades(rng, 1.0, 10.0), "derivative": decades(rng, 1e-3, 1e-1)}
    return _servo(rng, table, "drive", _motor(rng), drive="position", position_loop=loop | {"integral": 0.5})


def cogging(rng: np.random.Generator, table: Table) -> bool:
    """Give the motors magnets that hold on to teeth."""
    motors = [each["motor"] for each in table["finger"].get("actuators", {}).values()]
    for motor in motors:
        numbers = {"amplitude": decades(rng, 1e-4, 1e-1), "per_turn": decades(rng, 3.0, 1e3)}
        motor["cogging"] = numbers | {"phase": float(rng.uniform(-3.0, 3.0))}
    return bool(motors)


def winch(rng: np.random.Generator, table: Table) -> bool:
    """Let an ideal winch wind in a tendon."""
    free = _free_tendons(table)
    if free:
        tendon = str(rng.choice(free))
        table["finger"]["tendons"][tendon]["winch"] = {"stiffness": decades(rng, 1e3, 1e5)}
        table["controller"]["tensions"].pop(tendon)
        table["controller"].setdefault("tendon_winding", {})[tendon] = swing(rng, 0.0, 1e-3)
    return bool(free)


def maximum_tension(rng: np.random.Generator, table: Table) -> bool:
    free = _free_tendons(table)
    if free:
        table["finger"]["tendons"][str(rng.choice(free))]["maximum_tension"] = float(rng.uniform(1.0, 4.0))
    return bool(free)


def coupled_tendons(rng: np.random.Generator, table: Table) -> bool:
    """Let an actuated tendon follow another, whoever pulls them."""
    names = [name for name, each in table["finger"]["tendons"].items() if each.get("kind") != "passive"]
    if len(names) < 2:
        return False
    one, other = (str(name) for name in rng.choice(names, 2, replace=False))
    bar = {"tendon": one, "other": other, "ratio": float(rng.normal()), "offset": float(rng.normal(0.0, 5e-4))}
    bar |= {"stiffness": decades(rng, 1e2, 1e4), "damping": decades(rng, 0.1, 10.0)}
    table["finger"]["couplings"] = {"pair": bar}
    return True


def passive_tendon(rng: np.random.Generator, table: Table) -> bool:
    """Couple the last two joints by a passive tendon."""
    names = list(table["finger"]["joints"])
    if len(names) < 2:
        return False
    crossings = {names[-2]: {"radius": -4e-3}, names[-1]: {"radius": float(rng.uniform(3e-3, 6e-3)), "bends": True}}
    table["finger"]["tendons"]["passive"] = {"kind": "passive", "crossings": crossings, "curvature_offset": 0.5}
    table["finger"]["passive_tendon"] = {"stiffness": decades(rng, 1e3, 5e4), "mass": decades(rng, 1e-5, 1e-3)}
    table["finger"]["passive_tendon"]["hysteresis"] = float(rng.uniform(0.0, 0.3) * (rng.random() < 0.5))
    table["finger"]["passive_tendon"]["slack"] = float(rng.uniform(-5e-4, 5e-4) * (rng.random() < 0.5))
    return True


def unlimited_joints(rng: np.random.Generator, table: Table) -> bool:
    for joint in some(rng, table["finger"]["joints"].values()):
        joint["limited"] = False
    return True


def stroke_limiter(rng: np.random.Generator, table: Table) -> bool:
    limited = any(joint.get("limited", True) for joint in table["finger"]["joints"].values())
    if limited:
        numbers = {"stiffness": decades(rng, 1.0, 100.0), "damping": decades(rng, 1e-2, 2.0)}
        table["finger"]["stroke_limiter"] = numbers | {"viscous": decades(rng, 1e-5, 1e-2)}
    return limited


#: Features that fingers with links and trees share.
SHARED_FEATURES: dict[str, Feature] = {
    "springs": springs,
    "spring hysteresis": spring_hysteresis,
    "joint friction": joint_friction,
    "joint drag": joint_drag,
    "one per joint": one_per_joint,
    "tendon friction": tendon_friction,
    "at bends": at_bends,
    "maximum tension": maximum_tension,
    "servo": servo,
    "play": play,
    "position drive": position_drive,
    "winch": winch,
    "unlimited joints": unlimited_joints,
    "stroke limiter": stroke_limiter,
}
#: Features of fingers with links.
CHAIN_FEATURES: dict[str, Feature] = {
    "twists and offsets": twists_and_offsets,
    "uneven links": uneven_links,
    "passive tendon": passive_tendon,
    "coupled tendons": coupled_tendons,
} | SHARED_FEATURES
