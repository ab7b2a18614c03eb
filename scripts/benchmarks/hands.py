"""A hand of five fingers against one of them, on one core and on two."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import finger_pin as fp
from benchmarks.runs import compiled, settled
from benchmarks.store import Store
from benchmarks.timing import interleaved
from finger_pin.description.scenario import Scenario

SCENARIO = "hand"
_ROUNDS, _ROUNDS_QUICK = 7, 1


@dataclass(frozen=True)
class Times:
    """Least times of the hand and of its fingers one after the other, s."""

    hand: float
    fingers: float


def measure(store: Store) -> dict[str, Any] | None:
    """Return the times."""
    return store.part(SCENARIO, lambda: _study(0.5 if store.quick else 4.0, _ROUNDS_QUICK if store.quick else _ROUNDS))


def _study(duration: float, rounds: int) -> dict[str, Any]:
    scenario = settled(fp.load_scenario(SCENARIO), duration=duration)
    parts = scenario.parts()
    cores = sorted(os.sched_getaffinity(0))
    found = {str(count): _on(set(cores[:count]), scenario, parts, rounds) for count in (1, 2) if count <= len(cores)}
    return {
        "duration": duration,
        "joints": len(scenario.finger.joints),
        "tendons": len(scenario.finger.tendons),
        "fingers": len(parts),
        "cores": found,
    }


def _on(cores: set[int], scenario: Scenario, parts: dict[str, Scenario], rounds: int) -> dict[str, Any]:
    """Return integration and whole simulation on some cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        described = {"": scenario, **parts}
        bare = {name: compiled(each, each.simulation.method, each.simulation.rtol) for name, each in described.items()}
        whole = interleaved({name: partial(fp.simulate, each) for name, each in described.items()}, rounds + 1)
        integration = dict.fromkeys(bare, math.inf)
        for _ in range(rounds):
            for name, job in bare.items():
                integration[name] = min(integration[name], float(job()[1].wall_time))
    finally:
        os.sched_setaffinity(0, before)
    return {
        kind: asdict(Times(times[""], sum(times[name] for name in parts)))
        for kind, times in (("integration", integration), ("whole", whole))
    }
