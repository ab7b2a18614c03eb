"""Report the joint friction at which a finger locks, draw its map, and show runs on both sides of it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import finger_pin as fp
from finger_pin.analysis import critical_friction, self_locking_map, self_locking_margin
from finger_pin.plots import save_figure
from finger_pin.plots.self_locking import plot_critical_friction, plot_runaway, plot_self_locking_map

SHARES = (0.5, 0.8, 0.9, 1.1, 1.4)


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="fig6", help="name or path; default fig6")
    parser.add_argument("--output", type=Path, default=Path("results/self_locking"), help="where figures go")
    options = parser.parse_args()
    try:
        scenario = fp.load_scenario(options.scenario)
    except fp.InputError as error:
        print(f"self_locking.py: {error}", file=sys.stderr)
        return 2
    finger = scenario.finger
    print("Joint friction at which the finger locks, mm")
    for joint in finger.joints:
        print(f"  {joint:12} {1e3 * critical_friction(finger, joints=[joint]).coefficient:8.3f}")
    print(f"  {'all joints':12} {1e3 * critical_friction(finger).coefficient:8.3f}")
    margin = self_locking_margin(scenario)
    print(f"On its reference, {scenario.name} stays a factor {margin.margin:.3g} below, least at {margin.time:.3g} s")
    save_figure(plot_critical_friction(finger), options.output / "critical_friction.png")
    save_figure(plot_self_locking_map(self_locking_map(fp.Finger(finger))), options.output / "map.png")
    if np.isfinite(margin.margin):
        runs = {f"{share:g} of critical": scaled(options.scenario, scenario, share * margin.margin) for share in SHARES}
        save_figure(plot_runaway({label: fp.simulate(run) for label, run in runs.items()}), options.output / "runs.png")
    print(f"Figures are in {options.output}")
    return 0


def scaled(name: str, scenario: fp.Scenario, factor: float) -> fp.Scenario:
    """Return the scenario with M^c of the joints times a factor, and M^d alike: sliding is no easier than starting."""
    static = (factor * np.asarray(scenario.finger.joint_friction.stiction)).tolist()
    return fp.load_scenario(name, {f"finger.joint_friction.{key}": static for key in ("coulomb", "stiction")})


if __name__ == "__main__":
    sys.exit(main())
