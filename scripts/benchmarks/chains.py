"""Cost against the number of joints, on generated chains with one tendon more than joints."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.runs import compiled
from benchmarks.store import Store, say
from benchmarks.timing import interleaved
from finger_pin.control.closed_loop import ClosedLoop

_MOST = 8
_RTOL = 1e-5
_ROUNDS = 5


def measure(store: Store) -> dict[str, Any]:
    """Return the costs."""
    return store.part("joints", lambda: _study(3 if store.quick else _MOST, 0.3 if store.quick else 2.0))


def chain(joints: int, duration: float) -> fp.Scenario:
    """Return a planar chain under gravity with a flexor for every joint and one extensor, swinging at 0.5 Hz.

    Every flexor winds around its own joint and, on a small radius, around those before it. The extensor balances them
    at equal tensions. Links shrink by a tenth from one to the next.
    """
    names = [f"joint{index}" for index in range(1, joints + 1)]
    shrink = [0.9**index for index in range(joints)]
    links = [{"length": 0.04 * s, "width": 0.016 * s, "mass": 0.01 * s**3} for s in shrink]
    tendons: dict[str, Any] = {}
    for index, name in enumerate(names):
        crossings = {before: {"radius": 0.001, "bends": True} for before in names[:index]}
        tendons[f"flexor{index + 1}"] = {"curvature_offset": 0.4, "crossings": {**crossings, name: {"radius": 0.006}}}
    extensor = {name: {"radius": -0.006 - 0.001 * (joints - 1 - i), "bends": True} for i, name in enumerate(names)}
    tendons["extensor"] = {"curvature_offset": 0.4, "crossings": extensor}
    swing = {"offset": 0.4, "amplitude": -0.2, "frequency": 0.5, "phase": math.pi / 2}
    return fp.Scenario.model_validate(
        {
            "name": f"chain{joints}",
            "finger": {
                "name": f"chain{joints}",
                "gravity": [0.0, -9.81, 0.0],
                "joints": {n: {"range": [-1.0, 1.5], "link": link} for n, link in zip(names, links, strict=True)},
                "tendons": tendons,
            },
            "controller": {"gain": 1.0, "minimum_tension": 1.0},
            "reference": {"joints": dict.fromkeys(names, swing)},
            "simulation": {"duration": duration, "sample_rate": 1000.0},
        }
    )


def _study(most: int, duration: float) -> dict[str, Any]:
    counts = range(1, most + 1)
    scenarios = {n: chain(n, duration) for n in counts}
    jobs = {str(n): compiled(scenario, "Rodas5P", _RTOL) for n, scenario in scenarios.items()}
    statistics = {name: job()[1] for name, job in jobs.items()}
    times = interleaved(jobs, _ROUNDS)
    rows = []
    for n in counts:
        cost, counted = times[str(n)], statistics[str(n)]
        rows.append(
            {
                "joints": n,
                "states": ClosedLoop.from_scenario(scenarios[n]).finger.layout.size,
                "wall_time": cost,
                "real_time_factor": duration / cost,
                "steps": counted.steps,
                "time_per_step": cost / counted.steps,
                "time_per_textbook_evaluation": _evaluation(scenarios[n]),
            }
        )
        say(f"  {n} joints: {1e6 * rows[-1]['time_per_step']:.1f} us per step")
    # In the upper half, where what is the same for all no longer hides the growth.
    upper = rows[len(rows) // 2 :]
    slope = np.polyfit(np.log([r["joints"] for r in upper]), np.log([r["time_per_step"] for r in upper]), 1)[0]
    return {"duration": duration, "rtol": _RTOL, "rows": rows, "exponent": float(slope)}


def _evaluation(scenario: fp.Scenario) -> float:
    """Return the least time of one evaluation of the NumPy right-hand side, s."""
    loop = ClosedLoop.from_scenario(scenario)
    x, least = loop.initial_state(), math.inf
    for _ in range(200):
        began = time.perf_counter()
        loop.rhs(0.1, x)
        least = min(least, time.perf_counter() - began)
    return least
