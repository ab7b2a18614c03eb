"""The step interface: `finger_pin.Simulator` at 1 kHz on the motion of fig6, commanded from Python."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.runs import rms, settled
from benchmarks.store import Store
from finger_pin.control.proportional import ProportionalController
from finger_pin.references.reference import ReferenceSignals, SignalReference

PERIOD = 1e-3
# Of errors below 1e-4 rad a controller sees less than of its sensors' noise.
TOLERANCE = 5e-4
_ROUNDS = 3


def measure(store: Store) -> Any:
    """Return times and accuracy."""
    return store.part("step-interface", lambda: _study(1.0 if store.quick else 8.0))


def _study(duration: float) -> dict[str, Any]:
    scenario = settled(fp.load_scenario("reversals"), duration=duration, sample_rate=1.0 / PERIOD)
    runs = [_run(scenario) for _ in range(_ROUNDS)]
    exact = fp.simulate(settled(scenario, rtol=1e-9, atol_scale=1e-10), control_period=PERIOD)
    error = runs[0][2] - exact["joint_position"].values
    whole, inside = min(run[0] for run in runs), min(run[1] for run in runs)
    return {
        "duration": duration,
        "period": PERIOD,
        "whole": whole,
        "stepping": inside,
        "real_time_factor": duration / whole,
        "real_time_factor_stepping": duration / inside,
        "error": rms(error),
        "worst": float(abs(error).max()),
    }


def _run(scenario: fp.Scenario) -> tuple[float, float, Any]:
    """Return the wall times of the loop and of its steps, s, and the joint positions at all samples, rad."""
    finger = fp.Finger(scenario.finger)
    controller, reference = (
        ProportionalController.from_scenario(scenario, finger.routing),
        SignalReference.from_scenario(scenario, finger.routing),
    )
    desired = reference.at(scenario.sample_times())
    simulator = fp.Simulator(finger, desired.position[0], rtol=TOLERANCE, atol_scale=TOLERANCE)
    simulator.step(np.ones(finger.routing.actuated), 1e-6)  # Compiles.
    simulator = fp.Simulator(finger, desired.position[0], rtol=TOLERANCE, atol_scale=TOLERANCE)
    state, actuated, inside = simulator.state, finger.routing.actuated, 0.0
    path = [state.position]
    began = time.perf_counter()
    for index, (position, velocity) in enumerate(zip(desired.position[:-1], desired.velocity[:-1], strict=True)):
        signals = ReferenceSignals(position, velocity)
        tension = controller.command(index * PERIOD, signals, state.position, state.velocity).tension[:actuated]
        before = time.perf_counter()
        state = simulator.step(tension, PERIOD)
        inside += time.perf_counter() - before
        path.append(state.position)
    return time.perf_counter() - began, inside, np.array(path)
