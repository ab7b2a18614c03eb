"""Writes the recordings of benches that are made up; the numbers that they hide stand in the benches."""

import csv
import sys
from typing import Any

import numpy as np
from intervals import Made, motion
from scipy.integrate import solve_ivp

COULOMB, DRAG, DELAY, TURN = 0.12, 0.4, 0.03, np.pi / 2.0


def to_and_fro() -> Made:
    """Return four seconds of a tendon that is drawn through a quarter turn."""
    found = motion(np.random.default_rng(23), COULOMB, DRAG, DELAY, TURN)
    return dict(zip(["time_s", "force_in_N", "force_out_N", "angle_rad"], found.values(), strict=True))


def weights() -> Made:
    """Return readings of a servo that lifts weights and lets them down, by its torque balance written out."""
    radius, gravity, constant, dry, viscous, lifting, lowering = 0.008, 9.80665, 0.37, 0.012, 4.6e-3, 0.22, 0.08
    weight, speed, way = (
        each.ravel()
        for each in np.meshgrid([0.2, 0.5, 0.8, 1.1, 1.4, 1.7], [1.0, 1.0, 1.0, 3.0, 3.0, 3.0], [1.0, -1.0])
    )
    load = radius * gravity * weight
    lost = dry + viscous * speed + np.where(way > 0.0, lifting, lowering) * load
    current = (load + way * lost) / constant + np.random.default_rng(29).normal(0.0, 4e-3, load.size)
    return {"weight_kg": weight, "spool_speed_rad_s": way * speed, "current_A": current}


def winding() -> Made:
    """Return four seconds of a servo, its current led to and fro, that winds a tendon against a spring."""
    spool, drum, constant, inertia, spring = 0.008, 0.02, 0.37, 1.895e-3, 0.4
    arm, bearing, tendon, damping = 0.02 * (0.04**2 / 3.0 + 0.01**2 / 4.0), 2e-3, 3e4, 10.0
    dry, viscous, winding_in, paying_out, bristles = 0.012, 4.6e-3, 0.22, 0.08, 50.0
    time = np.arange(0.0, 4.0, 0.01)

    def current(at: Any) -> Any:
        return 0.15 - 0.15 * np.cos(2.0 * np.pi * at * np.where(at < 2.0, 0.5, 1.0))

    def rate(at: float, state: np.ndarray) -> list[float]:
        angle, speed, turned, turning, friction = state
        stretch, stretching = spool * angle - drum * turned, spool * speed - drum * turning
        pull = max(tendon * stretch + damping * stretching, 0.0)
        level = dry + (winding_in if speed > 0.0 else paying_out) * spool * pull
        torque = constant * current(at)
        return [
            speed,
            (torque - friction - viscous * speed - spool * pull) / inertia,
            turning,
            (drum * pull - spring * turned - bearing * turning) / arm,
            bristles * (speed - friction * abs(speed) / level),
        ]

    found = solve_ivp(rate, (0.0, time[-1]), np.zeros(5), "Radau", time, rtol=1e-8, atol=1e-10, max_step=0.01)
    step, noise = 2.0 * np.pi / 4096, np.random.default_rng(31).normal(0.0, 1e-3, time.size)
    return {"time_s": time, "current_A": current(time), "angle_rad": step * np.round((found.y[0] + noise) / step) + 0.0}


MADE = {"to_and_fro": to_and_fro, "weights": weights, "winding": winding}


def main(arguments: list[str] | None = None) -> int:
    """Write the CSV file that is named, the recording of the bench that has its name."""
    (path,) = sys.argv[1:] if arguments is None else arguments
    found = MADE[path.replace("\\", "/").rpartition("/")[2].removesuffix(".csv")]()
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(found)
        writer.writerows([[f"{value:.4f}" for value in row] for row in zip(*found.values(), strict=True)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
