"""Friction models M1 to M6 of servos and ours on the recordings of a real one: one split, one metric.

M1 to M6 are of Duclusaud, Passault, Padois and Ly, "Extended friction models for the physics simulation of servo
actuators", arXiv 2410.08650, simulated and fitted as their authors do (github.com/Rhoban/bam): fixed steps, friction
that is clipped to what stops the rotor, and the mean absolute error of the angle as the cost. All are fitted to the
recordings that the bench `servo_pendulum` fits, and measured on those that it holds out, from the same initial states,
by the same position loop, supply and pendulum. Ours are the numbers that `identify` finds, run by the bench's own
evaluation; so are M4's once more, as the same friction in our core.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import differential_evolution

from finger_pin.description.loading import load_bench
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.parameters import Parameters
from finger_pin.identification.parameters.scenarios import with_recorded_values
from finger_pin.identification.residuals.models import recording_models
from finger_pin.identification.residuals.recordings import Recording, read_recording
from finger_pin.identification.residuals.residuals import Residuals

BENCH, SERVO, ARM = "servo_pendulum", "servo", "arm"
_ACTUATOR = f"finger.actuators.{SERVO}."
MOTOR = ("torque_constant", "resistance", "inertia")
_GEARS = {"K_v": "viscous", "K_c": "coulomb", "K_l": "by_load", "K_cs": "stribeck", "K_ls": "stribeck_by_load"}
_GEARS |= {"v_s": "stribeck_velocity", "alpha": "stribeck_exponent"}
#: Keys of the bench, below the motor, for the parameters of M1 to M4.
KEYS = {name: name for name in MOTOR} | {name: f"friction.{key}" for name, key in _GEARS.items()}
#: What `python scripts/identify.py servo_pendulum --starts 1 --no-profiles` finds.
OURS = {"torque_constant": 0.37851, "resistance": 3.4528, "inertia": 0.0021892}
OURS |= {"K_c": 0.001, "K_l": 0.21214, "K_ls": 0.019969, "K_v": 0.0077933}
#: The quantities of the motor and of M6, in the order of the compiled functions' `p`.
QUANTITIES = (
    *(*MOTOR, "offset", "K_v"),
    *("K_c", "K_m", "K_e", "K_cs", "K_ms", "K_es", "K_mq", "K_eq", "v_s", "alpha"),
)
#: Bounds: of the motor the bench's, else the authors', wider for the quadratic coefficients, v_s and alpha.
BOUNDS = {
    **{"torque_constant": (0.2, 0.8), "resistance": (2.0, 8.0), "inertia": (2e-4, 1e-2)},  # N m/A, ohm, kg m2
    "offset": (-0.1, 0.1),  # rad
    "K_v": (0.0, 0.1),  # N m s/rad
    **dict.fromkeys(("K_c", "K_cs"), (0.0, 0.2)),  # N m
    **dict.fromkeys(("K_l", "K_m", "K_e"), (0.0, 0.5)),  # 1
    **dict.fromkeys(("K_ls", "K_ms", "K_es"), (0.0, 1.0)),  # 1
    **dict.fromkeys(("K_mq", "K_eq"), (0.0, 0.5)),  # 1/(N m)
    "v_s": (0.1, 10.0),  # rad/s
    "alpha": (0.5, 10.0),  # 1
}
#: One coefficient for both torques, as of M3 and M4, is M6's with both equal.
SHARED = {"K_l": ("K_m", "K_e"), "K_ls": ("K_ms", "K_es")}
#: The friction parameters of every model; what a model has not is zero in M6.
MODELS = {
    "M1": ("K_v", "K_c"),
    "M2": ("K_v", "K_c", "K_cs", "v_s", "alpha"),
    "M3": ("K_v", "K_c", "K_l"),
    "M4": ("K_v", "K_c", "K_l", "K_cs", "K_ls", "v_s", "alpha"),
    "M5": ("K_v", "K_c", "K_m", "K_e", "K_cs", "K_ms", "K_es", "v_s", "alpha"),
    "M6": ("K_v", "K_c", "K_m", "K_e", "K_cs", "K_ms", "K_es", "K_mq", "K_eq", "v_s", "alpha"),
}
#: The repository's names of parameters.
PUBLISHED = {
    **{"kt": "torque_constant", "R": "resistance", "armature": "inertia", "q_offset": "offset"},
    **{"friction_viscous": "K_v", "friction_base": "K_c", "friction_stribeck": "K_cs"},
    **{"load_friction_base": "K_l", "load_friction_motor": "K_m", "load_friction_external": "K_e"},
    **{"load_friction_stribeck": "K_ls", "load_friction_motor_stribeck": "K_ms"},
    **{"load_friction_external_stribeck": "K_es", "load_friction_motor_quad": "K_mq"},
    **{"load_friction_external_quad": "K_eq", "dtheta_stribeck": "v_s", "alpha": "alpha"},
}


class Motion(NamedTuple):
    """A recorded motion as the simulation reads it.

    Attributes:
        goal: Goal of the position loop at every step, rad.
        rig: Gain of the loop, 1/rad; supply, V; current limit, A; gravity torque, N m; inertia of the load, kg m2.
        step: Length of a step, s.
        at: Times of samples in steps from the first.
        measured: Measured angles, rad.
        held_out: Whether it is predicted, not fitted.
    """

    name: str
    goal: np.ndarray
    rig: np.ndarray
    step: float
    at: np.ndarray
    measured: np.ndarray
    held_out: bool


@njit
def friction_level(motor: float, external: float, speed: float, p: np.ndarray) -> float:
    """Return the greatest friction torque of M6, N m, of the motor's and the external torque, N m, and speed, rad/s."""
    share = np.exp(-((abs(speed) / p[13]) ** p[14])) if speed != 0.0 else 1.0
    steady = p[5] + abs(p[6] * motor - p[7] * external)
    quadratic = 0.0
    # Against each other alone: torques that drive the same way have none in the authors' code.
    if motor * external < 0.0:
        quadratic = p[12] * external**2 if abs(motor) > abs(external) else p[11] * motor**2
    return p[4] * abs(speed) + steady + share * (p[8] + abs(p[9] * motor - p[10] * external) + quadratic)


