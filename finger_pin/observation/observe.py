"""Observation of a finger: from readings of its motors to angles, tensions and contact forces with bands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import xarray as xr

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.recordings.motions import find_recording
from finger_pin.exceptions import Interrupted
from finger_pin.observation.observer import Observer
from finger_pin.observation.readings import ReadingsLike, read_readings, regular
from finger_pin.progress import ProgressBar


def observe(
    scenario: ScenarioLike,
    readings: ReadingsLike | None = None,
    *,
    uncertain: Mapping[str, float] | xr.Dataset | None = None,
    sensors: Mapping[str, Mapping[str, float]] | None = None,
    forces: Iterable[str] | Mapping[str, float] = ("fingertip",),
    period: float = 1e-3,
    level: float = 0.95,
    progress: bool = False,
    stop: Stop | None = None,
) -> xr.Dataset | Observer:
    """Return what a finger did, from readings of its sensors; without readings an `Observer`, to be stepped.

        result = fp.observe("wound", "log.csv")
        result.joint_position, result.joint_position_low, result.joint_position_high

    It knows the scenario's finger, but not what surrounds it: contact is what it finds.

    Args:
        scenario: A scenario, its name, or the path of its file.
        readings: A CSV file with the columns ``time``, s, ``motor_position.NAME``, rad, ``motor_current.NAME``, A, and
            so on, with or without a unit behind the name; a table with its ``path``, ``time`` and ``columns`` where
            it has other names or scales, as a signal's file in a scenario; motors and inputs of a recording of a bench,
            ``BENCH`` or ``BENCH:RECORDING``, with the values that hold for it alone; or times, shape (m,), and columns
            by name, shape (m,), in SI. Cells may be empty.
        uncertain: By key of the scenario the standard deviation of a number as a part of it; or the result of an
            identification, whose intervals count. By default 10 % of frictions, springs and stiffnesses, and 2 % of
            radii.
        sensors: By name, as ``motor_current.servo``, the ``resolution`` and ``noise`` (a standard deviation) in SI.
        forces: Tips at which something may press, ``fingertip`` for all; or by tip the size of such forces, N.
        period: Of the steps, s; readings may come later.
        level: Of the bands.
        progress: Whether to show a bar.
        stop: Asked before every row; once it is true, the observation ends there, as after Ctrl-C.

    Returns:
        The Dataset of `Observer.result`, or the `Observer`.

    Raises:
        InputError: Naming the argument that is wrong.
        Interrupted: After Ctrl-C or such a stop, with what was observed.
    """
    if recording := find_recording("readings", readings):
        scenario = load_scenario(scenario, recording.values)
    observer = Observer(scenario, uncertain=uncertain, sensors=sensors, forces=forces, period=period, level=level)
    if readings is None:
        return observer
    times, columns, left_out = read_readings(recording or readings, observer.sensors)
    rows, backward = regular(times)
    names, table = list(columns), np.column_stack([*columns.values()])[rows]
    first = {name.removeprefix("motor_position."): float(values[rows[0]]) for name, values in columns.items()}
    motors = {name: first[name] for name in observer.finger.actuators.names if np.isfinite(first.get(name, np.nan))}
    observer.start(motor_position=motors)
    bar = ProgressBar("s", float(times[rows[-1]] - times[rows[0]])) if progress else None
    with CancelToken(stop) as token:
        for k, duration in enumerate(np.diff(times[rows]).tolist(), 1):
            if token():
                break
            observer.step(dict(zip(names, table[k].tolist(), strict=True)), duration)
            if bar is not None and k % 100 == 0:
                bar(observer.time)
    if bar is not None:
        bar.close()
    if token() and not observer.time:
        raise Interrupted(float(times[rows[0]]))
    result = observer.result()
    result["time"] = ("time", result["time"].values + times[rows[0]], {"units": "s"})
    result.attrs["left_out"] = left_out + ([f"{backward} rows whose clock went back"] if backward else [])
    if token():
        raise Interrupted(float(result["time"][-1]), result)
    return result
