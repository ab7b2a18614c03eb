"""Many runs at once: scenarios over processes, results stacked in one Dataset."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from threading import Thread

import numpy as np
import xarray as xr

from finger_pin.analysis.locking_margin import locking_advice
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, IntegrationError, ScenarioWarning, SelfLockingWarning
from finger_pin.simulation.simulate import simulate
from finger_pin.studies.processes import process_context, usable_cores

# Runs that are handed to each process ahead of time, so that none waits for the next.
_IN_FLIGHT = 2
_PER_RUN = ("solver_steps", "solver_evaluations", "solver_wall_time", "end_time", "self_locking_margin")


def simulate_many(
    scenarios: Iterable[Scenario],
    *,
    workers: int | None = None,
    variables: Sequence[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Simulate scenarios in parallel processes.

    A script that calls this needs the usual guard ``if __name__ == "__main__":``, since the processes import it.

    Args:
        scenarios: Scenarios whose fingers have the same joints and tendons, with the same sample times.
        workers: Number of processes; by default one per core that this process may use.
        variables: Names of the variables to keep; all by default. Fewer need less memory.
        progress: Called with the numbers of finished and of all runs.

    Returns:
        The variables of `simulate` with a leading dimension ``run``. A run that could not be finished is NaN from
        where it stopped; ``failure`` says why, and is empty for the others. ``scenario`` holds every run's TOML.

    Raises:
        InputError: If there are no scenarios, they cannot be stacked, or a variable does not exist.

    Warns:
        SelfLockingWarning: Once, if runs come close to self-locking; ``self_locking_margin`` says which.
    """
    runs = list(scenarios)
    if not runs:
        raise InputError("scenarios", "at least one is needed")
    _check_alike(runs)
    if workers is not None and workers < 1:
        raise InputError("workers", "must be at least 1", workers)
    count = min(workers or usable_cores(), len(runs))
    keep = None if variables is None else tuple(variables)
    results: list[xr.Dataset | None] = [None] * len(runs)
    for done, (index, result) in enumerate(_completed(runs, keep, count), start=1):
        results[index] = result
        if progress is not None:
            progress(done, len(runs))
    stacked = _stack(runs, results)
    margins = stacked["self_locking_margin"].values
    advice = locking_advice(float(margins.min()))
    if advice:
        close = sum(bool(locking_advice(float(margin))) for margin in margins)
        message = f"{close} of {len(runs)} runs come close to self-locking; in the closest {advice}"
        warnings.warn(message, SelfLockingWarning, stacklevel=2)
    return stacked


def _completed(runs: Sequence[Scenario], keep: tuple[str, ...] | None, count: int) -> Iterator[tuple[int, xr.Dataset]]:
    """Yield index and result of every run as it is finished."""
    if count == 1:
        for index, run in enumerate(runs):
            yield index, _run(run, keep)
        return
    waiting = deque(range(1, len(runs)))
    pending: dict[Future[xr.Dataset], int] = {}
    pool = ProcessPoolExecutor(count, mp_context=process_context())
    calls: list[Future[None]] = []
    # Starting a process waits for the server, which takes a second or two to start.
    starting = Thread(target=lambda: calls.extend(pool.submit(_answer) for _ in range(count)))
    starting.start()
    started = False
    try:
        # The first run comes first and here: it compiles what the other processes then find in the cache.
        yield 0, _run(runs[0], keep)
        while waiting or pending:
            started = started or any(call.done() for call in calls.copy())
            if not started:
                # This process is there already.
                index = waiting.popleft()
                yield index, _run(runs[index], keep)
                continue
            while waiting and len(pending) < _IN_FLIGHT * count:
                index = waiting.popleft()
                pending[pool.submit(_run, runs[index], keep)] = index
            finished, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in finished:
                yield pending.pop(future), future.result()
    finally:
        starting.join()
        pool.shutdown(wait=not pending, cancel_futures=True)


def _answer() -> None:
    """Do nothing: whoever does is there."""


def _run(scenario: Scenario, keep: tuple[str, ...] | None) -> xr.Dataset:
    failure = ""
    try:
        with warnings.catch_warnings():
            # Other processes cannot warn here, and a hundred runs should not warn a hundred times.
            warnings.simplefilter("ignore", ScenarioWarning)
            result = simulate(scenario)
    except IntegrationError as error:
        assert error.result is not None
        failure, result = str(error), error.result
    if keep is not None:
        for name in keep:
            if name not in result:
                raise InputError(
                    "variables", f"there is no such variable; there are {', '.join(map(str, result))}", name
                )
        result = result[list(keep)]
    return result.assign_attrs(failure=failure)


def _check_alike(runs: Sequence[Scenario]) -> None:
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


def _stack(runs: Sequence[Scenario], results: Sequence[xr.Dataset | None]) -> xr.Dataset:
    found = [result for result in results if result is not None]
    longest = max(found, key=lambda result: result.sizes["time"])
    length = len(runs[0].sample_times())
    times = runs[0].sample_times()
    stacked: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    for name, variable in longest.data_vars.items():
        values = np.full((len(found), length, *variable.shape[1:]), np.nan)
        for row, result in enumerate(found):
            values[row, : result.sizes["time"]] = result[name].values
        stacked[str(name)] = (("run", *map(str, variable.dims)), values, dict(variable.attrs))
    for name in _PER_RUN:
        stacked[name] = (("run",), np.array([result.attrs[name] for result in found]), {"long_name": name})
    stacked["failure"] = (("run",), np.array([result.attrs["failure"] for result in found]), {"long_name": "failure"})
    scenarios = np.array([result.attrs["scenario"] for result in found])
    stacked["scenario"] = (("run",), scenarios, {"long_name": "resolved scenario, TOML"})
    shared = {key: value for key, value in longest.attrs.items() if key.startswith("version_")}
    coordinates = {name: coordinate for name, coordinate in longest.coords.items() if name != "time"}
    return xr.Dataset(
        stacked,
        coords={"time": ("time", times, dict(longest.time.attrs)), "run": np.arange(len(found)), **coordinates},
        attrs=shared,
    )
