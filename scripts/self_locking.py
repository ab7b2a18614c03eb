"""Report the joint friction at which a finger locks, draw its map, and show runs on both sides of it."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from command_line import DONE, INTERRUPTED, Parser, complain, told

if TYPE_CHECKING:
    import finger_pin as fp

PROGRAM = "self_locking.py"
SHARES = (0.5, 0.8, 0.9, 1.1, 1.4)


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    add = parser.add_argument
    add("scenario", nargs="?", default="fig6", metavar="SCENARIO", help="name or path of a .toml file; default fig6")
    add("--output", type=Path, default=Path("results/self_locking"), metavar="DIR", help="default %(default)s")
    options = parser.read(arguments)
    try:
        return run(options.scenario, options.output)
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted")
        return INTERRUPTED


def run(name: str, output: Path) -> int:
    """Report and draw; return the exit code."""
    import finger_pin as fp
    from finger_pin.commands.console import print_text
    from finger_pin.views.plots import plot_critical_friction, plot_runaway, plot_self_locking_map, save_figure

    try:
        scenario = fp.load_scenario(name)
        finger, margin = scenario.finger, fp.self_locking_margin(scenario)
        lines = ["Joint friction at which the finger locks, mm"]
        for joint in finger.joints:
            lines.append(f"  {joint:12} {1e3 * fp.critical_friction(finger, joints=[joint]).coefficient:8.3f}")
        lines.append(f"  {'all joints':12} {1e3 * fp.critical_friction(finger).coefficient:8.3f}")
        lines.append(
            f"On its reference, {scenario.name} stays a factor {margin.margin:.3g} below, least at {margin.time:.3g} s"
        )
        figures = {
            "critical_friction": plot_critical_friction(finger),
            "map": plot_self_locking_map(fp.self_locking_map(fp.Finger(finger))),
        }
        if np.isfinite(margin.margin):
            with warnings.catch_warnings():
                # Runs on both sides are the point.
                warnings.simplefilter("ignore", fp.SelfLockingWarning)
                runs = {
                    f"{share:g} of critical": fp.simulate(scaled(name, scenario, share * margin.margin))
                    for share in SHARES
                }
            figures["runs"] = plot_runaway(runs)
        for title, figure in figures.items():
            save_figure(figure, output / f"{title}.png")
    except (fp.InputError, fp.IntegrationError, OSError) as error:
        return told(PROGRAM, error, output)
    print_text("\n".join([*lines, f"Figures are in {output}"]))
    return DONE


def scaled(name: str, scenario: fp.Scenario, factor: float) -> fp.Scenario:
    """Return the scenario with M^c of the joints times a factor, and M^d alike: sliding is no easier than starting."""
    import finger_pin as fp

    static = (factor * np.asarray(scenario.finger.joint_friction.stiction)).tolist()
    return fp.load_scenario(name, {f"finger.joint_friction.{key}": static for key in ("coulomb", "stiction")})


if __name__ == "__main__":
    sys.exit(main())
