"""Cost of a step as a chain of hinges grows, and time at equal error, beside MuJoCo on the same model.

A chain of 0.6 m and 0.2 kg hangs from a hinge, and one cord over all links pulls it. Its stiffness and damping per
length are the same for any number of links, and nothing limits or touches it. Without friction both solve the same
equations. MuJoCo's tension is constant, and where errors are compared ours is too. Below the chains stand two hands
(`public_hands`).
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks import equal_error, public_hands
from benchmarks.equal_error import PERIOD, RTOL
from benchmarks.runs import rms, settled
from benchmarks.store import Store, say
from benchmarks.text_tables import table
from benchmarks.timing import cost_at, interleaved
from finger_pin.typing import Array

_DURATIONS = {1: 1.0, 4: 1.0, 8: 1.0, 16: 1.0, 32: 0.5, 64: 0.25}
_NONE = {"coulomb": 0.0, "viscous": 0.0, "stiffness": 1e-9}
_FRICTION = {"default": {}, "none": {"tendon_friction": _NONE, "joint_friction": _NONE | {"stiction": 0.0}}}
_TOLERANCES = 1e-3, 1e-4, 1e-5
_STEPS, _STEP = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5), 5e-4
_TENSION, _ROUNDS = 3.0, 5  # N, turns


def measure(store: Store) -> dict[str, Any] | None:
    """Return the costs of steps and the errors; None where MuJoCo is not installed."""
    if importlib.util.find_spec("mujoco") is None:
        return None
    durations, compared = ({1: 0.1, 4: 0.1}, (4, 0.1)) if store.quick else (_DURATIONS, (8, 1.0))
    study = store.part("growth", lambda: {"rows": list(_rows(durations)), "precision": _precision(*compared)})
    study["equal"] = store.part("growth-equal", lambda: list(_at_equal_error(durations, store.quick)))
    if not public_hands.installed():
        say(f"growth: hands left out, {public_hands.PACKAGE} is not installed")
        return study
    seconds = 0.05 if store.quick else 1.0
    study["rows"] += store.part("growth-hands", lambda: list(public_hands.rows(seconds, _FRICTION)))
    study["equal"] += store.part(
        "growth-hands-equal", lambda: list(public_hands.at_equal_error(store.quick, _FRICTION))
    )
    if importlib.util.find_spec("gymnasium") is not None:
        study["control"] = store.part(
            "growth-hands-control", lambda: public_hands.control_steps(store.quick, _FRICTION)
        )
    return study


def mjcf(links: int) -> str:
    """Return the chain, which hangs along x, as MJCF."""
    length, mass = 0.6 / links, 0.2 / links
    across = mass * length**2 / 12.0 + 1e-6
    bodies = "".join(
        f'<body name="link{k}" pos="{length if k else 0.0} 0 0"><joint name="hinge{k}" axis="0 1 0"'
        f' stiffness="{0.05 * links}" damping="{5e-4 * links}"/><inertial pos="{length / 2} 0 0" mass="{mass}"'
        f' diaginertia="1e-6 {across} {across}"/><site name="point{k}" pos="{length / 2} 0 0.008"/>'
        for k in range(links)
    )
    points = "".join(f'<site site="{name}"/>' for name in ("anchor", *(f"point{k}" for k in range(links))))
    motor = '<motor name="pull" tendon="cord" gear="-1" ctrlrange="0 10"/>'
    return (
        f'<mujoco><option gravity="9.81 0 0"/><worldbody>'
        f'<site name="anchor" pos="-0.01 0 0.008"/>{bodies}{"</body>" * links}</worldbody><tendon><spatial name="cord">'
        f"{points}</spatial></tendon><actuator>{motor}</actuator></mujoco>"
    )


def chain(links: int, duration: float, friction: str, amplitude: float = 2.0) -> fp.Scenario:
    """Return the chain under a tension of some amplitude, N, with friction ``default`` or ``none``."""
    import mujoco

    finger = fp.from_mujoco(mujoco.MjSpec.from_string(mjcf(links))).updated(**_FRICTION[friction])
    pull = {"kind": "sine", "offset": _TENSION, "amplitude": amplitude, "frequency": 1.0}
    controller = {"kind": "tensions", "tensions": {"pull": pull}}
    simulation = {"duration": duration, "sample_rate": 1.0 / PERIOD, "rtol": RTOL}
    entries = {"name": f"chain{links}", "finger": finger, "controller": controller, "simulation": simulation}
    return fp.Scenario.model_validate(entries)


def stepped(links: int, duration: float, step: float, integrator: str) -> Callable[[], Array]:
    """Return a job that makes MuJoCo's steps at constant tension and gives joint positions at the samples, rad."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(links))

    def commands(times: Array) -> Array:
        return np.full((len(times), 1), _TENSION)

    return equal_error.stepped(model, np.zeros(links), commands, duration, step, integrator)


