"""Simulate the paper's Fig. 6 and draw its figures, with the losses and the energy account, into one folder."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import xarray as xr
from command_line import DONE, FAILED, INTERRUPTED, WRONG_INPUT, Parser, complain

from finger_pin.commands.console import print_text, progress_bar
from finger_pin.description.loading import load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import IntegrationError
from finger_pin.simulation.simulate import simulate
from finger_pin.views.plots import draw_all, plot_friction_law, plot_workspace, save_figure

PROGRAM = "reproduce.py"
# The paper prints no numbers for its Fig. 6: these go with the scenario's references and gains, after its start.
SETTLED = 1.0
EXPECTED_ERRORS = {"abduction": "near 0.5", "proximal": "near 0.8", "medial": "near 1.1", "distal": "near 1.7"}
EXPECTED_TENSIONS = {"T3": "up to about 9", "T5": "1 to 7, never slack"}


def main(arguments: list[str] | None = None) -> int:
    """Simulate, draw, and say what came out; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    parser.add_argument("--output", type=Path, default=Path("results/paper"), metavar="DIR", help="default %(default)s")
    folder = parser.read(arguments).output
    scenario = load_scenario("fig6")
    try:
        paths = [
            save_figure(plot_workspace(scenario.finger), folder / "fig2.png"),
            save_figure(plot_friction_law(), folder / "fig3.png"),
        ]
        result = run(scenario)
        paths += draw_all(result, folder)
    except IntegrationError as error:
        complain(PROGRAM, f"{error}")
        return FAILED
    except OSError as error:
        complain(PROGRAM, f"--output = {folder}: cannot be written: {error.strerror or error}")
        return WRONG_INPUT
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted")
        return INTERRUPTED
    print_text("\n".join([*comparison(result), "", *map(str, paths)]))
    return DONE


def run(scenario: Scenario) -> xr.Dataset:
    """Return the result of a scenario; on a terminal, show how far it is."""
    bar = progress_bar(scenario.simulation.duration) if sys.stderr.isatty() else nullcontext()
    with bar as progress:
        return simulate(scenario, progress=progress)


def comparison(result: xr.Dataset) -> list[str]:
    """Return lines with the largest tracking errors and the ranges of the tensions, beside what is expected."""
    settled = result.sel(time=slice(SETTLED, None))
    if not settled.sizes["time"]:
        return [f"The simulation ends within the first {SETTLED:g} s: there is nothing to compare."]
    rows = [(f"After the first {SETTLED:g} s", "simulated", "expected")]
    for name in result["joint"].values:
        error = np.rad2deg(float(abs(settled["tracking_error"].sel(joint=name)).max()))
        rows.append((f"largest error, {name} (°)", f"{error:.2f}", EXPECTED_ERRORS.get(name, "")))
    for name in result["tendon"].values:
        tension = settled["tendon_tension"].sel(tendon=name)
        rows.append(
            (
                f"tension, {name} (N)",
                f"{float(tension.min()):.1f} to {float(tension.max()):.1f}",
                EXPECTED_TENSIONS.get(name, ""),
            )
        )
    return [f"{what:30}{value:>12}   {expected}".rstrip() for what, value, expected in rows]


if __name__ == "__main__":
    sys.exit(main())
