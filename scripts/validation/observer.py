"""How true the observer is: its estimates and bands against fingers with other numbers, whose motion is known.

Every seed is a finger whose uncertain numbers are drawn with the standard deviations that the observer is told, read
every millisecond through an encoder's steps and a current with noise. Beside the observer stand two others: the posture
by lengths, in which the nominal finger rests without friction at the angles of its motors, and the same filter with a
model without friction. A second table says how soon a force of 1 N at the tip is seen.
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

import finger_pin as fp
from finger_pin.analysis import settled_posture
from finger_pin.commands.console import bar, print_text
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.parameters import Winch
from finger_pin.description.scenario import Scenario
from finger_pin.typing import Array

#: Parts of the observer's default deviations by which the fingers are off, and which it is told.
SPREADS = (1.0, 0.3)
QUANTITIES = {"joint_position": "angles, rad", "tendon_tension": "tendons, N", "spool_tension": "spools, N"}
#: When a force begins to press on the tip, and to let go, s; the motor stands still during the second.
TOUCHES = ((1.0, 1.4), (2.4, 2.8))
# Its size, N, how long it takes to rise and to fall, and within what it is seen soon, s.
_FORCE, _RAMP, _SOON = 1.0, 0.05, 0.1
# Of the sensors: the encoder's step, rad; the current's noise and step, A.
_ENCODER, _NOISE, _STEP = 1.534e-3, 3e-3, 1e-3
# Readings between those that are compared, and angles of a single motor between which postures are interpolated.
_STRIDE, _KNOTS = 50, 25


@dataclass(frozen=True)
class Case:
    """A finger to observe.

    Attributes:
        scenario: Its name.
        both: Overrides of it that the observer knows.
        truth: Overrides that it does not know.
    """

    scenario: str
    both: dict[str, Any] = field(default_factory=dict)
    truth: dict[str, Any] = field(default_factory=dict)


_SERVO = "finger.actuators.servo"
CASES = {
    "wound": Case("wound"),
    # Its motion repeats itself after that.
    "servo_position": Case("servo_position", {"simulation.duration": 4.0}),
    "underactuated": Case("underactuated"),
    "play": Case("wound", {f"{_SERVO}.motor.friction.backlash": 0.01745}),
    "structure": Case(
        "wound",
        truth={
            f"{_SERVO}.tendon_hysteresis": 0.1,
            "finger.joint_friction.drag": 2e-3,  # N m
            "finger.tendon_friction.stribeck_exponent": 2.0,
        },
    ),
    "touch": Case("wound"),
}

HEAD = "finger          seeds  part quantity        rms lengths no frict inside  band touched"
TOUCH_HEAD = "touch           seeds  part motor         soon seen, s still gone, s"


class Run(NamedTuple):
    """One truth and what was observed of it; all over the times of the readings but the first."""

    truth: xr.Dataset
    observed: xr.Dataset
    frictionless: xr.Dataset | None


def table(name: str, seeds: int) -> list[str]:
    """Return the lines of a case, for all spreads."""
    runs: list[list[Run]] = []
    with bar(sys.stderr.isatty(), "fingers", len(SPREADS) * seeds) as show:
        for spread in SPREADS:
            show(len(runs) * seeds, text=f"{name}, {spread:g} of the deviations")
            runs.append([observed(name, seed, spread) for seed in range(seeds)])
    return touch_lines(runs) if name == "touch" else quantity_lines(name, runs)


def print_tables(names: tuple[str, ...], seeds: int) -> None:
    """Print the tables of some cases, of some fingers each."""
    for name in names:
        head = TOUCH_HEAD if name == "touch" else HEAD
        print_text("\n".join([head, *table(name, seeds), ""]))


def model(case: Case, truth: bool = False) -> Scenario:
    """Return a case's scenario without objects, as the observer knows it, or as it is."""
    overrides = case.both | (case.truth if truth else {})
    return fp.load_scenario(case.scenario, overrides).updated(environment={"objects": {}})


