"""Scenarios with contact, and the part of one that MuJoCo can express."""

from __future__ import annotations

import importlib.util
from typing import Any

from validation.mujoco_motion import PRESSING

from benchmarks import mujoco_loop, work_precision
from benchmarks.store import Store

_LIMITS = (1e-3, 1e-5)
_STEPS = (5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5, 1e-5, 5e-6, 2.5e-6, 1.25e-6)


def measure(store: Store) -> dict[str, Any]:
    """Return times against errors, and the comparisons, of which there are none where MuJoCo is not installed."""
    scenarios = {name: work_precision.study(store, name) for name in ("press", "pinch")}
    duration, mujoco = 0.05 if store.quick else 0.5, []
    asked = [mujoco_loop.Comparison("press", PRESSING, duration, limit, ("rms",), _STEPS) for limit in _LIMITS]
    if importlib.util.find_spec("mujoco") is not None:
        mujoco = store.part("contact-mujoco", lambda: [mujoco_loop.study(each) for each in asked])
    return {"scenarios": scenarios, "mujoco": mujoco}
