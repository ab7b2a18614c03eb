"""Control steps of Reach: one world, worlds in threads, and the same finger under the same tensions in MuJoCo."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.runs import rms
from benchmarks.store import Store
from benchmarks.text_tables import table
from benchmarks.timing import interleaved
from finger_pin.typing import Array

_PERIOD, _WORLDS, _ROUNDS = 0.02, 8, 7
# Errors are of so many episodes of so many steps: under tensions alone a finger has little stiffness, small differences
# grow. MuJoCo's are of the first, which ends at no joint's stop: there the exported finger bounces.
_EPISODES, _COMPARED = 8, 20
# Time steps of MuJoCo, s, with one spring in the place of a passive tendon's mass.
_STEPS = (2e-4, 1e-4, 5e-5)
_REST = np.array([1.0, 1.0, 4.4, 3.1])
_START = (0.0, 0.4, 0.5, 0.35)


def measure(store: Store) -> dict[str, Any] | None:
    """Return times and errors; None where Gymnasium is not installed."""
    if importlib.util.find_spec("gymnasium") is None:
        return None
    return store.part("learning", lambda: _study(20 if store.quick else 100))


def pulls(kind: str, count: int, seed: int = 0) -> Array:
    """Return tensions of control steps, shape (count, 4), N: of a policy that is done, or of one that explores."""
    steps, random = np.arange(count)[:, None], np.random.default_rng(seed)
    if kind == "smooth":
        phases = random.uniform(0.0, 2.0 * np.pi, 4) if seed else np.arange(4)
        return _REST * (1.0 + 0.3 * np.sin(0.1 * steps + phases))
    return _REST * random.uniform(0.8, 1.2, (count, 4))


def _study(count: int) -> dict[str, Any]:
    from finger_pin.learning import Environment, VectorEnvironment
    from finger_pin.learning.tasks import TASKS

    task = {**TASKS["Reach-v0"](), "start": lambda random: _START, "duration": 1e9}
    alone, worlds = Environment(**task), VectorEnvironment(_WORLDS, **task)

    def one(tensions: Array) -> Array:
        alone.reset(seed=0)
        return np.array([alone.step(pull)[0][:4] for pull in tensions])

    def many(tensions: Array) -> None:
        worlds.reset(seed=0)
        for pull in tensions:
            worlds.step(np.tile(pull, (_WORLDS, 1)))

    runs: dict[str, Callable[[Array], Array]] = {"one": one, **_mujoco_runs()}
    found: dict[str, Any] = {"steps": count, "worlds": _WORLDS, "kinds": {}}
    for kind in ("smooth", "exploring"):
        episodes = [pulls(kind, _COMPARED, seed) for seed in range(_EPISODES)]
        exact = np.array([_exact(tensions) for tensions in episodes])
        errors = {name: rms(run(episodes[0]) - exact[0]) for name, run in runs.items()}
        errors["one"] = rms(np.array([one(tensions) for tensions in episodes]) - exact)
        jobs: dict[str, Callable[[], Any]] = {
            name: partial(run, pulls(kind, count)) for name, run in {**runs, "many": many}.items()
        }
        jobs["begin"] = partial(alone.reset, seed=0)
        times = {name: took / count for name, took in interleaved(jobs, _ROUNDS).items()}
        times["many"] /= _WORLDS
        times["alone"] = times["one"] - times.pop("begin")
        found["kinds"][kind] = {"times": times, "errors": errors}
    found["reset"] = {name.removesuffix("-v0"): _reset_time(make()) for name, make in TASKS.items()}
    return found


def _exact(tensions: Array) -> Array:
    sim = fp.Simulator("ub_stand_in", _START, rtol=1e-9, atol_scale=1e-9)
    return np.array([sim.step(pull, _PERIOD).position for pull in tensions])


def _reset_time(task: Mapping[str, Any]) -> float:
    """Return the processor time of a reset that draws friction anew, besides the task's own draws, s."""
    from finger_pin.learning import Environment, Uniform

    names = ["finger"] if task["scenario"].hand is None else ["hand.fingers.left.finger", "hand.fingers.right.finger"]
    drawn = {f"{name}.tendon_friction.viscous": Uniform(0.5, 1.5) for name in names}
    environment = Environment(**{**task, "randomise": {**task.get("randomise", {}), **drawn}})
    took = []
    for seed in range(30):
        began = time.process_time()
        environment.reset(seed=seed)
        took.append(time.process_time() - began)
    return min(took)


def _mujoco_runs() -> dict[str, Callable[[Array], Array]]:
    """Return runs of the exported finger, plain and with our friction, by name."""
    if importlib.util.find_spec("mujoco") is None:
        return {}
    import mujoco

    import finger_pin.mujoco  # noqa: F401 - models with friction load only then

    def run(model: Any, each: int, tensions: Array) -> Array:
        data, path = mujoco.MjData(model), []
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for pull in tensions:
            data.ctrl[:4] = pull
            mujoco.mj_step(model, data, each)
            path.append(data.qpos[:4].copy())
        return np.array(path)

    runs: dict[str, Callable[[Array], Array]] = {}
    for friction in (False, True):
        for step in _STEPS:
            text = fp.to_mjcf(
                fp.load_finger("ub_stand_in"),
                posture=_START,
                timestep=step,
                massless=True,
                shapes=False,
                friction=friction,
            )
            model = mujoco.MjModel.from_xml_string(text)
            name = f"MuJoCo, {'our friction' if friction else 'plain'}, {1e6 * step:g} us"
            runs[name] = partial(run, model, round(_PERIOD / step))
    return runs


def lines(study: Mapping[str, Any]) -> Iterator[str]:
    """Yield the measurements as text."""
    yield f"control steps of {1e3 * _PERIOD:g} ms of Reach: wall time of each, rms error of the angles"
    for kind, found in study["kinds"].items():
        names = {
            "one": "one world, with its episodes' begins",
            "alone": "one world, its steps alone",
            "many": f"{study['worlds']} worlds in threads, each, with begins",
        }
        rows = [
            (
                names.get(name, name),
                f"{1e6 * took:.0f} us",
                f"{found['errors'][name]:.1e} rad" if name in found["errors"] else "",
            )
            for name, took in found["times"].items()
        ]
        yield f"{kind} tensions:"
        yield from table(("", "time", "error"), rows)
        yield f"  threads: {found['times']['one'] / found['times']['many']:.2f} times the throughput of one world"
    each = ", ".join(f"{name} {1e3 * took:.2f} ms" for name, took in study["reset"].items())
    yield f"a reset with friction drawn anew, processor time: {each}"