def observed(name: str, seed: int, spread: float) -> Run:
    """Draw a truth, move it, and observe it with friction and, unless it is touched, without."""
    case, rng = CASES[name], np.random.default_rng(seed)
    known, pressed = model(case), name == "touch"
    parts, drawn = drawn_truth(case, known, rng, spread)
    if pressed:
        drawn = fp.load_scenario(drawn, {"environment.fingertip_force_signal.y": pressing()})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        truth = fp.simulate(drawn)
    readings = read(truth, rng)
    ideal = None
    if not pressed:
        rest = {key: part for key, part in parts.items() if not rubs(key)}
        ideal = fp.observe(frictionless(known, tuple(parts)), readings, uncertain=rest)
    return Run(truth.isel(time=slice(1, None)), fp.observe(known, readings, uncertain=parts), ideal)


def pressing() -> dict[str, Any]:
    """Return the force that presses on the tip along y, as a signal."""
    times = [t for begin, end in TOUCHES for t in (begin, begin + _RAMP, end, end + _RAMP)]
    return {"kind": "points", "times": times, "values": [0.0, -_FORCE, -_FORCE, 0.0] * len(TOUCHES)}


def drawn_truth(
    case: Case, known: Scenario, rng: np.random.Generator, spread: float
) -> tuple[dict[str, float], Scenario]:
    """Return what the observer is told of its numbers, as parts of them, and a scenario with others drawn."""
    numbers = fp.observe(known).uncertainty
    parts = dict(zip(numbers.keys, (spread * numbers.deviations / np.abs(numbers.values)).tolist(), strict=True))
    values = numbers.values + spread * numbers.deviations * rng.standard_normal(len(numbers.keys))
    return parts, ParametrisedScenario(model(case, truth=True), numbers.keys).with_values(values.tolist())


def read(truth: xr.Dataset, rng: np.random.Generator) -> tuple[Array, dict[str, Array]]:
    """Return times and what the motors' sensors tell of a run."""
    angle = np.round(truth.motor_position.values / _ENCODER) * _ENCODER
    current = truth.motor_current.values + _NOISE * rng.standard_normal(truth.motor_current.shape)
    columns = {}
    for k, motor in enumerate(truth.motor.values):
        columns[f"motor_position.{motor}"] = angle[:, k]
        columns[f"motor_current.{motor}"] = np.round(current[:, k] / _STEP) * _STEP
    return truth.time.values, columns


def rubs(key: str) -> bool:
    """Return whether a key is a number of friction."""
    return "friction" in key


def frictionless(known: Scenario, keys: tuple[str, ...]) -> Scenario:
    """Return a scenario with all friction that it has at zero."""
    frictions = tuple(key for key in keys if rubs(key))
    return ParametrisedScenario(known, frictions).with_values([0.0] * len(frictions))


def by_lengths(known: Scenario, angles: Array) -> dict[str, Array]:
    """Return angles and tensions of a finger at rest without friction at angles of its motors, shape (m, k).

    Of a single motor they are interpolated between some of its angles.
    """
    actuators = [*known.finger.actuators.values()]
    lengths = {each.tendons[0]: each.tendon_rigidity / each.tendon_length for each in actuators}
    winches = {
        name: known.finger.tendons[name].updated(winch=Winch(stiffness=each, damping=0.0))
        for name, each in lengths.items()
    }
    finger = fp.Finger(known.finger.updated(actuators={}, tendons=known.finger.tendons | winches))
    radius = np.array([np.ravel(each.spool_radius)[0] for each in actuators])
    stretch = np.array([each.pretension for each in actuators]) / np.array([*lengths.values()])
    knots = np.linspace(angles.min(), angles.max(), _KNOTS)[:, None] if angles.shape[1] == 1 else angles
    found: dict[str, list[Array]] = {name: [] for name in QUANTITIES}
    position = None
    for angle in knots:
        wound = radius * angle + stretch
        position = settled_posture(finger, wound, guess=position)
        signals = finger.evaluate(finger.rest_state(position), wound)
        found["joint_position"].append(position)
        for name in ("tendon_tension", "spool_tension"):
            found[name].append(np.asarray(signals[name]))
    columns = {name: np.array(rows) for name, rows in found.items()}
    if knots is angles:
        return columns
    return {
        name: np.column_stack([np.interp(angles[:, 0], knots[:, 0], each) for each in rows.T])
        for name, rows in columns.items()
    }


