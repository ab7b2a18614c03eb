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
from benchmarks.timing import interleaved
from finger_pin.description.routing import Array

_PERIOD, _WORLDS, _ROUNDS = 0.02, 8, 7
# Errors are compared over so many steps: under tensions alone a finger has little stiffness, small differences grow.
_COMPARED = 20
# Time steps of MuJoCo, s, with one spring in the place of a passive tendon's mass.
_STEPS = (2e-4, 1e-4, 5e-5)
_REST = np.array([1.0, 1.0, 4.4, 3.1])
_START = (0.0, 0.4, 0.5, 0.35)


def measure(store: Store) -> dict[str, Any] | None:
    """Return times and errors; None where Gymnasium is not installed."""
    if importlib.util.find_spec("gymnasium") is None:
        return None
    return store.part("learning", lambda: _study(20 if store.quick else 100))


def pulls(count: int) -> dict[str, Array]:
    """Return tensions of control steps, shape (count, 4), N: of a policy that is done, and of one that explores."""
    steps = np.arange(count)[:, None]
    random = np.random.default_rng(0)
    return {
        "smooth": _REST * (1.0 + 0.3 * np.sin(0.1 * steps + np.arange(4))),
        "exploring": _REST * random.uniform(0.8, 1.2, (count, 4)),
    }


def _study(count: int) -> dict[str, Any]:
    from finger_pin.learning import Environment, VectorEnvironment
    from finger_pin.learning.tasks import TASKS

    task = {**TASKS["Reach-v0"](), "start": lambda random: _START, "duration": 1e9}
    alone, worlds = Environment(**task), VectorEnvironment(_WORLDS, **task)
    found: dict[str, Any] = {"steps": count, "worlds": _WORLDS, "kinds": {}}
    for kind, tensions in pulls(count).items():

        def one(given: Array = tensions) -> Array:
            alone.reset(seed=0)
            return np.array([alone.step(pull)[0][:4] for pull in given])

        def many(given: Array = tensions) -> None:
            worlds.reset(seed=0)
            for pull in given:
                worlds.step(np.tile(pull, (_WORLDS, 1)))

        jobs: dict[str, Callable[[], Any]] = {"one": one, "many": many, **_mujoco_jobs(tensions)}
        exact = _exact(tensions)
        errors = {name: rms((job() - exact)[:_COMPARED]) for name, job in jobs.items() if name != "many"}
        times = {name: took / count for name, took in interleaved(jobs, _ROUNDS).items()}
        times["many"] /= _WORLDS
        found["kinds"][kind] = {"times": times, "errors": errors}
    found["reset"] = _reset_time(task)
    return found


def _exact(tensions: Array) -> Array:
    sim = fp.Simulator("ub", _START, rtol=1e-9, atol_scale=1e-9)
    return np.array([sim.step(pull, _PERIOD).position for pull in tensions])


def _reset_time(task: Mapping[str, Any]) -> float:
    """Return the processor time of a reset that draws friction anew, s."""
    from finger_pin.learning import Environment, Uniform

    drawn = {"finger.tendon_friction.coulomb": Uniform(0.05, 0.2), "finger.joint_friction.viscous": Uniform(1e-3, 2e-3)}
    environment = Environment(**{**task, "randomise": drawn})
    took = []
    for seed in range(30):
        began = time.process_time()
        environment.reset(seed=seed)
        took.append(time.process_time() - began)
    return float(np.median(took))


def _mujoco_jobs(tensions: Array) -> dict[str, Callable[[], Array]]:
    """Return runs of the exported finger, plain and with our friction, by name."""
    if importlib.util.find_spec("mujoco") is None:
        return {}
    import mujoco

    import finger_pin.mujoco  # noqa: F401 - models with friction load only then

    def run(model: Any, each: int) -> Array:
        data, path = mujoco.MjData(model), []
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for pull in tensions:
            data.ctrl[:4] = pull
            mujoco.mj_step(model, data, each)
            path.append(data.qpos[:4].copy())
        return np.array(path)

    jobs: dict[str, Callable[[], Array]] = {}
    for friction in (False, True):
        for step in _STEPS:
            text = fp.to_mjcf(
                fp.load_finger("ub"), posture=_START, timestep=step, massless=True, shapes=False, friction=friction
            )
            model = mujoco.MjModel.from_xml_string(text)
            name = f"MuJoCo, {'our friction' if friction else 'plain'}, {1e6 * step:g} us"
            jobs[name] = partial(run, model, round(_PERIOD / step))
    return jobs


def lines(study: Mapping[str, Any]) -> Iterator[str]:
    """Yield the measurements as text."""
    from benchmarks.report import table

    yield f"control steps of {1e3 * _PERIOD:g} ms of Reach: wall time of each, rms error of the angles of {_COMPARED}"
    for kind, found in study["kinds"].items():
        names = {"one": "one world", "many": f"{study['worlds']} worlds in threads, each"}
        rows = [
            (
                names.get(name, name),
                f"{1e6 * took:.0f} us",
                f"{found['errors'][name]:.1e} rad" if name != "many" else "",
            )
            for name, took in found["times"].items()
        ]
        yield f"{kind} tensions:"
        yield from table(("", "time", "error"), rows)
        yield f"  threads: {found['times']['one'] / found['times']['many']:.2f} times the throughput of one world"
    yield f"a reset with friction drawn anew: {1e3 * study['reset']:.2f} ms of processor time"
