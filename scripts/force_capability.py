"""Report and draw the forces that a fingertip can exert at a posture, and the tension that one force needs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import finger_pin as fp
from finger_pin.analysis import Friction, tension_for_force
from finger_pin.plots import save_figure
from finger_pin.plots.force_capability import plot_force_polytope, plot_radius_sensitivity


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("finger", nargs="?", default="ub", help="name or path; default ub")
    parser.add_argument("--posture", type=float, nargs="+", metavar="DEG", help="joint angles; default a third of each")
    parser.add_argument("--limit", type=float, default=20.0, metavar="N", help="greatest tension; default 20")
    parser.add_argument("--force", type=float, nargs=3, default=(0.0, 0.0, 1.0), metavar="N", help="default 0 0 1")
    parser.add_argument("--output", type=Path, default=Path("results/force_capability"), help="where figures go")
    options = parser.parse_args()
    try:
        finger = fp.Finger(fp.load_finger(options.finger))
        limiter = finger.stroke_limiter
        posture = limiter.lower + (limiter.upper - limiter.lower) / 3.0
        if options.posture:
            posture = np.deg2rad(options.posture)
        print(f"Largest tension for a force of {np.linalg.norm(options.force):g} N, N")
        for friction in Friction:
            needed = tension_for_force(finger, posture, options.force, friction=friction)
            print(f"  friction {friction.value:10} {needed.largest:8.3f}")
        figures = {
            "forces": plot_force_polytope(finger, posture, options.limit),
            "sensitivity": plot_radius_sensitivity(finger, posture, options.force),
        }
    except fp.InputError as error:
        print(f"force_capability.py: {error}", file=sys.stderr)
        return 2
    for name, figure in figures.items():
        save_figure(figure, options.output / f"{name}.png")
    print(f"Figures are in {options.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
