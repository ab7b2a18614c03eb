"""Writes the recording of the bench `to_and_fro`, which is made up: its numbers are known, and stand in the bench."""

import csv
import sys

import numpy as np
from intervals import motion

COULOMB, DRAG, DELAY, TURN = 0.12, 0.4, 0.03, np.pi / 2.0


def main(arguments: list[str] | None = None) -> int:
    """Write the CSV file that is named."""
    (path,) = sys.argv[1:] if arguments is None else arguments
    found = motion(np.random.default_rng(23), COULOMB, DRAG, DELAY, TURN)
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", "force_in_N", "force_out_N", "angle_rad"])
        writer.writerows([[f"{value:.4f}" for value in row] for row in zip(*found.values(), strict=True)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
