"""The command conclusions: put the paper's three conclusions to the test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from finger_pin.commands.console import count_bar, error_note, print_text, shows_progress
from finger_pin.commands.options import Format, Output, Quiet, ScenarioName

if TYPE_CHECKING:
    from finger_pin.description.scenario import Scenario
    from paper.findings import Finding


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
    shown = shows_progress(quiet)
    from finger_pin.description.loading import load_scenario
    from finger_pin.mechanism.coerce import one_finger
    from finger_pin.views.plots import save_figure
    from paper.findings import findings_table, write_findings

    loaded = load_scenario(scenario)
    one_finger(loaded.finger)
    findings: list[Finding] = []
    chosen = experiments(only or "abc")
    for each in chosen:
        each.check(loaded)
    with (
        count_bar(shown, sum(each.runs for each in chosen)) as progress,
        error_note(f"what was complete is in {output}"),
    ):
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
    from paper import delivery, findings, influence, plot_delivery, plot_influence, plot_posture, posture

    table = {
        "a": Experiment(
            posture.transmission,
            findings.transmission_findings,
            plot_posture.plot_transmission,
            "transmission",
            posture.TRANSMISSION_RUNS,
        ),
        "b": Experiment(
            influence.friction_influence,
            findings.influence_findings,
            plot_influence.plot_friction_influence,
            "friction_influence",
            influence.INFLUENCE_RUNS,
            influence.check_influence,
        ),
        "c": Experiment(
            delivery.passive_delivery,
            findings.delivery_findings,
            plot_delivery.plot_passive_delivery,
            "passive_delivery",
            delivery.DELIVERY_RUNS,
            delivery.check_delivery,
        ),
    }
    return [table[part] for part in chosen]
