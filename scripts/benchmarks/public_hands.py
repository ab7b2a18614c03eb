"""Cost of steps, memory and time at equal error of two hands of gymnasium-robotics, beside MuJoCo.

Every actuator goes to and fro. MuJoCo's time steps in the table of costs are those of the files. Nothing touches in the
motions in which errors are compared: Adroit's hammer falls on the table after 46 ms.
"""

from __future__ import annotations

import importlib.util
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.equal_error import PERIOD, RTOL, equal_error, simulated, sizes, stepped
from benchmarks.store import say
from benchmarks.timing import interleaved
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.exceptions import LeftOutWarning
from finger_pin.exchange.mujoco_names import entry_name
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

PACKAGE = "gymnasium_robotics"
#: Files, and the longest motions in which errors are compared, s.
HANDS = {"Shadow": ("hand/reach.xml", 0.2), "Adroit and hammer": ("adroit_hand/adroit_hammer.xml", 0.04)}
# MuJoCo's time step, s, and integrator in both files.
_IN_FILES = 2e-3, "Euler"
_ROUNDS = 3
#: Of a control step, s.
CONTROL = 0.02


def installed() -> bool:
    """Return whether the hands are there."""
    return importlib.util.find_spec(PACKAGE) is not None


def path_of(name: str) -> Path:
    """Return the file of a hand."""
    spec = importlib.util.find_spec(PACKAGE)
    assert spec is not None and spec.submodule_search_locations is not None
    return Path(spec.submodule_search_locations[0], "envs", "assets", HANDS[name][0])


def scenario(name: str, friction: Mapping[str, Any], settings: Mapping[str, Any]) -> fp.Scenario:
    """Return the motion of a hand under a friction, with settings of the simulation by dotted key."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftOutWarning)
        description = fp.from_mujoco(path_of(name)).updated(**friction)
    return read_scenario(demo_motion(description), dict(settings))


def compared(name: str, friction: Mapping[str, Any], duration: float) -> fp.Scenario:
    """Return the motion of a hand at the tolerance and for the samples at which it is compared with MuJoCo's."""
    settings = {"duration": duration, "sample_rate": 1.0 / PERIOD, "rtol": RTOL}
    return scenario(name, friction, {f"simulation.{key}": value for key, value in settings.items()})


def in_mujoco(name: str, motion: fp.Scenario, duration: float, step: float, integrator: str) -> Callable[[], Array]:
    """Return a job of MuJoCo's steps under the commands of a motion, from its posture on."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path_of(name)))
    position, given = motion.simulation.initial.position, motion.controller.inputs
    start = np.array([position[entry_name(model.joint(i).name)] for i in range(model.njnt)])
    signal = Signal.from_settings([given[entry_name(model.actuator(i).name)] for i in range(model.nu)])
    return stepped(model, start, lambda times: signal.at(times)[0], duration, step, integrator)


def rows(duration: float, frictions: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield time and steps for a second of motion, times of a step, s, and bytes of the whole."""
    for name in HANDS:
        motions = {friction: compared(name, keys, duration) for friction, keys in frictions.items()}
        spent: dict[str, list[tuple[float, int]]] = {friction: [] for friction in motions}
        jobs = {friction: simulated(motion, spent[friction]) for friction, motion in motions.items()}
        jobs["mujoco"] = in_mujoco(name, motions["none"], duration, *_IN_FILES)
        times = interleaved(jobs, _ROUNDS)
        for friction, each in spent.items():
            (inside, steps), row = min(each), {"links": name, "friction": friction, "motion": duration}
            row |= {"whole": times[friction] / duration, "steps": steps / duration, "step": inside / steps}
            yield row | {"mujoco": times["mujoco"] * _IN_FILES[0] / duration} | sizes(motions[friction])
        say(f"  {name}: {1e6 * row['step']:.1f} us per step without friction")


def at_equal_error(quick: bool, frictions: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield times at equal error, by MuJoCo's integrator in the file."""
    for name, (_, longest) in HANDS.items():
        duration = 0.01 if quick else longest
        for friction, keys in frictions.items():
            motion = compared(name, keys, duration)
            for row in equal_error(motion, partial(in_mujoco, name, motion, duration), (_IN_FILES[1],), quick):
                yield {"name": name, "friction": friction, "motion": duration} | row


def control_steps(quick: bool, frictions: Mapping[str, Any]) -> dict[str, float]:
    """Return the median processor time of a control step of Shadow by friction, s, at the tolerances of learning.

    Goals of all servos are drawn anew, uniformly within their ranges, at every step.
    """
    from finger_pin.learning import Environment
    from finger_pin.learning.tasks import COARSE_TOLERANCES

    warm, count = (1, 2) if quick else (10, 50)
    took = {}
    for friction, keys in frictions.items():
        motion = scenario("Shadow", keys, COARSE_TOLERANCES)
        environment = Environment(
            motion,
            reward=lambda signals: -abs(signals["joint_velocity"]).sum(axis=-1),
            observation=["joint_position", "joint_velocity"],
            period=CONTROL,
            duration=CONTROL * (warm + count),
        )
        environment.reset(seed=0)
        environment.action_space.seed(0)
        times = []
        for _ in range(warm + count):
            action, began = environment.action_space.sample(), time.process_time()
            environment.step(action)
            times.append(time.process_time() - began)
        took[friction] = float(np.median(times[warm:]))
    return took
