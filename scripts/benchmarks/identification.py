"""Identification: six numbers of reversals found in six of its signals, and what slopes of a run cost beside it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.prepared import processor_time
from benchmarks.store import Store, say

#: What is found, its bounds, and how far off the search starts.
PARAMETERS = {
    "finger.tendon_friction.coulomb": ((0.02, 0.5), 0.16),
    "finger.tendon_friction.viscous": ((0.2, 5.0), 1.6),
    "finger.joint_friction.coulomb": ((2e-5, 3.4e-4), 1.2e-4),
    "finger.joint_friction.viscous": ((1e-4, 1e-2), 1.5e-3),
    "finger.joint_friction.stiffness": ((1.0, 20.0), 4.0),
    "finger.joints.proximal.link.mass": ((0.004, 0.03), 0.007),
}
#: What is seen, and its noise, rms.
SIGNALS = {
    **{f"joint_position.{joint}": 1e-3 for joint in ("abduction", "proximal", "medial")},
    **{f"tendon_tension.{tendon}": 0.02 for tendon in ("T1", "T2", "T3")},
}
_VARIABLES = ("joint_position", "tendon_tension")
_RATE, _SETTLE, _ROUNDS, _QUICK_ROUNDS = 100.0, 0.1, 5, 2


def measure(store: Store) -> dict[str, Any]:
    """Return the times of an identification and of slopes, s."""
    duration, rounds = (0.5, _QUICK_ROUNDS) if store.quick else (8.0, _ROUNDS)
    return {
        "slopes": store.part("identification-slopes", lambda: _slopes(min(duration, 2.0), rounds)),
        "fit": store.part("identification-fit", lambda: _fit(duration, 1 if store.quick else 3)),
    }


def recording(duration: float) -> dict[str, np.ndarray]:
    """Return columns by name: fig6 with its own numbers, and noise."""
    scenario = fp.load_scenario("reversals", {"simulation.duration": duration, "simulation.sample_rate": _RATE})
    made, rng = fp.prepare(scenario, (), _VARIABLES).run(), np.random.default_rng(0)
    columns = {"t": np.asarray(made.time)}
    for name, noise in SIGNALS.items():
        variable, _, label = name.partition(".")
        labels = [str(each) for each in made["joint" if variable == "joint_position" else "tendon"]]
        columns[name] = made[variable][:, labels.index(label)] + rng.normal(0.0, noise, len(made.time))
    return columns


def _fit(duration: float, starts: int) -> dict[str, Any]:
    """Return the wall and the processor time of an identification, s, and how it went."""
    columns = recording(duration)
    seen = {"time": "t", "settle": _SETTLE, "outputs": {name: name for name in SIGNALS}}
    began = time.perf_counter(), time.process_time()
    result = fp.identify(
        "reversals",
        parameters={key: bounds for key, (bounds, _) in PARAMETERS.items()},
        recordings={"motion": seen},
        data={"motion": columns},
        overrides={key: start for key, (_, start) in PARAMETERS.items()},
        starts=starts,
    )
    times = {"wall": time.perf_counter() - began[0], "processor": time.process_time() - began[1]}
    say(f"  six numbers from {starts} starts: {times['wall']:.3g} s")
    alike = {name: int(result.attrs[name]) for name in ("searches", "searches_alike")}
    return {"duration": duration, **times, **alike, "noise": result.noise.values.tolist()}


def _slopes(duration: float, rounds: int) -> dict[str, float]:
    """Return the times of a run with slopes by one, three and six numbers, of one without, s."""
    jobs = {}
    for count in (1, 3, 6):
        scenario = fp.load_scenario("reversals", {"simulation.duration": duration})
        prepared = fp.prepare(scenario, list(PARAMETERS)[:count], _VARIABLES)
        jobs[str(count)] = lambda prepared=prepared: prepared.run(sensitivities=True)
    return processor_time({"run": lambda: prepared.run(), **jobs}, rounds)


def lines(study: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines on the cost of an identification, and on that of slopes, in runs."""
    fit, slopes = study["fit"], study["slopes"]
    yield f"identification: {len(PARAMETERS)} numbers in {len(SIGNALS)} signals of {fit['duration']:g} s of fig6"
    yield (
        f"{fit['wall']:.3g} s, {fit['processor']:.3g} s of processor time; "
        f"{fit['searches_alike']} of {fit['searches']} searches end at the best"
    )
    costs = (f"{slopes[count] / slopes['run']:.2g} for {count}" for count in ("1", "3", "6"))
    yield f"a run with slopes, in runs without: {', '.join(costs)} numbers"