@njit
def advance(angle: float, speed: float, goal: float, rig: np.ndarray, p: np.ndarray, step: float) -> tuple:
    """Return angle, rad, and speed, rad/s, after a step."""
    gain, supply, limit, gravity, load = rig
    voltage = supply * min(max(gain * (goal - angle), -1.0), 1.0)
    motor = p[0] * min(max((voltage - p[0] * speed) / p[1], -limit), limit)
    external = -gravity * np.sin(angle + p[3])
    inertia = p[2] + load
    # The torque without which the next speed would be zero bounds what friction can do.
    stopping = inertia / step * speed + motor + external
    level = friction_level(motor, external, speed, p)
    if abs(stopping) <= level:
        return angle + 0.5 * step * speed, 0.0
    after = (stopping - np.copysign(level, stopping)) * step / inertia
    return angle + 0.5 * step * (speed + after), after


@njit
def roll_out(goal: np.ndarray, rig: np.ndarray, p: np.ndarray, step: float) -> np.ndarray:
    """Return the angles at all steps, from rest at zero, rad."""
    angles, angle, speed = np.empty(len(goal)), 0.0, 0.0
    for k in range(len(goal)):
        angles[k] = angle
        angle, speed = advance(angle, speed, goal[k], rig, p, step)
    return angles


def quantities(values: Mapping[str, float]) -> np.ndarray:
    """Return the quantities of M6 for the parameters of any model."""
    whole = dict.fromkeys(QUANTITIES, 0.0) | {"v_s": 1.0, "alpha": 1.0}
    for name, value in values.items():
        whole |= dict.fromkeys(SHARED.get(name, (name,)), value)
    return np.array([whole[name] for name in QUANTITIES])


