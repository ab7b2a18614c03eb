"""Writes the recordings of the benches `to_and_fro` and `weights`, made up: their numbers stand in the benches."""

import csv
import sys

import numpy as np
from intervals import Made, motion

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


MADE = {"to_and_fro": to_and_fro, "weights": weights}


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
