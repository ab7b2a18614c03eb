"""Compare the error that runs with impacts estimate of themselves with their true one, on hundreds of random runs."""

from __future__ import annotations

import argparse
import csv
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from validation.impact_scenarios import FAMILIES, at_tolerance, impact_scenario

import finger_pin as fp
from finger_pin.commands.console import count_bar
from finger_pin.views.plots.style import new_figure, styled

# The truth is a run at a thousandth of the tolerance, or at the tightest; one at ten times that must agree with it to
# so much of the error, or the truth is not known.
_TIGHTER, _TIGHTEST, _AGREES = 1e-3, 1e-10, 0.1


@dataclass(frozen=True)
class Judged:
    """The error that a run estimated of itself, and its true one.

    Attributes:
        family: Which scenarios it is of.
        seed: Which of them.
        tolerance: Tolerance asked for.
        error: The true one, rad or m rms; not a number where no tolerance gives the truth.
        estimate: The run's own; not a number where it says that it cannot judge.
        steps: Number of steps.
        seconds: Processor time of the run, s.
        said: Its verdict on its accuracy, or the cause of an early end.
    """

    family: str
    seed: int
    tolerance: float
    error: float
    estimate: float
    steps: int
    seconds: float
    said: str = ""

    @property
    def ratio(self) -> float:
        """Estimate over error."""
        return self.estimate / self.error


def difference(one: xr.Dataset, other: xr.Dataset) -> float:
    """Return the distance of two runs as estimates count it: of joints or of objects, whichever is more, rms."""
    found = float(np.sqrt(np.mean((one.joint_position.values - other.joint_position.values) ** 2)))
    if "object_position" not in one:
        return found
    places = np.sum((one.object_position.values - other.object_position.values) ** 2, axis=-1)
    alike = np.abs(np.sum(one.object_orientation.values * other.object_orientation.values, axis=-1))
    turns = 2.0 * np.arccos(np.minimum(alike, 1.0))
    moving = np.ptp(one.object_position.values, axis=0).any(axis=-1)
    return max(found, float(np.sqrt(np.mean((places + turns**2)[:, moving]) / 6.0)))


def judge(family: str, seed: int) -> Judged:
    """Simulate one scenario, and find its true error."""
    scenario = impact_scenario(family, seed)
    tolerance, began = scenario.simulation.rtol, time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            run = fp.simulate(scenario)
        except fp.IntegrationError as failed:
            seconds = time.process_time() - began
            return Judged(family, seed, tolerance, np.nan, np.nan, 0, seconds, str(failed))
        seconds, error = time.process_time() - began, np.nan
        for tight in (max(_TIGHTER * tolerance, _TIGHTEST), _TIGHTEST):
            truth, check = (fp.simulate(at_tolerance(scenario, each)) for each in (tight, 10.0 * tight))
            found = difference(run, truth)
            if difference(check, truth) <= _AGREES * found:
                error = found
                break
    said = str(run.attrs.get("accuracy", ""))
    estimate = float(run.attrs.get("estimated_error", np.nan))
    return Judged(family, seed, tolerance, error, estimate, int(run.attrs["solver_steps"]), seconds, said)


def read(path: Path) -> list[Judged]:
    """Return the runs of a file."""
    if not path.exists():
        return []
    kinds = {each.name: {"str": str, "int": int, "float": float}[str(each.type)] for each in fields(Judged)}
    with path.open(newline="", encoding="utf-8") as file:
        return [Judged(**{name: kinds[name](text) for name, text in row.items()}) for row in csv.DictReader(file)]


def table(runs: list[Judged]) -> str:
    """Return the ratios of estimate to error as a table, a line for every family and one for all."""
    heads = (("no truth", 10), ("unjudged", 10), ("< 1/10", 8), ("< 1/3", 7), ("median", 8), ("90 %", 8), ("99 %", 8))
    lines = [f"{'':10}{'runs':>6}" + "".join(f"{head:>{width}}" for head, width in heads)]
    for name in (*FAMILIES, "all"):
        own = [run for run in runs if name in (run.family, "all")]
        ratios = np.array([run.ratio for run in own if np.isfinite(run.ratio)])
        if not len(ratios):
            continue
        unknown, unjudged = (sum(not np.isfinite(getattr(run, key)) for run in own) for key in ("error", "estimate"))
        low = "".join(f"{np.sum(ratios < share):{width}}" for share, width in ((0.1, 8), (1.0 / 3.0, 7)))
        high = "".join(f"{np.quantile(ratios, share):8.2f}" for share in (0.5, 0.9, 0.99))
        lines.append(f"{name:10}{len(own):6}{unknown:10}{unjudged:10}{low}{high}")
    return "\n".join(lines)


@styled
def plot(runs: list[Judged]) -> Figure:
    """Draw estimates over errors; below the band they are below a third."""
    figure = new_figure(5.0, 4.5)
    axes = figure.subplots()
    for name in FAMILIES:
        own = [run for run in runs if run.family == name]
        axes.loglog([run.error for run in own], [run.estimate for run in own], ".", markersize=4, label=name)
    ends = np.array(axes.get_xlim())
    axes.fill_between(ends, ends / 3.0, 3.0 * ends, color="0.9", zorder=0)
    axes.set(xlabel="true error (rad or m rms)", ylabel="estimate (rad or m rms)", xlim=ends)
    axes.legend()
    return figure


def main(given: list[str] | None = None) -> int:
    """Judge, and print a table; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="runs of each family (default 100)")
    parser.add_argument("--only", choices=FAMILIES, nargs="+", default=list(FAMILIES), help="some families")
    parser.add_argument("--processes", type=int, default=2, help="side by side (default 2)")
    parser.add_argument("--output", type=Path, default=Path("results/impacts"), help="folder, where it goes on")
    parser.add_argument("--restart", action="store_true", help="begin anew")
    chosen = parser.parse_args(given)
    chosen.output.mkdir(parents=True, exist_ok=True)
    path = chosen.output / "runs.csv"
    if chosen.restart:
        path.unlink(missing_ok=True)
    runs = read(path)
    done = {(run.family, run.seed) for run in runs}
    wanted = [(name, seed) for seed in range(chosen.count) for name in chosen.only if (name, seed) not in done]
    # What compiles is no part of a run.
    fp.simulate("press")
    with (
        ProcessPoolExecutor(chosen.processes) as pool,
        path.open("a", newline="", encoding="utf-8") as file,
        count_bar(sys.stderr.isatty(), len(wanted)) as advance,
    ):
        writer = csv.DictWriter(file, [each.name for each in fields(Judged)])
        if not runs:
            writer.writeheader()
        for run in pool.map(judge, *zip(*wanted, strict=True)) if wanted else ():
            runs.append(run)
            writer.writerow(asdict(run))
            file.flush()
            advance(1)
    for run in runs:
        if run.ratio < 1.0 / 3.0 or run.said:
            numbers = f"{run.tolerance:8.0e}  error {run.error:.1e}  estimate {run.estimate:.1e}"
            print(f"{run.family:10}{run.seed:5}{numbers}  {run.said}")
    print(table(runs))
    plot(runs).savefig(chosen.output / "impacts.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
