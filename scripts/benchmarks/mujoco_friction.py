"""What our friction costs in a step of MuJoCo: the Shadow hand of gymnasium-robotics, whose servos drive its joints."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.store import Store

_TENDONS = {"*": {"coulomb": 0.12}}
#: What is added, by name; nothing first.
_VARIANTS: dict[str, dict[str, Any] | None] = {
    "plain": None,
    "tendons": {"tendons": _TENDONS},
    "tendons and joints": {"tendons": _TENDONS, "joints": {"*": {}}},
}


def measure(store: Store) -> dict[str, Any] | None:
    """Return processor times of a step, s; None where MuJoCo or the hand is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("mujoco", "gymnasium_robotics")):
        return None
    rounds, steps = (2, 200) if store.quick else (30, 2000)
    return store.part("mujoco-friction", lambda: study(rounds, steps))


def study(rounds: int, steps: int) -> dict[str, Any]:
    """Return the least time of a step of each variant, which take turns, and how many frictions and rows it has."""
    import mujoco

    spec = importlib.util.find_spec("gymnasium_robotics")
    assert spec is not None and spec.submodule_search_locations is not None
    path = Path(spec.submodule_search_locations[0], "envs", "assets", "hand", "reach.xml")
    models, counts = {}, {}
    for name, friction in _VARIANTS.items():
        made = mujoco.MjSpec.from_file(str(path))
        if friction is not None:
            fp.mujoco.add_friction(made, **friction)
        models[name] = model = made.compile()
        rows = int(np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.tendon_frictionloss))
        frictions = 0 if friction is None else len(fp.mujoco.friction(model, mujoco.MjData(model)).names)
        counts[name] = {"frictions": frictions, "rows": rows}
    least = dict.fromkeys(models, np.inf)
    for _ in range(rounds):
        for name, model in models.items():
            data = mujoco.MjData(model)
            low, high = model.actuator_ctrlrange.T
            data.ctrl[:] = low + 0.4 * (high - low)
            mujoco.mj_step(model, data, 200)
            began = time.process_time()
            mujoco.mj_step(model, data, steps)
            least[name] = min(least[name], (time.process_time() - began) / steps)
    return {
        "version": mujoco.__version__,
        "time": {name: float(each) for name, each in least.items()},
        "counts": counts,
    }


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report."""
    yield f"our friction in a step of MuJoCo {found['version']}, Shadow hand: processor time"
    plain = found["time"]["plain"]
    for name, each in found["time"].items():
        count = found["counts"][name]
        added = f"{100.0 * (each / plain - 1.0):+.0f} %, {count['frictions']} frictions" if count["frictions"] else ""
        yield f"  {name:20} {1e6 * each:6.1f} us  {count['rows']:3d} rows  {added}".rstrip()
