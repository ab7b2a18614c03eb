"""Batch of runs over threads or another executor, stacked in one Dataset."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial

import numpy as np
import xarray as xr

from finger_pin.analysis import locking_advice
from finger_pin.cancellation import CancelToken, Stop
from finger_pin.control import ClosedLoop
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, IntegrationError, Interrupted, SelfLockingWarning, StudyError
from finger_pin.mechanism.coerce import FingerLike, resolve_finger, with_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.progress import notebook_bar
from finger_pin.simulation.prepared import Prepared
from finger_pin.simulation.recording import check_variables
from finger_pin.simulation.simulate import simulate
from finger_pin.simulation.variables import variables as result_variables
from finger_pin.studies.executor import compile_for, error_line, open_executor, run_tasks

_RUN_ATTRIBUTES = ("solver_steps", "solver_evaluations", "solver_wall_time", "end_time", "self_locking_margin")


def simulate_many(
    scenarios: Iterable[ScenarioLike],
    *,
    finger: FingerLike | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    variables: Sequence[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Simulate scenarios in parallel threads, or by another executor.

    Args:
        scenarios: Scenarios, their names, or paths of files, whose fingers have the same joints and tendons, with the
            same sample times.
        finger: Replaces the finger of all, as for `fp.simulate`.
        executor: Any of `concurrent.futures`, for controllers in Python, which threads would do one after the other.
        workers: Number of threads; by default one for each core that this process may use.
        variables: Names of the variables to keep; all by default. Others are not computed then, and neither are
            warnings, as by `fp.prepare`.
        progress: Called with the numbers of finished and of all runs; in a notebook there is a bar by default.

    Returns:
        The variables of `simulate` with a leading dimension ``run``. A run that could not be finished is NaN after
        its end; ``failure`` says why. A variable of only some runs, such as of motors, is NaN in the others, and its
        attribute ``comment`` names them; so are contacts in runs that leave them out, but for ``variables`` that are
        named. ``scenario`` holds every run's TOML.

    Raises:
        InputError: If there are no scenarios, they cannot be stacked, or a variable does not exist.
        StudyError: If every run failed.
        Interrupted: After Ctrl-C, a KeyboardInterrupt; its ``result`` has the runs that were finished, ``run`` which.

    Warns:
        SelfLockingWarning: Once, if runs come close to self-locking; ``self_locking_margin`` says which.
    """
    runs = _share_fingers([load_scenario(scenario) for scenario in scenarios])
    finger = resolve_finger(finger, runs[0])
    _check_same_axes(runs)
    _check_variables(runs, variables or (), finger)
    run = partial(_run, finger=finger, names=None if variables is None else tuple(variables))
    progress = progress or notebook_bar("runs")
    outcomes: dict[int, xr.Dataset | BaseException] = {}
    texts = [""] * len(runs)
    with CancelToken() as token, open_executor(executor, workers) as pool:
        compile_for(pool, lambda: runs[0])
        for index, result in run_tasks(pool, run, runs, token):
            if isinstance(result, InputError):
                raise result
            outcomes[index] = result
            # Written here, while other threads run.
            texts[index] = to_toml(runs[index])
            if progress is not None:
                progress(len(outcomes), len(runs))
    # Only runs that were done get rows: filling gigabytes for the others takes too long.
    stacked = _stack(runs, dict(sorted(outcomes.items())), texts)
    if token.cancelled:
        raise Interrupted(math.nan, stacked, f"after {len(outcomes)} of {len(runs)} runs")
    if (stacked["failure"] != "").all():
        raise StudyError(str(stacked["failure"].values[0]), stacked)
    _warn_about_locking(stacked["self_locking_margin"].values)
    return stacked


def _warn_about_locking(margins: np.ndarray) -> None:
    """Warn once of all runs that come close to self-locking."""
    # Tensions in open loop, and custom controllers, have no margin.
    advice = locking_advice(float(np.nanmin(margins, initial=np.inf)))
    if advice:
        count = sum(bool(locking_advice(float(margin))) for margin in margins)
        message = f"{count} of {len(margins)} runs come close to self-locking; in the closest {advice}"
        warnings.warn(message, SelfLockingWarning, stacklevel=3)


def _run(scenario: Scenario, stop: Stop, finger: Finger | None, names: tuple[str, ...] | None) -> xr.Dataset:
    failure = ""
    try:
        # The study shows the progress bar.
        result = (
            simulate(scenario, finger=finger, progress=lambda time: None, stop=stop)
            if names is None
            else _prepared(scenario, finger, names).run(stop=stop).dataset()
        )
    except IntegrationError as error:
        assert error.result is not None
        failure, result = str(error), error.result
    return result.assign_attrs(failure=failure)


