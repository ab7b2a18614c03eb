"""Times at equal error of our runs and of MuJoCo's steps, each against its own finest run of the same model."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.runs import settled
from benchmarks.store import say
from benchmarks.text_tables import table
from benchmarks.timing import interleaved
from finger_pin.typing import Array

# Of our runs, of their finest one in both kinds of tolerance, and s between samples.
RTOL, _FINEST, PERIOD = 1e-4, 1e-9, 2e-3
# MuJoCo's longest time step, s, and how often it is halved for its finest run; of runs within two halvings of that the
# difference from it is not their error. And turns.
_LONGEST, _HALVINGS, _MARGIN, _ROUNDS = 2e-3, 10, 2, 2


def simulated(scenario: fp.Scenario, spent: list[tuple[float, int]]) -> Callable[[], Array]:
    """Return a job that gives joint positions at the samples, rad, and adds its steps' time, s, and number."""

    def job() -> Array:
        result = fp.simulate(scenario)
        spent.append((result.attrs["solver_wall_time"], result.attrs["solver_steps"]))
        return result["joint_position"].values

    return job


def sizes(scenario: fp.Scenario) -> dict[str, float]:
    """Return the bytes of a run's Dataset and of its file."""
    result = fp.simulate(scenario)
    with tempfile.TemporaryDirectory() as folder:
        fp.save(result, path := Path(folder, "result.nc"))
        return {"dataset": result.nbytes, "file": path.stat().st_size}


def stepped(
    model: Any, start: Array, commands: Callable[[Array], Array], duration: float, step: float, integrator: str
) -> Callable[[], Array]:
    """Return a job that makes MuJoCo's steps and gives joint positions at the samples, rad.

    Args:
        model: Of hinges and slides alone; its options are changed.
        start: Joint positions, shape (n,).
        commands: Controls at times of shape (m,), shape (m, actuators), each for the step that begins there.
        duration: s.
        step: s.
        integrator: Name.
    """
    import mujoco
    from mujoco import rollout

    model.opt.timestep = step
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    data = mujoco.MjData(model)
    state = np.concatenate([[0.0], start, np.zeros(model.nv)])[None]  # Time, positions, speeds.
    controls = commands(np.arange(round(duration / step)) * step)[None]

    def job() -> Array:
        states = rollout.rollout(model, data, state, controls)[0][0]
        return np.vstack([state, states])[:: round(PERIOD / step), 1 : 1 + model.nq]

    return job


def equal_error(
    scenario: fp.Scenario,
    theirs: Callable[[float, str], Callable[[], Array]],
    integrators: Sequence[str],
    quick: bool = False,
) -> Iterator[dict[str, Any]]:
    """Yield, for each of MuJoCo's integrators, our error, rad, and the times at that error, s.

    Errors are the largest of any joint at any sample. MuJoCo's time step is halved until it errs no more than we do.

    Args:
        scenario: The motion, at its own tolerance.
        theirs: Of a time step, s, and an integrator MuJoCo's run.
        integrators: Names.
        quick: Whether MuJoCo's finest run is a coarse one.
    """
    spent: list[tuple[float, int]] = []
    finest = simulated(settled(scenario, rtol=_FINEST, atol_scale=_FINEST), [])()
    ours, halvings = simulated(scenario, spent), 4 if quick else _HALVINGS
    aim = worst(ours() - finest)
    row = {"error": aim, "whole": interleaved({"ours": ours}, _ROUNDS)["ours"], "inside": min(spent)[0]}
    for name in integrators:
        exact, halving = theirs(_LONGEST / 2**halvings, name)(), 0
        # No interpolation: where a step is unstable, its error says nothing of that of shorter ones.
        while True:
            job = theirs(step := _LONGEST / 2**halving, name)
            within = worst(job() - exact) <= aim
            if within or halving == halvings - _MARGIN:
                break
            halving += 1
        found: dict[str, Any] = {"step": step, "time": interleaved({name: job}, _ROUNDS)[name]}
        found["finest"] = _LONGEST / 2**halvings
        found["relation"] = ">=" if not within else "<=" if halving == 0 else "="
        say(f"  {scenario.name}, MuJoCo's {name}: {found} at {aim:.1e} rad")
        yield row | {"integrator": name, "apart": worst(exact - finest)} | found


def worst(difference: Array) -> float:
    """Return the largest size, infinite where a number is not finite."""
    size = float(abs(difference).max())
    return size if math.isfinite(size) else math.inf


def lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the report."""
    yield f"at our error at rtol {RTOL:g}, without contact: worst joint, each against its own finest run"
    yield f"  (ours at rtol and atol_scale {_FINEST:g}, MuJoCo's at {1e6 * rows[0]['finest']:.0f} us)"
    head = ["", "friction", "motion", "error", "simulate()", "its steps", "MuJoCo's", "step", "time"]
    head += ["of simulate()", "of steps", "apart"]
    cells = []
    for row in rows:
        # A shorter step would take longer.
        less, more = {">=": ("<= ", ">= "), "<=": (">= ", "<= "), "=": ("", "")}[row["relation"]]
        named = [row["name"], row["friction"], f"{row['motion']:g} s", f"{row['error']:.1e} rad"]
        named += [f"{1e3 * row['whole']:.1f} ms", f"{1e3 * row['inside']:.1f} ms", row["integrator"]]
        named += [f"{less}{1e6 * row['step']:.0f} us", f"{more}{1e3 * row['time']:.0f} ms"]
        named += [f"{more}{row['time'] / row[ours]:.2g}" for ours in ("whole", "inside")]
        cells.append([*named, f"{row['apart']:.1e} rad"])
    yield from table(head, cells)