def simulate(motion: Motion, values: Mapping[str, float]) -> np.ndarray:
    """Return the angles of a model at the samples of a motion, rad."""
    angles = roll_out(motion.goal, motion.rig, quantities(values), motion.step)
    return np.interp(motion.at, np.arange(len(angles)), angles)


def errors(motions: Sequence[Motion], values: Mapping[str, float]) -> list[np.ndarray]:
    """Return measured less simulated angles of every motion, rad."""
    return [motion.measured - simulate(motion, values) for motion in motions]


def read_motion(scenario: Scenario, recording: Recording, step: float) -> Motion:
    """Return a recording of the bench with its loop, supply and pendulum, in fixed steps.

    Raises:
        InputError: If a step is none, or longer than the time between samples.
    """
    if not 0.0 < step <= float(np.diff(recording.time).max()):
        raise InputError("--step", "must be above 0 and not longer than the time between samples, 0.0126 s", step)
    scenario = with_recorded_values(scenario, recording.name, recording.settings)
    actuator, link = scenario.finger.actuators[SERVO], scenario.finger.joints[ARM].link
    motor, lever = actuator.motor, link.centre_of_mass
    gravity = float(np.linalg.norm(scenario.finger.gravity)) * link.mass * lever
    inertia = link.mass * lever**2 + link.transverse_inertia
    rig = (actuator.position_loop.proportional, motor.voltage, motor.maximum_current, gravity, inertia)
    times = recording.time - recording.time[0]
    (goal,), (measured,) = recording.inputs.values(), recording.outputs.values()
    steps = step * np.arange(np.ceil(times[-1] / step) + 1.0)
    held_out = bool(recording.settings.held_out)
    return Motion(recording.name, np.interp(steps, times, goal), np.array(rig), step, times / step, measured, held_out)


def core_errors(recordings: Sequence[Recording], values: Mapping[str, float], more: Mapping[str, float]) -> list:
    """Return measured less computed angles of parameters of M1 to M4 by the bench's own evaluation, rad."""
    keys = {f"{_ACTUATOR}motor.{KEYS[name]}": value for name, value in values.items()}
    scenario, _ = load_bench(BENCH, {**more, **keys})
    models, signals = recording_models(scenario, recordings, None, [np.ones(len(r.time), bool) for r in recordings])
    return Residuals(scenario, Parameters({}, models), models, signals).residuals(np.zeros(0))