def _prepared(scenario: Scenario, finger: Finger | None, names: tuple[str, ...]) -> Prepared:
    family = ParametrisedScenario(with_finger(scenario, finger), ())
    try:
        return Prepared(family, names, finger)
    except InputError:
        # This run may lack variables that others have.
        available = result_variables(ClosedLoop.from_scenario(scenario, finger=finger))
        return Prepared(family, tuple(variable for variable in names if variable in available), finger)


def _share_fingers(runs: Sequence[Scenario]) -> list[Scenario]:
    """Return scenarios whose equal fingers are one object, so that it is built once."""
    if not runs:
        raise InputError("scenarios", "at least one is needed")
    first = runs[0]
    return [
        run.updated(finger=first.finger, environment=first.environment)
        if run.hand is None and (run.finger, run.environment) == (first.finger, first.environment)
        else run
        for run in runs
    ]


def _check_same_axes(runs: Sequence[Scenario]) -> None:
    first = runs[0]
    for index, run in enumerate(runs):
        for entry, value, expected in (
            ("finger.joints", tuple(run.finger.joints), tuple(first.finger.joints)),
            ("finger.tendons", tuple(run.finger.tendons), tuple(first.finger.tendons)),
            ("simulation.duration", run.simulation.duration, first.simulation.duration),
            ("simulation.sample_rate", run.simulation.sample_rate, first.simulation.sample_rate),
        ):
            if value != expected:
                raise InputError(f"scenarios[{index}].{entry}", f"must be {expected}, as in the first scenario", value)


def _check_variables(runs: Sequence[Scenario], names: Sequence[str], finger: Finger | None) -> None:
    """Raise unless each variable exists in at least one run."""
    available: dict[str, None] = {}
    for run in runs:
        if set(names) <= set(available):
            return
        available |= dict.fromkeys(result_variables(ClosedLoop.from_scenario(run, finger=finger)))
    check_variables("variables", names, available)


def _stack(
    runs: Sequence[Scenario], done: Mapping[int, xr.Dataset | BaseException], texts: Sequence[str]
) -> xr.Dataset:
    indices, results = list(done), list(done.values())
    finished = {row: result for row, result in enumerate(results) if isinstance(result, xr.Dataset)}
    longest = max(finished.values(), key=lambda result: result.sizes["time"], default=xr.Dataset(coords={"time": []}))
    times = runs[0].sample_times()
    labels = _labels(finished.values())
    stacked: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    for name in dict.fromkeys(str(name) for result in finished.values() for name in result.data_vars):
        present = {row: result[name] for row, result in finished.items() if name in result}
        first = next(iter(present.values()))
        dims = tuple(map(str, first.dims))
        sizes = [len(labels[dim]) if dim in labels else first.sizes[dim] for dim in dims[1:]]
        absent = [indices[row] for row in finished if row not in present]
        values = np.empty((len(results), len(times), *sizes))
        values[[row for row in range(len(results)) if row not in present]] = np.nan
        for row, variable in present.items():
            run_labels, count = {dim: variable[dim].values.tolist() for dim in dims[1:] if dim in labels}, len(variable)
            if all(labels[dim] == label_names for dim, label_names in run_labels.items()):
                values[row, :count], values[row, count:] = variable.values, np.nan
                continue
            values[row] = np.nan
            positions = [
                [labels[dim].index(label) for label in run_labels[dim]] if dim in run_labels else range(size)
                for dim, size in zip(dims[1:], sizes, strict=True)
            ]
            values[np.ix_([row], range(count), *positions)] = variable.values
        attributes = dict(first.attrs)
        if absent:
            attributes["comment"] = f"NaN in runs that have none: {', '.join(map(str, absent))}"
        stacked[name] = (("run", *dims), values, attributes)
    for name in _RUN_ATTRIBUTES:
        numbers = [result.attrs.get(name, np.nan) if isinstance(result, xr.Dataset) else np.nan for result in results]
        stacked[name] = (("run",), np.array(numbers), {"long_name": name})
    failures = [error_line(each) if isinstance(each, BaseException) else each.attrs["failure"] for each in results]
    stacked["failure"] = (("run",), np.array(failures, dtype=str), {"long_name": "failure"})
    scenarios = np.array([texts[index] for index in indices], dtype=str)
    stacked["scenario"] = (("run",), scenarios, {"long_name": "resolved scenario, TOML"})
    versions = {key: value for key, value in longest.attrs.items() if key.startswith("version_")}
    return xr.Dataset(
        stacked,
        coords={"time": ("time", times, dict(longest.time.attrs)), "run": np.array(indices, dtype=int), **labels},
        attrs=versions,
    )


def _labels(results: Iterable[xr.Dataset]) -> dict[str, list[str]]:
    """Return the union of all results' labels by dimension."""
    labels_by_dim: dict[str, dict[str, None]] = {}
    for result in results:
        for name in result.coords:
            if name != "time":
                labels_by_dim.setdefault(str(name), {}).update(dict.fromkeys(result[name].values.tolist()))
    return {name: list(labels) for name, labels in labels_by_dim.items()}
