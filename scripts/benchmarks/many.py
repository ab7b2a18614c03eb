"""Many runs: `finger_pin.simulate_many` in one and in two threads."""

from __future__ import annotations

from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.store import Store, say
from benchmarks.timing import clocked
from finger_pin.threads import usable_cores

WORKERS = (1, 2)
# Many enough that what is loaded first no longer counts.
_COUNTS = (12, 200)
_QUICK_COUNTS = (4, 12)


def measure(store: Store) -> Any:
    """Return the times."""
    return store.part(
        "many-runs", lambda: _study(_QUICK_COUNTS if store.quick else _COUNTS, 2.0 if store.quick else 8.0)
    )


def _study(counts: tuple[int, int], duration: float) -> dict[str, Any]:
    times: dict[str, float] = {}
    # So that nothing is compiled while it is timed.
    fp.simulate_many([fp.load_scenario("reversals", {"simulation.duration": 0.01})] * 4, workers=max(WORKERS))
    for count in counts:
        gains = np.linspace(0.8, 1.2, count)
        overrides = [{"controller.gain": float(gain), "simulation.duration": duration} for gain in gains]
        scenarios = [fp.load_scenario("reversals", each) for each in overrides]
        for workers in WORKERS:
            elapsed, _ = clocked(
                lambda scenarios=scenarios, workers=workers: fp.simulate_many(
                    scenarios, workers=workers, variables=["joint_position", "tendon_tension"]
                )
            )
            times[f"{count} runs, {workers} threads"] = elapsed
            say(f"  {count} runs of {duration:g} s in {workers} threads: {elapsed:.1f} s")
    few, many = ([times[f"{count} runs, {workers} threads"] for workers in WORKERS] for count in counts)
    further = [late - early for late, early in zip(many, few, strict=True)]
    marginal = further[0] / further[1] if min(further) > 0.0 else None
    return {
        "duration": duration,
        "counts": counts,
        "cores": usable_cores(),
        "times": times,
        "speed_up": many[0] / many[1],
        "speed_up_without_start": marginal,
    }
