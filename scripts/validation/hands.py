"""How true the primitives of meshes are: hands of other people close on a ball here and in MuJoCo, by hulls."""

from __future__ import annotations

import math
import re
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import finger_pin as fp
from finger_pin.commands.console import print_text
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.exchange.mujoco_names import entry_name
from finger_pin.simulation.simulator import Simulator
from finger_pin.typing import Array
from validation.grasps import BALL, DURATION, TIME_STEP, Hand

_LINE = re.compile(r"geom (.+): its mesh touches as an? (\w+), at most ([\d.]+) mm from its hull")
# By how much a contact gives way, mm.
_GIVES = 0.1
# Steps whose time is measured: the hand touches the ball within them.
_STEPS = 200
# What MuJoCo has not is taken away here.
_SMOOTH = {f"finger.joint_friction.{key}": 0.0 for key in ("coulomb", "stiction")}
HEAD = """\
| hand | meshes | reading, s | from hulls, mm | overlaps, there | first touch, ms, there | angles, ° | links, mm | \
gap, mm | stated, mm | step, ms, none and fit |
|---|---|---|---|---|---|---|---|---|---|---|"""


class Motion(NamedTuple):
    """A hand that has closed.

    Attributes:
        end: Its joints, by name.
        first: When the ball is first touched, s; None if it is not.
        touching: Geoms that touch it at the end.
    """

    end: dict[str, float]
    first: float | None
    touching: set[str]


def scenario_of(hand: Hand, description: Any) -> Scenario:
    """Return the scenario in which a hand closes, as its description has it."""
    table = demo_motion(description, DURATION)
    goals = {entry_name(f"{name}_servo"): {"offset": goal} for name, goal in hand.goals.items()}
    table["controller"]["inputs"] = goals
    return read_scenario(table, _SMOOTH)


def close_here(scenario: Scenario) -> Motion:
    """Return the motion of a hand as its description has it."""
    result = fp.simulate(scenario)
    pairs = [str(each) for each in result.contact.values] if "contact" in result.coords else []
    held = [k for k, each in enumerate(pairs) if BALL in each.split("-")]
    force = result.contact_normal_force.values[:, held] if held else np.zeros((len(result.time), 0))
    links = [next(iter({*pairs[k].split("-")} - {BALL})) for k in held]
    touched = force.any(axis=1)
    k = int(touched.argmax())
    first = float(result.time[k]) if touched.any() else None
    end = {str(name): float(value) for name, value in result.joint_position[-1].to_series().items()}
    return Motion(end, first, {link for link, each in zip(links, force[-1], strict=True) if each > 0.0})


def step_time(hand: Hand, description: Any) -> float:
    """Return the processor time of a step of 1 ms of a hand that closes, s; infinite if its contacts are refused."""
    try:
        simulator = Simulator.from_scenario(scenario_of(hand, description))
    except InputError:
        return math.inf
    inputs = {entry_name(f"{name}_servo"): goal for name, goal in hand.goals.items()}
    simulator.step(inputs, 1e-3)
    began = time.thread_time()
    for _ in range(_STEPS):
        simulator.step(inputs, 1e-3)
    return (time.thread_time() - began) / _STEPS


def close_in_mujoco(hand: Hand, spec: Any) -> Motion:
    """Return the motion that MuJoCo computes."""
    mujoco, model = hand.mujoco, spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for name, goal in hand.goals.items():
        data.actuator(f"{name}_servo").ctrl = goal
    first: float | None = None
    ball = model.geom(BALL).id
    for _ in range(round(DURATION / TIME_STEP)):
        mujoco.mj_step(model, data)
        first = data.time if first is None and data.ncon else first
    touching = {entry_name(model.geom(int(pair[pair != ball][0])).name) for pair in data.contact.geom}
    end = {entry_name(model.joint(i).name): float(data.qpos[model.jnt_qposadr[i]]) for i in range(model.njnt)}
    return Motion(end, first, touching)


