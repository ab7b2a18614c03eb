"""The printed curves of Fig. 6 beside a result: how far each is off, and whether the print agrees with itself.

The curves are those of the bench `fig6`: read from the vector graphics of the printed page, with gaps in the strokes at
jumps, where lines lie on each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import xarray as xr

from finger_pin.control.build import build_controller
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.recordings.csv_files import read_columns
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class Printed:
    """The printed curves, SI units, not a number inside strokes.

    Attributes:
        time: Shape (m,), s.
        angles: theta, shape (m, 4); the print heads them "references".
        errors: theta^d - theta, shape (m, 4).
        commands: f_hat, shape (m, 5).
        tensions: f, shape (m, 5), of T5 the distal half.
        medial: f5_3, shape (m,).
    """

    time: Array
    angles: Array
    errors: Array
    commands: Array
    tensions: Array
    medial: Array

    @classmethod
    def from_bench(cls) -> Printed:
        """Read the curves that ship with the bench."""
        path = Path(str(resources.files("finger_pin.description").joinpath("benches/fig6.csv")))
        columns = {name: np.asarray(values, dtype=float) for name, values in read_columns("fig6.csv", path).items()}

        def group(pattern: str, count: int) -> Array:
            return np.column_stack([columns[pattern.format(k)] for k in range(1, count + 1)])

        tensions = [columns[f"tension_f{k}_N"] for k in range(1, 5)]
        return cls(
            columns["time_s"],
            group("angle_theta{}_rad", 4),
            group("error_theta{}_rad", 4),
            group("command_f{}_N", 5),
            np.column_stack([*tensions, columns["tension_f5_distal_N"]]),
            columns["tension_f5_medial_N"],
        )


@dataclass(frozen=True)
class Curve:
    """A printed curve beside ours.

    Attributes:
        name: Of the signal.
        unit: rad or N.
        span: Range of the printed curve, in its unit.
        rms: Root mean square of ours less the printed one outside the strokes, in its unit.
    """

    name: str
    unit: str
    span: float
    rms: float

    @property
    def share(self) -> float:
        """The rms as a part of the range."""
        return self.rms / self.span


def curves(result: xr.Dataset, printed: Printed | None = None) -> list[Curve]:
    """Return every printed curve beside that of a result: four angles, four errors, five commands, six tensions."""
    printed = printed or Printed.from_bench()
    at = result.interp(time=printed.time)
    theirs, ours = [], []
    for values, variable, dim in (
        (printed.angles, "joint_position", "joint"),
        (printed.errors, "tracking_error", "joint"),
        (printed.commands, "tendon_command", "tendon"),
        (printed.tensions, "tendon_tension", "tendon"),
    ):
        theirs += list(values.T)
        ours += list(at[variable].transpose(dim, "time").values)
    theirs.append(printed.medial)
    ours.append(at["passive_tension_proximal"].values.reshape(len(printed.time)))
    joints, tendons = [str(each) for each in result["joint"].values], [str(each) for each in result["tendon"].values]
    names = [
        *(f"angle, {name}" for name in joints),
        *(f"error, {name}" for name in joints),
        *(f"command, {name}" for name in tendons),
        *(f"tension, {name}" for name in tendons),
        f"tension, {tendons[-1]} medial",
    ]
    units = ["rad"] * (2 * len(joints)) + ["N"] * (2 * len(tendons) + 1)
    return [
        Curve(name, unit, float(np.nanmax(a) - np.nanmin(a)), _rms(b - a))
        for name, unit, a, b in zip(names, units, theirs, ours, strict=True)
    ]


def _rms(values: Array) -> float:
    """Return the root mean square of what is a number; not a number where nothing is, as in a run that ends early."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def table(found: list[Curve]) -> list[str]:
    """Return lines of a table of curves: range, rms, and rms over range."""
    lines = [f"{'Outside the strokes at jumps':30}{'range':>12}{'rms':>12}{'of it, %':>11}"]
    for each in found:
        span, rms = f"{each.span:.4g} {each.unit}", f"{each.rms:.2g} {each.unit}"
        lines.append(f"{each.name:30}{span:>12}{rms:>12}{100 * each.share:>11.2f}")
    return lines


def commands_from_errors(printed: Printed, gains: tuple[float, ...], scenario: ScenarioLike = "fig6") -> Array:
    """Return f_hat, shape (m, 5), N, by (19), (21) and (22) from the printed errors: no dynamics takes part.

    Args:
        printed: The curves.
        gains: K_P of the four joints, N m/rad.
        scenario: Whose radii and f0 count.
    """
    controller = build_controller(load_scenario(scenario, {"controller.gain": list(gains)}))
    still = np.zeros_like(printed.errors)
    wanted = ReferenceSignals(printed.errors, still)
    return controller.command(printed.time, wanted, still, still).tension


def table_ii(finger: FingerDescription) -> dict[str, float]:
    """Return the radii of a finger by their names in the printed Table II, mm."""
    places = {
        "r11": ("T1", "abduction"),
        "r21": ("T1", "proximal"),
        "r33": ("T3", "medial"),
        "r24": ("T4", "proximal"),
        "r34": ("T4", "medial"),
        "r44": ("T4", "distal"),
        "r35": ("T5", "medial"),
        "r45": ("T5", "distal"),
    }
    return {name: 1e3 * abs(finger.tendons[t].crossings[j].radius) for name, (t, j) in places.items()}