def fit(
    motions: Sequence[Motion], names: Sequence[str], start: Mapping[str, float], generations: int
) -> dict[str, float]:
    """Return the parameters with the least mean absolute error of two searches, one with the start among its first."""

    def cost(values: np.ndarray) -> float:
        return measures(errors(motions, dict(zip(names, values.tolist(), strict=True))))[0]

    bounds = [BOUNDS[name] for name in names]
    # What a simpler model has not is zero; of v_s and alpha any value does.
    first = [start.get(name, 0.0 if low <= 0.0 else low) for name, (low, _) in zip(names, bounds, strict=True)]
    settings = {"maxiter": generations, "popsize": 72 // len(names), "tol": 1e-4, "mutation": (0.4, 0.9), "rng": 0}
    places = [first, None] if start else [None]
    searches = [differential_evolution(cost, bounds, x0=each, polish=False, **settings) for each in places]
    best = min(searches, key=lambda search: search.fun)
    return dict(zip(names, best.x.tolist(), strict=True))


def fit_all(
    motions: Sequence[Motion], models: Sequence[str], offset: bool, generations: int
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the models with their fitted parameters; a search starts at the best of the models before."""
    fitted: list[dict[str, float]] = []
    for model in models:
        names = (*MOTOR, *(["offset"] if offset else []), *MODELS[model])
        starts = [{name: value for name, value in each.items() if name in names} for each in fitted]
        start = min(starts, key=lambda each: measures(errors(motions, each)), default={})
        values = fit(motions, names, start, generations)
        shared = {each: values[name] for name, equal in SHARED.items() if name in values for each in equal}
        fitted.append(values | shared)
        yield model, values


def published(folder: Path) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the models with the parameters that their authors give, of files such as ``m1.json``.

    Raises:
        InputError: If the folder has no such file.
    """
    for model in MODELS:
        path = folder / f"{model.lower()}.json"
        if not path.is_file():
            raise InputError("--published", f"must be bam/params/xl330 of Rhoban/bam, with {path.name}", folder)
        entries = json.loads(path.read_text(encoding="utf-8"))
        yield model, {symbol: float(entries[name]) for name, symbol in PUBLISHED.items() if name in entries}


def measures(residuals: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return the mean absolute value and the root mean square of all samples."""
    samples = np.concatenate(residuals)
    return float(np.mean(np.abs(samples))), float(np.sqrt(np.mean(samples**2)))


def row(name: str, count: int, motions: Sequence[Motion], residuals: Sequence[np.ndarray]) -> str:
    """Return a line of the table, mrad."""
    fitted, held_out = (
        [e for motion, e in zip(motions, residuals, strict=True) if motion.held_out == side] for side in (False, True)
    )
    values = [*measures(fitted), *measures(held_out), *(measures([e])[1] for e in held_out)]
    return f"{name:32} {count:3}  " + " ".join(f"{1e3 * value:8.1f}" for value in values)


def print_table(options: argparse.Namespace) -> None:
    """Print the errors of all models and of ours, and the parameters that were found."""
    limit = options.current_limit
    overrides = {} if limit is None else {f"{_ACTUATOR}motor.maximum_current": limit}
    scenario, settings = load_bench(BENCH, overrides)
    recordings = [read_recording(name, each) for name, each in settings.recordings.items()]
    motions = [read_motion(scenario, recording, options.step) for recording in recordings]
    held_out = [motion.name for motion in motions if motion.held_out]
    print(f"{'mrad':32} numbers  fitted: MAE, rms; held out: MAE, rms; rms of {', '.join(held_out)}", flush=True)
    found, given = {}, dict(published(options.published)) if options.published else {}
    to_fit = [motion for motion in motions if not motion.held_out]
    models = [options.only] if options.only else list(MODELS)
    for model, values in fit_all(to_fit, models, options.offset, options.generations):
        found[model] = values
        print(row(model, len(values), motions, errors(motions, values)), flush=True)
    in_core = {"ours": OURS}
    # The bench has no angle at which the pendulum hangs.
    if "M4" in found and not options.offset:
        in_core["M4's in our core"] = found["M4"]
    for name, values in in_core.items():
        print(row(name, len(values), motions, core_errors(recordings, values, overrides)), flush=True)
    for model, values in given.items():
        print(row(f"{model} as published", len(values), motions, errors(motions, values)), flush=True)
    for model, values in found.items():
        print(f"{model}: " + ", ".join(f"{name} {value:.4g}" for name, value in values.items()))


def main(arguments: list[str] | None = None) -> int:
    """Fit the models, predict what is held out, and print the errors of all and of ours."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=MODELS, metavar="MODEL", help="one of: " + ", ".join(MODELS))
    parser.add_argument("--offset", action="store_true", help="fit the angle at which the pendulum hangs, as they do")
    parser.add_argument("--current-limit", type=float, metavar="A", help="of the motor (the bench's; theirs: 1e3)")
    parser.add_argument("--step", type=float, default=0.005, metavar="S", help="of the simulation (0.005, as theirs)")
    parser.add_argument("--generations", type=int, default=200, metavar="N", help="of a search (200)")
    parser.add_argument("--published", type=Path, metavar="FOLDER", help="of parameters: bam/params/xl330 of a clone")
    options = parser.parse_args(arguments)
    try:
        print_table(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
