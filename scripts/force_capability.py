"""Report and draw the forces that a fingertip can exert at a posture, and the tension that one force needs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from command_line import DONE, INTERRUPTED, Parser, complain, number, positive, told

PROGRAM = "force_capability.py"


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    add = parser.add_argument
    add("finger", nargs="?", default="ub", metavar="FINGER", help="name or path of a .toml file; default ub")
    add("--posture", type=number, nargs="+", metavar="DEG", help="joint angles; default a third of each range")
    add("--limit", type=positive, default=20.0, metavar="N", help="greatest tension; default %(default)s")
    add("--force", type=number, nargs=3, default=(0.0, 0.0, 1.0), metavar="N", help="x y z; default 0 0 1")
    add("--output", type=Path, default=Path("results/force_capability"), metavar="DIR", help="default %(default)s")
    add("--view", action="store_true", help="show the set of forces at the fingertip in the viewer")
    try:
        return run(parser.read(arguments))
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted")
        return INTERRUPTED


def run(options: argparse.Namespace) -> int:
    """Report, draw and show; return the exit code."""
    import finger_pin as fp
    from finger_pin.analysis import Friction
    from finger_pin.commands.console import print_text
    from finger_pin.views.plots import plot_force_polytope, plot_radius_sensitivity, save_figure

    try:
        finger = fp.Finger(fp.load_finger(options.finger))
        limiter = finger.stroke_limiter
        posture = limiter.lower + (limiter.upper - limiter.lower) / 3.0
        if options.posture:
            posture = np.deg2rad(options.posture)
        if len(posture) != len(finger.routing.joints):
            allowed = f"must be {len(finger.routing.joints)} angles, one per joint ({', '.join(finger.routing.joints)})"
            raise fp.InputError("--posture", allowed, options.posture)
        needed = {each: fp.tension_for_force(finger, posture, options.force, friction=each) for each in Friction}
        polytope = fp.force_polytope(finger, posture, options.limit)
        figures = {
            "forces": plot_force_polytope(finger, posture, options.limit),
            "sensitivity": plot_radius_sensitivity(finger, posture, options.force),
        }
        for name, figure in figures.items():
            save_figure(figure, options.output / f"{name}.png")
    except (fp.InputError, OSError) as error:
        return told(PROGRAM, error, options.output)
    lines = [f"Largest tension for a force of {np.linalg.norm(options.force):g} N, N"]
    lines += [f"  friction {friction.value:10} {found.largest:8.3f}" for friction, found in needed.items()]
    print_text("\n".join([*lines, f"Figures are in {options.output}"]))
    if options.view:
        fp.view_forces(finger.description, polytope, tension=needed[Friction.NONE].strands)
    return DONE


if __name__ == "__main__":
    sys.exit(main())