def _rows(durations: Mapping[int, float]) -> Iterator[dict[str, Any]]:
    """Yield time and steps for a second of motion, and times of a step, s."""
    for links, duration in durations.items():
        spent: dict[str, list[tuple[float, int]]] = {"default": [], "none": []}
        jobs = {
            friction: equal_error.simulated(chain(links, duration, friction), each) for friction, each in spent.items()
        }
        jobs["mujoco"] = stepped(links, duration, _STEP, "implicitfast")
        interleaved(jobs, 1)  # Compiles.
        times = interleaved(jobs, _ROUNDS)
        for friction, each in spent.items():
            (inside, steps), row = min(each), {"links": links, "friction": friction, "motion": duration}
            row |= {"whole": times[friction] / duration, "steps": steps / duration, "step": inside / steps}
            yield (
                row
                | {"mujoco": times["mujoco"] * _STEP / duration}
                | equal_error.sizes(chain(links, duration, friction))
            )
        say(f"  {links} links: {1e6 * row['step']:.1f} us per step without friction")


def _at_equal_error(durations: Mapping[int, float], quick: bool) -> Iterator[dict[str, Any]]:
    """Yield times at equal error, under constant tension without friction."""
    for links, duration in durations.items():
        base = chain(links, duration, "none", amplitude=0.0)
        for row in equal_error.equal_error(base, partial(stepped, links, duration), ("implicitfast", "RK4"), quick):
            yield {"name": f"{links} links", "friction": "none", "motion": duration} | row


def _precision(links: int, duration: float) -> dict[str, Any]:
    """Return errors, rad, and times, s, of runs without friction, and MuJoCo's at our error."""
    base, aim = chain(links, duration, "none", amplitude=0.0), f"rtol {RTOL:g}"
    exact = equal_error.simulated(settled(base, rtol=1e-10, atol_scale=1e-10), [])()
    spent: dict[float, list[tuple[float, int]]] = {rtol: [] for rtol in _TOLERANCES}
    jobs = {f"rtol {rtol:g}": equal_error.simulated(settled(base, rtol=rtol), each) for rtol, each in spent.items()}
    names = {kind: {f"{kind}, {1e6 * step:g} us": step for step in _STEPS} for kind in ("implicitfast", "RK4")}
    jobs |= {name: stepped(links, duration, step, kind) for kind in names for name, step in names[kind].items()}
    errors = {name: rms(job() - exact) for name, job in jobs.items()}
    times = interleaved(jobs, _ROUNDS)
    inside, equal = times | {f"rtol {rtol:g}": min(each)[0] for rtol, each in spent.items()}, {}
    for kind, steps in names.items():
        time = cost_at([(errors[name], times[name]) for name in steps], errors[aim])
        rate = cost_at([(errors[name], 1.0 / step) for name, step in steps.items()], errors[aim])
        if time and rate:
            ratios = {"over_whole": time.time / times[aim], "over_steps": time.time / inside[aim]}
            equal[kind] = {"step": 1.0 / rate.time, "time": time.time, "relation": time.relation} | ratios
    points = [[name, errors[name], times[name], inside[name]] for name in jobs]
    return {"links": links, "motion": duration, "aim": aim, "points": points, "equal": equal}


def lines(study: Mapping[str, Any]) -> Iterator[str]:
    """Yield the report."""
    yield f"a cord over a chain of hinges, and hands, rtol {RTOL:g}, beside steps of MuJoCo without our friction"
    cells = {"model": "{links}", "friction": "{friction}", "motion": "{motion:g} s", "steps per s": "{steps:.0f}"}
    cells |= {"simulate() per s": "{ms:.1f} ms", "per step": "{us:.1f} us", "mj_step": "{other:.1f} us"}
    cells |= {"ratio": "{ratio:.1f}", "Dataset": "{data:.2f} MB", "file": "{kept:.2f} MB"}
    rows = []
    for row in study["rows"]:
        scaled = row | {"ms": 1e3 * row["whole"], "us": 1e6 * row["step"], "other": 1e6 * row["mujoco"]}
        scaled |= {"ratio": row["step"] / row["mujoco"], "data": 1e-6 * row["dataset"], "kept": 1e-6 * row["file"]}
        rows.append([cell.format(**scaled) for cell in cells.values()])
    yield from table(tuple(cells), rows)
    yield from equal_error.lines(study["equal"])
    for friction, took in study.get("control", {}).items():
        yield f"a control step of {1e3 * public_hands.CONTROL:g} ms of Shadow, friction {friction}: {1e3 * took:.1f} ms"
    precise = study["precision"]
    yield f"{precise['links']} links without friction, {precise['motion']:g} s: rms error, time in all and of the steps"
    points = [(n, f"{e:.1e} rad", f"{1e3 * t:.2f} ms", f"{1e3 * i:.2f} ms") for n, e, t, i in precise["points"]]
    yield from table(("", "error", "time", "steps"), points)
    for kind, each in precise["equal"].items():
        bound = {">=": "<= ", "<=": ">= "}.get(each["relation"], "")
        yield f"MuJoCo's {kind} at our error at {precise['aim']}: step {bound}{1e6 * each['step']:.3g} us; its time is"
        yield f"  {each['relation']} {each['over_whole']:.3g} of simulate(), {each['over_steps']:.3g} of its steps"
