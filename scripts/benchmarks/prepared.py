"""A prepared scenario: the cost of a run beside its integration, in processor time on one core."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.store import Store, say
from finger_pin.simulation.setup import Setup
from finger_pin.typing import Array

SCENARIOS = ("reversals", "stick_slip", "servo", "press", "hand")
#: What the prepared runs record.
RECORDED = ("joint_position", "tendon_tension")
_ROUNDS, _QUICK_ROUNDS, _SHORT = 7, 2, 0.01
_START, _REST = (0.0, 0.4, 0.5, 0.35), np.array([1.0, 1.0, 4.4, 3.1])


def measure(store: Store) -> dict[str, Any]:
    """Return the times of whole runs, of short ones, and of a simulator's steps, s."""
    rounds = _QUICK_ROUNDS if store.quick else _ROUNDS
    found = {}
    for name in SCENARIOS:
        found[name] = store.part(f"prepared-{name}", lambda name=name: _runs(name, rounds, store.quick))
    return {"runs": found, "simulator": store.part("prepared-simulator", lambda: _simulator(rounds))}


def _runs(name: str, rounds: int, quick: bool) -> dict[str, float]:
    duration = 0.2 if quick else fp.load_scenario(name).simulation.duration
    scenario = fp.load_scenario(name, {"simulation.duration": duration})
    finger = "hand.fingers.thumb.finger" if scenario.hand else "finger"
    prepared = fp.prepare(scenario, ["simulation.duration", f"{finger}.tendon_friction.viscous"], RECORDED)
    own = prepared.values[1]
    brief = prepared.scenario([_SHORT, own])
    # Another number of the finger for every run.
    numbers = (own + 1e-6 * k for k in itertools.count(1))
    times = processor_time(
        {
            "simulate": lambda: fp.simulate(scenario),
            "run": lambda: prepared.run(),
            "integration": lambda: Setup.from_scenario(scenario).integrate(),
            "load": lambda: fp.load_scenario(name),
        },
        rounds,
    )
    # What is short is dearer to time than to do.
    times |= processor_time(
        {
            "short run": lambda: prepared.run([_SHORT, own]),
            "short changed": lambda: prepared.run([_SHORT, next(numbers)]),
            "short steps": _Steps(Setup.from_scenario(brief)),
        },
        4 * rounds,
    )
    times |= processor_time({"short simulate": lambda: fp.simulate(brief)}, 2 * rounds)
    say(f"  {name}: simulate {times['simulate']:.3g} s, run {times['run']:.3g} s")
    return times


class _Steps:
    """The steps of a run alone, made again and again from its start."""

    def __init__(self, setup: Setup) -> None:
        motions = setup.integrate().islands
        self._parts = [(each.part, each) for each in motions]  # type: ignore[attr-defined]

    def __call__(self) -> None:
        for part, motion in self._parts:
            part.restart(motion.start, motion.attitude, 0.0)
            part.advance(_SHORT)


def _simulator(rounds: int) -> dict[str, Any]:
    """Return the times of a simulator's steps of 20 ms, s, and the largest error of an angle in one step, rad."""
    settings: dict[str, Any] = {"method": "Rodas4", "rtol": 1e-2, "atol_scale": 2e-2}
    steps, period, many = np.arange(100)[:, None], 0.02, 64
    pulls = {
        "held": np.tile(_REST, (len(steps), 1)),
        "varied slowly": _REST * (1.0 + 0.05 * np.sin(np.pi * period * steps + np.arange(4))),
        # At every step, as those of a policy that explores.
        "jumping": _REST * np.random.default_rng(0).uniform(0.9, 1.1, (len(steps), 4)),
    }
    sim, errors = fp.Simulator("ub_stand_in", _START, **settings), {}
    exact = fp.Simulator("ub_stand_in", _START, rtol=1e-9, atol_scale=1e-9)
    jobs: dict[str, Callable[[], Any]] = {}
    for name, tensions in pulls.items():
        apart = []
        sim.reset()
        for pull in tensions:
            exact.x = sim.x
            apart.append(sim.step(pull, period).position - exact.step(pull, period).position)
        errors[name] = float(np.max(np.abs(apart)))
        jobs[name] = partial(_episode, sim, tensions, period)
    # One that is set and reset begins with small steps again: it is another one that is stepped.
    other, x, worlds = sim.clone(), sim.x, [sim.clone() for _ in range(many)]
    jumping = itertools.cycle(pulls["jumping"])
    jobs |= {
        "set x": lambda: setattr(other, "x", x),
        "signals": other.signals,
        "reset": other.reset,
        "set_parameters": lambda: other.set_parameters({"finger.tendon_friction.coulomb": 0.12}),
    }
    times = processor_time(jobs, 20 * rounds)
    for name in pulls:
        times[name] /= len(steps)
    together = processor_time({"": lambda: fp.step_many(worlds, [next(jumping) for _ in worlds], period)}, rounds)
    times["step_many, per world"] = together[""] / many
    return {"times": times, "errors": errors}


def _episode(sim: fp.Simulator, tensions: Array, period: float) -> None:
    sim.reset()
    for pull in tensions:
        sim.step(pull, period)


def processor_time(jobs: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Return the least processor time of every job, s; the jobs take turns."""
    least = dict.fromkeys(jobs, math.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            began = time.process_time()
            job()
            least[name] = min(least[name], time.process_time() - began)
    return least


def lines(study: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the table of runs: milliseconds of processor time."""
    for name, times in study["runs"].items():
        parts = (
            "integration",
            "run",
            "simulate",
            "short steps",
            "short run",
            "short changed",
            "short simulate",
            "load",
        )
        yield (name, *(f"{1e3 * times[part]:.3g}" for part in parts))
