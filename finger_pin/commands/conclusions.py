"""The command conclusions: put the paper's three conclusions to the test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from finger_pin.commands.console import count_bar, noted, print_text, talks
from finger_pin.commands.options import Format, Output, Quiet, ScenarioName

if TYPE_CHECKING:
    from finger_pin.description.scenario import Scenario
    from finger_pin.studies.conclusions import Finding


@dataclass(frozen=True)
class Experiment:
    """One conclusion: the functions that measure, judge and draw it, its figure, its runs, its check of scenarios."""

    measure: Callable[..., Any]
    judge: Callable[[Any], list[Finding]]
    draw: Callable[[Any], Any]
    figure: str
    runs: int
    check: Callable[[Scenario], None] = lambda scenario: None


def conclusions(
    scenario: ScenarioName = "fig6",
    only: Annotated[
        Literal["a", "b", "c"] | None,
        typer.Option(
            help="a: tendon friction depends on the posture; b: joint friction depends on the sum of the tensions; "
            "c: force closure sets the passive tendon's tension."
        ),
    ] = None,
    output: Output = Path("results/conclusions"),
    format: Format = None,
    quiet: Quiet = False,
) -> None:
    """Put the paper's three conclusions to the test: figures, and a table of claims, measurements and verdicts."""
    shown = talks(quiet)
    from finger_pin.description.hand import one_finger
    from finger_pin.description.loading import load_scenario
    from finger_pin.studies.conclusions import findings_table, write_findings
    from finger_pin.views.plots import save_figure

    loaded = load_scenario(scenario)
    one_finger(loaded.finger)
    findings: list[Finding] = []
    chosen = experiments(only or "abc")
    for each in chosen:
        each.check(loaded)
    with count_bar(shown, sum(each.runs for each in chosen)) as progress, noted(f"what was complete is in {output}"):
        for each in chosen:
            found = each.measure(loaded, progress=progress)
            findings += each.judge(found)
            # At once, so that an interruption loses nothing that is finished.
            save_figure(each.draw(found), output / each.figure, format)
            write_findings(findings, output / "conclusions.csv")
    if not quiet:
        print_text(f"{findings_table(findings)}\nFigures and table are in {output}")


def experiments(chosen: str) -> list[Experiment]:
    """Return the chosen conclusions."""
    from finger_pin.studies import conclusions as e
    from finger_pin.views import plots as p

    table = {
        "a": Experiment(
            e.transmission, e.transmission_findings, p.plot_transmission, "transmission", e.TRANSMISSION_RUNS
        ),
        "b": Experiment(
            e.friction_influence,
            e.influence_findings,
            p.plot_friction_influence,
            "friction_influence",
            e.INFLUENCE_RUNS,
            e.check_influence,
        ),
        "c": Experiment(
            e.passive_delivery,
            e.delivery_findings,
            p.plot_passive_delivery,
            "passive_delivery",
            e.DELIVERY_RUNS,
            e.check_delivery,
        ),
    }
    return [table[part] for part in chosen]
