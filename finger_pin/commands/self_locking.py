"""The command self-locking: the joint friction at which a finger locks itself."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finger_pin.commands.console import print_text, shows_progress
from finger_pin.commands.options import Format, ScenarioName, invalid

if TYPE_CHECKING:
    from finger_pin.description.scenario import Scenario

FRICTION_FACTORS = (0.5, 0.8, 0.9, 1.1, 1.4)


def self_locking(
    scenario: ScenarioName = "reversals",
    output: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where results go; default results/self_locking.")
    ] = None,
    format: Format = None,
) -> None:
    """Report the joint friction at which a finger locks, draw its map, and show runs on both sides of it.

    Of a finger that springs or bands return it reports the tensions between which the cord holds it, and whether it
    comes back.
    """
    shows_progress(quiet=False)
    import numpy as np

    import finger_pin as fp
    from finger_pin.analysis import self_locking_map, self_locking_margin
    from finger_pin.views.locking_text import summarize_locking, summarize_return
    from finger_pin.views.plots import plot_critical_friction, plot_runaway, plot_self_locking_map, save_figure

    loaded = fp.load_scenario(scenario)
    finger = loaded.finger
    returns = finger.passive_names or any(joint.spring for joint in finger.joints.values())
    if returns and finger.hand is None and not fp.Finger(finger).routing.force_closure().holds:
        if unused := [name for name, value in (("--output", output), ("--format", format)) if value is not None]:
            raise invalid(unused[0], "has no effect: of a finger that springs return nothing is drawn")
        print_text(summarize_return(fp.analysis.spring_return(finger)))
        return
    output = output or Path("results/self_locking")
    margin = self_locking_margin(loaded)
    locking_map = self_locking_map(fp.Finger(finger))
    text = summarize_locking(loaded, locking_map)
    output.mkdir(parents=True, exist_ok=True)
    figures = {"critical_friction": plot_critical_friction(finger), "map": plot_self_locking_map(locking_map)}
    if np.isfinite(margin.margin):
        with warnings.catch_warnings():
            # Runs on both sides of locking are intended, so their warnings are not news.
            warnings.simplefilter("ignore", fp.exceptions.ScenarioWarning)
            runs = {
                f"{factor:g} of critical": fp.simulate(with_scaled_friction(scenario, loaded, factor * margin.margin))
                for factor in FRICTION_FACTORS
            }
        figures["runs"] = plot_runaway(runs)
    for title, figure in figures.items():
        save_figure(figure, output / title, format)
    print_text(f"{text}\n\nFigures are in {output}")


def with_scaled_friction(name: str, scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with M^c of the joints multiplied by a factor, and M^d equal to M^c."""
    import numpy as np

    from finger_pin.description.loading import load_scenario

    friction = scenario.finger.joint_friction
    friction_values = (factor * np.asarray(friction.break_away)).tolist()
    keys = dict.fromkeys(("coulomb", friction.break_away_entry))
    return load_scenario(name, {f"finger.joint_friction.{key}": friction_values for key in keys})
