"""Searches for better designs: objectives and constraints on the metrics of runs, over some numbers of a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.cancellation import Stop
from finger_pin.description.loading import ScenarioLike, to_toml
from finger_pin.exceptions import InputError
from finger_pin.files import write_table, write_text
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.progress import notebook_bar
from finger_pin.simulation.netcdf import save
from finger_pin.studies.designs import PointList
from finger_pin.studies.keys import BaseScenario, Point
from finger_pin.studies.metrics import Metric, scenario_metrics
from finger_pin.studies.records import DONE, Progress, RunRecord, Study, open_study
from finger_pin.studies.search import (
    FAILED_EXCESS,
    Constraint,
    Goals,
    Search,
    Variable,
    check_variables,
    nondominated,
    parse_variable,
    point_at,
    radii,
    start_values,
)
from finger_pin.studies.sweeps import assemble, require_complete
from finger_pin.typing import Array

PRODUCTS = ["optimise.nc", "front.csv", "front/*.toml", "figures/pareto.png"]
DEFAULT_OBJECTIVES = ("tracking_rms", "tension_peak")
DEFAULT_CONSTRAINTS = ("self_locking_margin>=1.5", "fingertip_force>=0.8")


@dataclass(frozen=True)
class Effort:
    """The effort of a search: its length and its random numbers.

    Attributes:
        population: Designs of a generation.
        generations: Number of generations.
        seed: Seed of the random numbers.
    """

    population: int = 24
    generations: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        """Check."""
        for name, least in (("population", 4), ("generations", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise InputError(name, f"must be at least {least}", getattr(self, name))


def optimise(
    scenario: ScenarioLike,
    over: Iterable[Variable | str] | None = None,
    *,
    minimise: Iterable[str | Metric] = DEFAULT_OBJECTIVES,
    maximise: Iterable[str | Metric] = (),
    constraints: Iterable[str | Constraint] = DEFAULT_CONSTRAINTS,
    effort: Effort | None = None,
    overrides: Mapping[str, Any] | None = None,
    finger: FingerLike | None = None,
    output: str | Path | None = None,
    executor: Executor | None = None,
    restart: bool = False,
    progress: Progress | None = None,
    stop: Stop | None = None,
) -> xr.Dataset:
    """Search for nondominated designs, such as by ``fp.optimise("fig6", ["controller.gain=0.5:4"], constraints=[])``.

    A design whose tendons its controller and its springs cannot keep taut, or whose run fails, does not count; it is
    recorded with its reason. With an ``output`` every finished run is on disk at once, and the same search again
    continues where it ended.

    Args:
        scenario: The scenario to be varied, its name, or the path of a file.
        over: Variables, or texts for `parse_variable`; by default the winding `radii` of the finger.
        minimise: Metrics to be made small.
        maximise: Metrics to be made large.
        constraints: Bounds on metrics, such as ``self_locking_margin>=1.5``.
        effort: Effort of the search.
        overrides: Entries of the scenario that hold for all designs.
        finger: Replaces the finger that the scenario describes, as for `fp.simulate`; values at its keys change it.
        output: Folder for ``runs.jsonl``, ``optimise.nc``, ``front.csv``, ``front/*.toml``; or nothing.
        executor: Executor of the runs, any of `concurrent.futures`; by default one thread for each core.
        restart: Whether to drop what the folder holds of a study, instead of going on with it.
        progress: Called with the numbers of finished, failed and all runs; in a notebook there is a bar by default.
        stop: Called now and then; true ends the search.

    Returns:
        Along ``sample``, which begins with the scenario's own design and follows the search: every key, metric,
        ``status``, ``reason``, ``feasible`` and ``front``.

    Raises:
        InputError: Naming the argument, key or value that is wrong; nothing is written then.
        StudyError: If every run failed.
        Interrupted: After Ctrl-C, a KeyboardInterrupt; its ``result`` has the runs that were finished.
        OSError: If a record cannot be written.
        ExecutorError: If the executor cannot go on.
    """
    effort = effort or Effort()
    goals = Goals.from_metrics(minimise, maximise, constraints)
    base = BaseScenario.from_scenario(scenario, overrides, finger)
    scenario_metrics(base.scenario, goals.metrics)
    variables = _variables(over, base)
    start = start_values(variables, base)
    with open_study(base, goals.metrics, output, PRODUCTS, executor, stop, restart) as study:
        search = _SearchRun(study, goals, variables, effort, progress or notebook_bar("runs"))
        result = _dataset(base, goals, *search.execute(start)).assign_attrs(vars(effort))
        if output is not None:
            _write(result, base, Path(output))
    return require_complete(result, study.token.cancelled)


def _variables(over: Iterable[Variable | str] | None, base: BaseScenario) -> list[Variable]:
    """Return the variables of a search, by default the winding radii of the finger."""
    choices = radii(base.scenario.finger) if over is None else over
    variables = [parse_variable(variable) if isinstance(variable, str) else variable for variable in choices]
    check_variables(variables, base)
    return variables


@dataclass(frozen=True, eq=False)
class _SearchRun:
    """Progress of a search, generation by generation."""

    study: Study
    goals: Goals
    variables: Sequence[Variable]
    effort: Effort
    progress: Progress | None

    def execute(self, start: Mapping[str, float]) -> tuple[list[Point], list[RunRecord | None]]:
        """Return all points with their records, the scenario's own first."""
        sizes = len(self.variables), len(self.goals.objectives), self.effort.population
        search = Search(*sizes, self.effort.seed, _shares(self.variables, start))
        points: list[Point] = [start]
        records = self._evaluate(points, [])
        for _ in range(self.effort.generations):
            if records[-1] is None or self.study.token():
                break
            new_points = [point_at(self.variables, shares) for shares in search.ask()]
            new_records = self._evaluate(new_points, records)
            points, records = points + new_points, records + new_records
            done = [record for record in new_records if record is not None]
            if len(done) < len(new_records):
                break
            goal_values = [self._evaluate_goals(record) for record in done]
            search.tell(np.array([value for value, _ in goal_values]), np.array([excess for _, excess in goal_values]))
        return points, records

    def _evaluate(self, points: list[Point], earlier_records: list[RunRecord | None]) -> list[RunRecord | None]:
        total = 1 + self.effort.population * self.effort.generations
        failed_before = sum(record is not None and record.status != DONE for record in earlier_records)

        def report(finished: int, failures: int, _: int) -> None:
            if self.progress is not None:
                self.progress(len(earlier_records) + finished, failed_before + failures, total)

        return self.study.evaluate(points, report)

    def _evaluate_goals(self, record: RunRecord) -> tuple[Array, Array]:
        """Return objectives and excesses, `FAILED_EXCESS` for a design that cannot be run."""
        if record.status == DONE:
            values, excesses = self.goals.values(record.metrics), self.goals.excesses(record.metrics)
            if np.isfinite(values).all() and not np.isnan(excesses).any():
                return values, np.clip(excesses, -FAILED_EXCESS, FAILED_EXCESS)
        return np.full(len(self.goals.objectives), FAILED_EXCESS), np.full(len(self.goals.constraints), FAILED_EXCESS)


def _shares(variables: Sequence[Variable], start: Mapping[str, float]) -> Array | None:
    """Return the coordinates of the scenario's own design in the unit cube, or None outside of it."""
    shares = []
    for variable in variables:
        value = start[variable.keys[0]]
        for key, sign in zip(variable.keys, variable.signs, strict=True):
            if start[key] != sign * value:
                return None
        if not variable.range.low <= value <= variable.range.high:
            return None
        shares.append(variable.range.share(value))
    return np.array(shares)


def _dataset(base: BaseScenario, goals: Goals, points: list[Point], records: list[RunRecord | None]) -> xr.Dataset:
    point_list = PointList({key: [point[key] for point in points] for key in points[0]})
    result = assemble(base.scenario, point_list, goals.metrics, records)
    measured = [(row, r.metrics) for row, r in enumerate(records) if r is not None and r.status == DONE]
    feasible, front = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=int)
    if measured:
        rows = np.array([row for row, _ in measured])
        values = np.array([goals.values(metrics) for _, metrics in measured])
        feasible_rows = np.array([bool((goals.excesses(metrics) <= 0.0).all()) for _, metrics in measured])
        feasible_rows &= np.isfinite(values).all(axis=1)
        rows, values = rows[feasible_rows], values[feasible_rows]
        feasible[rows] = True
        best = nondominated(values)
        rows, values = rows[best], values[best]
        # A design that comes again is on the front once; numbers follow the first objective.
        _, unique_rows = np.unique(values, axis=0, return_index=True)
        front[rows[unique_rows]] = 1 + np.arange(len(unique_rows))
    result["feasible"] = ("sample", feasible, {"long_name": "whether the design keeps all constraints"})
    result["front"] = ("sample", front, {"long_name": "number of the design on the front, from 1; 0 for the others"})
    return result.assign_attrs(goals.describe())


def _write(result: xr.Dataset, base: BaseScenario, folder: Path) -> None:
    """Write ``optimise.nc``, ``front.csv`` and its scenarios, ``front/01.toml`` and so on in the order of the table.

    Raises:
        OSError: If they cannot be written.
    """
    save(result, folder / "optimise.nc")
    keys = [str(key) for key in result.coords]
    columns = [*(str(name) for name in result.data_vars if "units" in result[name].attrs), *keys]
    scenarios = folder / "front"
    scenarios.mkdir(exist_ok=True)
    for stale_file in scenarios.glob("*.toml"):
        stale_file.unlink()
    table: list[list[object]] = [["design", *(f"{name} ({result[name].attrs['units']})" for name in columns)]]
    for number in range(1, 1 + int(result["front"].max())):
        row = result.isel(sample=int(np.flatnonzero(result["front"].values == number)[0]))
        name = f"{number:02d}"
        table.append([name, *(float(row[column]) for column in columns)])
        scenario = base.at({key: float(row[key]) for key in keys})
        title = f"design {name} of the front of a search on {scenario.name}"
        renamed = scenario.updated(name=f"{scenario.name[:50]}_front_{name}", title=title)
        write_text(scenarios / f"{name}.toml", to_toml(renamed))
    write_table(folder / "front.csv", table)
