"""The command reproduce: the paper's figures."""

from __future__ import annotations

from pathlib import Path

from finger_pin.commands.console import print_text, progress_bar, shows_progress
from finger_pin.commands.options import Format, Output


def reproduce(output: Output = Path("results/paper"), format: Format = None) -> None:
    """Simulate the scenario fig6, draw the paper's Figs. 2, 3 and 6, and say how far each printed curve is met."""
    shown = shows_progress(quiet=False)
    from finger_pin.description.loading import load_scenario
    from finger_pin.simulation.simulate import simulate
    from finger_pin.views.plots import draw_all, save_figure
    from paper.plot_fig6 import plot_printed
    from paper.plot_friction_law import plot_friction_law
    from paper.plot_workspace import plot_workspace
    from paper.printed import Printed, curves, table

    scenario = load_scenario("fig6")
    paths = [
        save_figure(plot_workspace(scenario.finger), output / "fig2", format),
        save_figure(plot_friction_law(), output / "fig3", format),
    ]
    with progress_bar(shown, scenario.simulation.duration) as progress:
        result = simulate(scenario, progress=progress)
    paths += draw_all(result, output, format=format)
    printed = Printed.from_bench()
    paths.append(save_figure(plot_printed(result, printed), output / "fig6_printed", format))
    print_text("\n".join([*table(curves(result, printed)), "", *map(str, paths)]))
