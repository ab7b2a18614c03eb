"""Simulate a scenario, write its results, and print a summary."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from command_line import (
    DONE,
    FAILED,
    INTERRUPTED,
    NOT_WRITTEN,
    WRONG_INPUT,
    Parser,
    complain,
    override,
    shorthand,
    tell_compilation,
)

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.commands.console import Interrupts
    from finger_pin.description.scenario import Scenario
    from finger_pin.simulation.results import ResultFolder
    from finger_pin.views.viewer import LiveView

PROGRAM = "simulate.py"


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    options = parse(arguments)
    try:
        # Importing the package takes a second or two: what is wrong with the options is told before.
        from finger_pin.commands import console

        if options.list:
            console.print_text(listing())
            return DONE
        with console.Interrupts() as interrupts:
            return run(options, interrupts)
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted")
        return INTERRUPTED


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parse a command line, or exit."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    add: Callable[..., Any] = parser.add_argument
    flag = argparse.BooleanOptionalAction
    add("scenario", nargs="?", default="fig6", metavar="SCENARIO", help="name or path of a .toml file; default fig6")
    add("--set", action="append", default=[], type=override, metavar="KEY=VALUE", help="override an entry; repeatable")
    for name, key, metavar in (("--duration", "simulation.duration", "S"), ("--method", "simulation.method", "NAME")):
        add(name, action="append", dest="set", type=shorthand(key), metavar=metavar, help=f"override {key}")
    add("--output", type=Path, metavar="DIR", help="where results go; default results/<scenario>")
    add("--view", action=flag, default=False, help="open the viewer and play the result")
    add("--live", action="store_true", help="watch in the viewer while it computes, at most in real time")
    add("--figures", action=flag, default=True, help="draw the figures")
    add("--check", action="store_true", help="repeat the run at a tighter tolerance, and report where the two part")
    add("--quiet", action="store_true", help="print errors only")
    add("--list", action="store_true", help="list scenarios, fingers and methods, and exit")
    return parser.read(arguments)


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Load, simulate, write, show; return the exit code."""
    from finger_pin.commands.console import print_text
    from finger_pin.description.loading import load_scenario
    from finger_pin.exceptions import InputError
    from finger_pin.simulation.convergence import tightened
    from finger_pin.simulation.results import ResultFolder
    from finger_pin.views.summary import summarize

    try:
        scenario = load_scenario(options.scenario, dict(options.set))
        output = options.output or Path("results", scenario.name)
        if options.check:
            tightened(scenario)
        with ResultFolder(output) as folder:
            code, result, problem = simulate(scenario, interrupts, options)
            if result is None:
                complain(PROGRAM, f"{problem}; nothing was computed")
                return code
            if options.check and code == DONE:
                code, result, problem = check(scenario, result, interrupts, options)
            with interrupts.patient():
                folder.write(result)
            if interrupts.requested:
                # Who interrupts wants an end soon: the data are kept, the views are not drawn.
                code, problem = INTERRUPTED, problem or "interrupted"
            else:
                drawn, trouble = draw(result, folder, options.figures)
                code, problem = code or drawn, "; ".join(filter(None, (problem, trouble)))
            with interrupts.patient():
                folder.publish()
    except InputError as error:
        complain(PROGRAM, str(error))
        return WRONG_INPUT
    except OSError as error:
        complain(PROGRAM, f"the results cannot be written, earlier ones are as they were: {error}")
        return NOT_WRITTEN
    if problem:
        complain(PROGRAM, f"{problem}; what was computed is in {output}")
    if not options.quiet:
        print_text(f"{summarize(result)}\n\nResults are in {output}")
    if options.view and code == DONE:
        from finger_pin.views.viewer import view

        view(result)
    return code


def simulate(
    scenario: Scenario, interrupts: Interrupts, options: argparse.Namespace
) -> tuple[int, xr.Dataset | None, str]:
    """Return the exit code, the result as far as it goes, and what went wrong if anything did."""
    from finger_pin.commands.console import progress_bar
    from finger_pin.exceptions import IntegrationError, Interrupted, ScenarioWarning
    from finger_pin.simulation.simulate import simulate

    shown = sys.stderr.isatty() and not options.quiet
    if shown:
        tell_compilation()
    bar = progress_bar(scenario.simulation.duration) if shown else nullcontext()
    with bar as progress, live_view(scenario, options.live) as live, interrupts.patient(), warnings.catch_warnings():
        observe = live.observe if live else None
        try:
            # The summary says what it would say.
            warnings.simplefilter("ignore", ScenarioWarning)
            return DONE, simulate(scenario, progress=progress, observe=observe, stop=lambda: interrupts.requested), ""
        except IntegrationError as error:
            return FAILED, error.result, str(error)
        except Interrupted as error:
            return INTERRUPTED, error.result, str(error)


def check(
    scenario: Scenario, result: xr.Dataset, interrupts: Interrupts, options: argparse.Namespace
) -> tuple[int, xr.Dataset, str]:
    """Return the exit code, the result with its convergence if that could be checked, and what went wrong."""
    from finger_pin.commands.console import progress_bar
    from finger_pin.exceptions import IntegrationError, Interrupted
    from finger_pin.simulation.convergence import check_convergence

    shown = sys.stderr.isatty() and not options.quiet
    bar = progress_bar(scenario.simulation.duration) if shown else nullcontext()
    with bar as progress, interrupts.patient():
        try:
            found = check_convergence(scenario, result, progress=progress, stop=lambda: interrupts.requested)
            return DONE, found.attach(result), ""
        except IntegrationError as error:
            return DONE, result, f"convergence could not be checked: {error}"
        except Interrupted:
            return INTERRUPTED, result, "interrupted before convergence was checked"


def live_view(scenario: Scenario, wanted: bool) -> AbstractContextManager[LiveView | None]:
    """Return a viewer for the time of the simulation, or nothing."""
    if not wanted:
        return nullcontext()
    from finger_pin.views.viewer import LiveView

    return LiveView(scenario.finger, title=scenario.title)


def draw(result: xr.Dataset, folder: ResultFolder, figures: bool) -> tuple[int, str]:
    """Draw animation and figures, all or none; return an exit code and what went wrong if anything did."""
    try:
        from finger_pin.views.viewer import write_animation

        write_animation(result, folder.stage / "animation.html")
        if figures:
            from finger_pin.views.plots import draw_all

            draw_all(result, folder.stage / "figures")
    except KeyboardInterrupt:
        folder.discard_views()
        return INTERRUPTED, "interrupted"
    except OSError:
        raise
    except Exception as error:
        # A result is worth more than its pictures.
        folder.discard_views()
        return NOT_WRITTEN, f"animation and figures cannot be drawn: {type(error).__name__}: {error}"
    return DONE, ""


def listing() -> str:
    """Return the names that the command line takes, with a line about each."""
    from finger_pin.description.loading import list_fingers, list_scenarios
    from finger_pin.description.scenario import METHODS

    tables = {"Scenarios": list_scenarios(), "Fingers": list_fingers(), "Methods": dict.fromkeys(METHODS, "")}
    rows = {title: [f"  {name:15}{text}".rstrip() for name, text in table.items()] for title, table in tables.items()}
    return "\n\n".join("\n".join([title, *lines]) for title, lines in rows.items())


if __name__ == "__main__":
    sys.exit(main())
