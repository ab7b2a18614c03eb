"""Scenarios with contact, and the part of one that MuJoCo can express."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

from validation.mujoco_motion import PRESSING

import finger_pin as fp
from benchmarks import mujoco_loop, work_precision
from benchmarks.prepared import processor_time
from benchmarks.runs import settled
from benchmarks.store import Store
from finger_pin.exceptions import AccuracyWarning
from finger_pin.simulation.setup import Setup

_LIMITS = (1e-3, 1e-5)
_STEPS = (5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5, 1e-5, 5e-6, 2.5e-6, 1.25e-6)


def measure(store: Store) -> dict[str, Any]:
    """Return times against errors, and the comparisons, of which there are none where MuJoCo is not installed."""
    scenarios = {name: work_precision.study(store, name) for name in ("press", "pinch")}
    duration, mujoco = 0.05 if store.quick else 0.5, []
    asked = [mujoco_loop.Comparison("press", PRESSING, duration, limit, ("rms",), _STEPS) for limit in _LIMITS]
    if importlib.util.find_spec("mujoco") is not None:
        mujoco = store.part("contact-mujoco", lambda: [mujoco_loop.study(each) for each in asked])
    crowded = store.part("contact-crowded", lambda: {name: _crowded(name, store.quick) for name in ("grasp", "pour")})
    return {"scenarios": scenarios, "mujoco": mujoco, "crowded": crowded}


def _crowded(name: str, quick: bool) -> dict[str, float]:
    """Return processor times of a scenario with hundreds of contacts, most of them open, at its own tolerance, s."""
    scenario = fp.load_scenario(name)
    if quick:
        scenario = settled(scenario, duration=0.05)
    ready = Setup.from_scenario(scenario)
    with warnings.catch_warnings():
        # Where ten balls go is not determined, which is said.
        warnings.simplefilter("ignore", AccuracyWarning)
        times = processor_time({"integration": ready.integrate, "whole": lambda: fp.simulate(scenario)}, 3)
    return {"duration": scenario.simulation.duration, "contacts": len(ready.loop.finger.scene.contacts.names), **times}
