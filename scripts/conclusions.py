"""Put the paper's three conclusions to the test: figures, and a table of what was claimed, measured and found."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from command_line import DONE, INTERRUPTED, Parser, complain, told

if TYPE_CHECKING:
    from finger_pin.description.scenario import Scenario
    from finger_pin.studies.conclusions import Finding

PROGRAM = "conclusions.py"
PARTS = {
    "a": "tendon friction depends on the posture",
    "b": "joint friction depends on the sum of the tensions",
    "c": "force closure sets the passive tendon's tension",
}


@dataclass(frozen=True)
class Experiment:
    """What measures, judges and draws one conclusion; the name of its figure, its runs, and whom it refuses."""

    measure: Callable[..., Any]
    judge: Callable[[Any], list[Finding]]
    draw: Callable[[Any], Any]
    figure: str
    runs: int
    check: Callable[[Scenario], None] = lambda scenario: None


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    add = parser.add_argument
    add("scenario", nargs="?", default="fig6", metavar="SCENARIO", help="name or path of a .toml file; default fig6")
    add("--only", choices=tuple(PARTS), help="; ".join(f"{part}: {text}" for part, text in PARTS.items()))
    add("--output", type=Path, default=Path("results/conclusions"), metavar="DIR", help="default %(default)s")
    add("--quiet", action="store_true", help="print errors only")
    options = parser.read(arguments)
    try:
        return run(options.scenario, options.only or "abc", options.output, options.quiet)
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted; what was complete is in the folder of results")
        return INTERRUPTED


def run(name: str, parts: str, output: Path, quiet: bool) -> int:
    """Run the experiments, write, show; return the exit code."""
    from finger_pin.commands.console import count_bar, print_text
    from finger_pin.description.loading import load_scenario
    from finger_pin.exceptions import InputError, IntegrationError
    from finger_pin.studies.conclusions import findings_table, write_findings
    from finger_pin.views.plots import save_figure

    try:
        scenario = load_scenario(name)
        findings: list[Finding] = []
        chosen = experiments(parts)
        for each in chosen:
            each.check(scenario)
        bar = count_bar(sum(each.runs for each in chosen)) if sys.stderr.isatty() and not quiet else nullcontext()
        with bar as progress:
            for each in chosen:
                found = each.measure(scenario, progress=progress)
                findings += each.judge(found)
                # As soon as it is there: who interrupts keeps it.
                save_figure(each.draw(found), output / each.figure)
                write_findings(findings, output / "conclusions.csv")
    except (InputError, IntegrationError, OSError) as error:
        return told(PROGRAM, error, output)
    if not quiet:
        print_text(f"{findings_table(findings)}\nFigures and table are in {output}")
    return DONE


def experiments(chosen: str) -> list[Experiment]:
    """Return what measures, judges and draws the chosen conclusions."""
    from finger_pin.studies import conclusions as e
    from finger_pin.views import plots as p

    table = {
        "a": Experiment(
            e.transmission, e.transmission_findings, p.plot_transmission, "transmission.png", e.TRANSMISSION_RUNS
        ),
        "b": Experiment(
            e.friction_influence,
            e.influence_findings,
            p.plot_friction_influence,
            "friction_influence.png",
            e.INFLUENCE_RUNS,
            e.check_influence,
        ),
        "c": Experiment(
            e.passive_delivery,
            e.delivery_findings,
            p.plot_passive_delivery,
            "passive_delivery.png",
            e.DELIVERY_RUNS,
            e.check_delivery,
        ),
    }
    return [table[part] for part in chosen]


if __name__ == "__main__":
    sys.exit(main())
