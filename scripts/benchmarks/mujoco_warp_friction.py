"""The cost of our friction in a step of MuJoCo Warp, on the Shadow hand, in as many worlds as a policy is trained in.

Steps run as captured graphs on Warp's preferred device, a GPU where there is one. Every world's controls are its own
and jump ten times a second; variants take turns, and the median of each is compared.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.mujoco_friction import LAW, PLAIN, driven, shadow
from benchmarks.store import Store
from benchmarks.timing import clocked

_ROWS, _CONTACTS = 200, 60


def measure(store: Store) -> dict[str, Any] | None:
    """Return wall times of a step of all worlds, s; None where MuJoCo Warp or the Shadow hand is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("mujoco_warp", "gymnasium_robotics")):
        return None
    worlds, rounds, jumps = ((4,), 1, 1) if store.quick else ((256, 1024), 5, 1)
    return store.part("mujoco-warp-friction", lambda: study(worlds, rounds, jumps))


def study(worlds: tuple[int, ...], rounds: int, jumps: int) -> dict[str, Any]:
    """Return the median time of a step of each variant, by number of worlds, and how many frictions it has."""
    import mujoco_warp
    import warp

    device, model = warp.get_preferred_device(), shadow().compile()
    every: dict[str, Any] = {"tendons": {"*": LAW}}
    variants = {PLAIN: {}, "driven tendons": {"tendons": {name: LAW for name in driven(model)}}}
    variants |= {"all tendons": every, "and all joints": every | {"joints": {"*": {}}}}
    times, counts = {}, {}
    for many in worlds:
        found: dict[str, list[float]] = {name: [] for name in variants}
        with warp.ScopedDevice(device):
            made = {name: _stepping(model, many, friction) for name, friction in variants.items()}
            for _ in range(rounds):
                for name, (step, counts[name]) in made.items():
                    found[name].append(step(jumps))
        times[str(many)] = {name: float(np.median(each)) for name, each in found.items()}
    return {"version": mujoco_warp.__version__, "device": device.name, "times": times, "frictions": counts}


def _stepping(model: Any, worlds: int, friction: dict[str, Any]) -> tuple[Callable[[int], float], int]:
    """Return a function that steps for so many jumps of the controls and gives the time of a step, and frictions."""
    import mujoco_warp
    import warp

    m = mujoco_warp.put_model(model)
    d = mujoco_warp.make_data(model, nworld=worlds, njmax=_ROWS, nconmax=_CONTACTS)
    count = len(fp.mujoco.warp.add_friction(m, d, model, **friction).names) if friction else 0
    random, (low, high) = np.random.default_rng(1), model.actuator_ctrlrange.T
    # Loading of kernels does not belong to a capture on a GPU.
    mujoco_warp.step(m, d)
    with warp.ScopedCapture() as capture:
        mujoco_warp.step(m, d)
    every = round(0.1 / model.opt.timestep)

    def steps(jumps: int) -> float:
        took = 0.0
        for _ in range(jumps):
            controls = low + random.uniform(0.2, 0.6, (worlds, len(low))) * (high - low)
            d.ctrl.assign(controls.astype(np.float32))
            took += clocked(launch)[0]
        return took / (jumps * every)

    def launch(captured: tuple[Any, ...] = (m, d)) -> None:
        # A graph keeps addresses alone: what it was captured of has to live as long as it.
        for _ in range(every):
            warp.capture_launch(capture.graph)
        warp.synchronize()

    return steps, count


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report."""
    for worlds, times in found["times"].items():
        yield f"our friction in a step of MuJoCo Warp {found['version']}, Shadow hand"
        yield f"({worlds} worlds on {found['device']})"
        for name, each in times.items():
            more = f"{100.0 * (each / times[PLAIN] - 1.0):+.0f} %, {found['frictions'][name]} frictions"
            yield f"  {name:16} {1e3 * each:8.2f} ms  {more if name != PLAIN else ''}".rstrip()
