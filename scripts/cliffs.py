"""Run random fingers in wide ranges and tell which are slow, which fail, and whose energy account does not close."""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr
from validation.wild_fingers import wild_scenario

import finger_pin as fp

SLOW, OPEN = 20.0, 1e-5


@dataclass(frozen=True)
class Run:
    """The run of one finger: processor time, s, steps, residual over the energy exchanged, cause of an early end."""

    seed: int
    seconds: float
    steps: int
    residual: float
    reason: str


def residual_share(result: xr.Dataset) -> float:
    """Return the largest energy residual over the energy exchanged until the end."""
    exchanged = sum(float(np.abs(v).max()) for name, v in result.items() if str(name).startswith("energy_exchanged_"))
    if result.sizes["time"] < 2 or not exchanged > 0.0:
        return 0.0
    return float(np.abs(result["energy_residual"]).max()) / exchanged


def run_seed(seed: int, limit: float) -> Run:
    """Run one finger for at most a processor time, s."""
    scenario, began, reason = wild_scenario(seed), time.process_time(), ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = fp.simulate(scenario, stop=lambda: time.process_time() - began > limit)
        except fp.IntegrationError as error:
            result, reason = error.result, str(error)
        except fp.exceptions.Interrupted as error:
            result, reason = error.result, f"not done after {limit:g} s: {error}"
    assert result is not None
    steps = int(result.attrs["solver_steps"])
    return Run(seed, time.process_time() - began, steps, residual_share(result), reason)


def main(given: list[str] | None = None) -> int:
    """Run, and print a table of those that are not as they should be; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=100, help="fingers (default 100)")
    parser.add_argument("--seed", type=int, default=0, help="of the first finger (default 0)")
    parser.add_argument("--limit", type=float, default=20.0, help="s for a finger (default 20)")
    parser.add_argument("--processes", type=int, default=2, help="side by side (default 2)")
    arguments = parser.parse_args(given)
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    print(f"{'seed':>6}{'s':>8}{'steps':>9}{'residual':>11}")
    runs = []
    # What compiles is no part of a run.
    fp.simulate("reversals")
    with ProcessPoolExecutor(arguments.processes) as pool:
        for run in pool.map(partial(run_seed, limit=arguments.limit), seeds):
            runs.append(run)
            if run.reason or run.residual > OPEN or run.seconds > SLOW / 4:
                numbers = f"{run.seed:6}{run.seconds:8.2f}{run.steps:9}{run.residual:11.1e}"
                print(f"{numbers}  {run.reason}", flush=True)
    failed = [run for run in runs if run.reason]
    steps = np.array([run.steps for run in runs])
    print(
        f"{len(runs)} fingers: {len(failed)} not done, {sum(run.seconds > SLOW for run in runs)} above {SLOW:g} s, "
        f"{sum(run.residual > OPEN for run in runs)} with a residual above {OPEN:g} of the energy exchanged; "
        f"steps: median {np.median(steps):.0f}, 99 % {np.quantile(steps, 0.99):.0f}, most {steps.max()}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