def quantity_lines(name: str, runs: list[list[Run]]) -> list[str]:
    """Return a line by spread and quantity: rms of the worst component, share inside, and mean band over 1.96 rms."""

    def rows(part: list[Run], of: str, variable: str) -> Array:
        return np.concatenate([getattr(run, of)[variable].values[::_STRIDE] for run in part])

    rest = by_lengths(model(CASES[name]), rows([each for part in runs for each in part], "truth", "motor_position"))
    lines, begin = [], 0
    for spread, part in zip(SPREADS, runs, strict=True):
        touched = np.mean([told(run.observed).mean() for run in part])
        for variable, title in QUANTITIES.items():
            truth = rows(part, "truth", variable)
            low, high = (rows(part, "observed", f"{variable}_{end}") for end in ("low", "high"))
            error, ideal = (rms(rows(part, of, variable) - truth) for of in ("observed", "frictionless"))
            lengths = rms(rest[variable][begin : begin + len(truth)] - truth)
            inside = np.mean((truth >= low - 1e-9) & (truth <= high + 1e-9))
            band = np.mean(0.5 * np.mean(high - low, axis=0) / 1.96 / error)
            lines.append(
                f"{name:15s} {len(part):5d} {spread:5g} {title:11s} {error.max():7.3f} {lengths.max():7.3f} "
                f"{ideal.max():8.3f} {inside:6.1%} {band:5.2f} {touched:7.1%}"
            )
        begin += len(truth)
    return lines


def told(observed: xr.Dataset) -> Array:
    """Return whether any tip is said to be touched, over time."""
    touched = observed.touched.values
    return np.asarray(touched.reshape(len(touched), -1).any(axis=1))


def rms(errors: Array) -> Array:
    """Return the root of the mean square of every column."""
    result: Array = np.sqrt(np.mean(errors**2, axis=0))
    return result


def touch_lines(runs: list[list[Run]]) -> list[str]:
    """Return a line by spread and touch: shares seen soon and held until the end, and medians of delays."""
    lines = []
    for spread, part in zip(SPREADS, runs, strict=True):
        for (begin, end), motor in zip(TOUCHES, ("moves", "stands still"), strict=True):
            seen, still, gone = np.array([delays(run.observed, begin, end) for run in part]).T
            after = np.median(gone[still > 0.0]) if still.any() else np.nan
            lines.append(
                f"{'touch':15s} {len(part):5d} {spread:5g} {motor:12s} {np.mean(seen <= _SOON):5.0%} "
                f"{np.median(seen):7.3f} {still.mean():5.0%} {after:7.3f}"
            )
    return lines


def delays(observed: xr.Dataset, begin: float, end: float) -> tuple[float, float, float]:
    """Return how long after its beginning a touch is told, s, whether still at its end, and how long it is after that.

    Infinite where it is not told at all; the last is nan where it is not told at the end.
    """
    time, touched = observed.time.values, told(observed)
    seen = time[touched & (time >= begin) & (time < end)]
    if not touched[np.searchsorted(time, end)]:
        return float(seen[0] - begin) if seen.size else np.inf, 0.0, np.nan
    over = time[~touched & (time > end)]
    return float(seen[0] - begin), 1.0, float(over[0] - end) if over.size else np.inf
