"""The command play: a scenario in real time in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from finger_pin.commands.options import ScenarioName, Settings, overrides


def play(
    scenario: ScenarioName = "fig6",
    settings: Settings = [],  # noqa: B006
    keys: Annotated[list[str], typer.Option("--change", metavar="KEY", help="Add a slider for it; repeatable.")] = [],  # noqa: B006
    rtol: Annotated[float, typer.Option(metavar="X", help="Tolerance of the steps.")] = 1e-3,
    port: Annotated[int, typer.Option(metavar="N", help="Of the page; default a free one.")] = 0,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Where records go.")] = Path("results", "play"),
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Play a scenario in the browser: pull tendons, drag the tip, change friction while it moves."""
    from finger_pin.description.loading import load_scenario
    from finger_pin.playground import play as play_scenario

    loaded = load_scenario(scenario, overrides(settings))
    play_scenario(loaded, keys=keys, rtol=rtol, port=port, folder=output, open_browser=browser, block=True)
