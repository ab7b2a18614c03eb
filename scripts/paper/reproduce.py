"""The command reproduce: the paper's figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.commands.console import print_text, progress_bar, talks
from finger_pin.commands.options import Format, Output

if TYPE_CHECKING:
    import xarray as xr

# The paper prints no numbers for its Fig. 6: these go with the scenario's references and gains, after its start.
SETTLED = 1.0
EXPECTED_ERRORS = {"abduction": "near 0.5", "proximal": "near 0.8", "medial": "near 1.1", "distal": "near 1.7"}
EXPECTED_TENSIONS = {"T3": "up to about 9", "T5": "1 to 7, never slack"}


def reproduce(output: Output = Path("results/paper"), format: Format = None) -> None:
    """Simulate the scenario fig6 and draw the paper's figures, with the losses and the energy account."""
    shown = talks(quiet=False)
    from finger_pin.description.loading import load_scenario
    from finger_pin.simulation.simulate import simulate
    from finger_pin.views.plots import draw_all, save_figure
    from paper.plot_friction_law import plot_friction_law
    from paper.plot_workspace import plot_workspace

    scenario = load_scenario("fig6")
    paths = [
        save_figure(plot_workspace(scenario.finger), output / "fig2", format),
        save_figure(plot_friction_law(), output / "fig3", format),
    ]
    with progress_bar(shown, scenario.simulation.duration) as progress:
        result = simulate(scenario, progress=progress)
    paths += draw_all(result, output, format=format)
    print_text("\n".join([*comparison(result), "", *map(str, paths)]))


def comparison(result: xr.Dataset) -> list[str]:
    """Return lines with the largest tracking errors and the ranges of the tensions, beside those expected."""
    import numpy as np

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