def misses(hand: Hand, ours: Motion, theirs: Motion) -> tuple[dict[str, float], float]:
    """Return the gaps, mm, of hulls to the ball where their primitives touch, and how far such links differ, m.

    That is how far the point next to the ball, of a link that touches here or there, is from where MuJoCo has it.
    """
    model, data, line = hand.model, hand.data, np.zeros(6)
    names = {entry_name(model.geom(i).name): i for i in hand.geoms}
    places, gaps = list[dict[str, Array]](), dict[str, float]()
    near = dict[str, Array]()
    for motion in (ours, theirs):
        hand.pose(np.array([motion.end[entry_name(model.joint(i).name)] for i in range(model.njnt)]))
        places.append({})
        for name in ours.touching | theirs.touching:
            body = int(model.geom_bodyid[names[name]])
            turn, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
            if motion is ours:
                gap = hand.mujoco.mj_geomDistance(model, data, hand.ball, names[name], 0.3, line)
                near[name] = turn.T @ (line[3:] - origin)
                gaps |= {name: 1e3 * gap} if name in ours.touching else {}
            places[-1][name] = origin + turn @ near[name]
    return gaps, max((float(np.linalg.norm(places[0][name] - at)) for name, at in places[1].items()), default=0.0)


class Row(NamedTuple):
    """What a line of the table says.

    Attributes:
        text: The line.
        within: Whether the hulls of all links that touch are as near to the ball as is stated.
    """

    text: str
    within: bool


def compare(path: Path) -> Row:
    """Return the line of a model.

    Raises:
        ValueError: If MuJoCo or `from_mujoco` refuses the file, or there is no place for a ball.
    """
    hand = Hand(path)
    alone = hand.alone()
    began = time.thread_time()
    description = fp.from_mujoco(hand.model)
    reading = time.thread_time() - began
    stated = {each[1]: float(each[3]) for line in description.tree.left_out if (each := _LINE.match(line))}
    kinds = Counter(each[2] for line in description.tree.left_out if (each := _LINE.match(line)))
    overlaps = sum("they overlap where runs start" in line for line in description.tree.left_out)
    ours = close_here(scenario_of(hand, fp.from_mujoco(alone)))
    theirs = close_in_mujoco(hand, alone)
    steps = [step_time(hand, each) for each in (fp.from_mujoco(hand.model, meshes="none"), description)]
    gaps, shift = misses(hand, ours, theirs)
    most = max((abs(gap) for gap in gaps.values()), default=0.0)
    within = all(abs(gap) <= stated.get(name, 0.0) + _GIVES for name, gap in gaps.items())
    angles = [abs(ours.end[name] - theirs.end[name]) for name in ours.end if name in hand.hinges]
    times = ["none" if each.first is None else f"{1e3 * each.first:.0f}" for each in (ours, theirs)]
    shown = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    cells = (
        path.stem,
        shown,
        f"{reading:.1f}",
        f"{min(stated.values()):.1f} to {max(stated.values()):.1f}",
        f"{overlaps}, {hand.overlaps()}",
        ", ".join(times),
        f"{math.degrees(max(angles, default=0.0)):.1f}",
        f"{1e3 * shift:.1f}",
        f"{most:.2f}" if gaps else "",
        f"{max(stated.get(name, 0.0) for name in gaps):.2f}" if gaps else "",
        ", ".join("refused" if math.isinf(each) else f"{1e3 * each:.2g}" for each in steps),
    )
    return Row(f"| {' | '.join(cells)} |", within)


def print_table(folder: Path) -> bool:
    """Print a line for every model of a folder, and why others have none; return whether all are as is stated."""
    rows, refused = list[Row](), list[str]()
    print_text(HEAD)
    for path in sorted(each for each in folder.rglob("*") if each.suffix in (".xml", ".urdf")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                rows.append(compare(path))
            except ValueError as error:
                refused.append(f"{path.relative_to(folder)}: {' '.join(str(error).split())}")
                continue
        print_text(rows[-1].text)
    print_text("\n".join(refused))
    return all(row.within for row in rows)
