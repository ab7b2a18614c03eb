"""Run a scenario at many points, measure every run, and draw what came out."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
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
    read_study,
    tell_compilation,
)

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.commands.console import Interrupts
    from finger_pin.studies.designs import Design

PROGRAM = "sweep.py"
EXAMPLE = """examples:
  sweep.py fig6 --over controller.gain=0.5:2:7 --over finger.tendon_friction.coulomb=0.05,0.11,0.2
  sweep.py fig6 --over finger.tendons.T3.crossings.medial.radius=0.005:0.008:4 --metric tension_peak
  sweep.py fig6 --design latin --samples 50 --over controller.gain=0.5:2 --over finger.tendon_friction.coulomb=0.02:0.3

The same command again goes on where an earlier one ended, however it ended."""


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    options = parse(arguments)
    try:
        from finger_pin.commands.console import Interrupts, print_text

        if options.list:
            print_text(listing())
            return DONE
        with Interrupts() as interrupts:
            return run(options, interrupts)
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted; the same command goes on from there")
        return INTERRUPTED


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parse a command line, or exit."""
    plain = argparse.RawDescriptionHelpFormatter
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False, epilog=EXAMPLE, formatter_class=plain)
    add = parser.add_argument
    add("scenario", nargs="?", default="fig6", metavar="SCENARIO", help="name or path of a .toml file; default fig6")
    over = "values of a key: START:STOP:N, START:STOP:N:log or A,B,C; for a latin design LOW:HIGH or LOW:HIGH:log"
    add("--over", action="append", default=[], metavar="KEY=VALUES", help=f"{over}; repeatable")
    add("--metric", action="append", default=[], metavar="NAME", help="what to measure; repeatable; see --list")
    design = "grid: every combination; list: first values together, then second ones; latin: a Latin hypercube"
    add("--design", choices=("grid", "list", "latin"), default="grid", help=f"{design}; default grid")
    add("--samples", type=int, metavar="N", help="points of a latin design")
    add("--seed", type=int, metavar="S", help="of a latin design; default 0")
    add("--output", type=Path, metavar="DIR", help="where results go; default results/sweep-<scenario>")
    add("--retry-failed", action="store_true", help="repeat runs that failed before")
    add("--list", action="store_true", help="list metrics, and exit")
    options = read_study(parser, arguments)
    if not options.list and not options.over:
        parser.error("--over: at least one key is needed, such as --over controller.gain=0.5:2:7")
    if (options.samples is None) == (options.design == "latin"):
        parser.error("--samples: is needed by --design latin, and by no other")
    if options.seed is not None and options.design != "latin":
        parser.error("--seed: is for --design latin")
    return options


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Run the sweep, draw it, tell what came out; return the exit code."""
    from finger_pin.commands.console import print_text, runs_bar
    from finger_pin.exceptions import FingerPinError, InputError, StudyError
    from finger_pin.studies import DEFAULT_METRICS, DaskCluster, LocalProcesses, sweep
    from finger_pin.studies.keys import Starting

    shown = sys.stderr.isatty() and not options.quiet
    try:
        design = build_design(options)
        name = Starting.load(options.scenario, dict(options.set)).scenario.name
        output = options.output or Path("results", f"sweep-{name}")
        executor = DaskCluster(options.scheduler) if options.scheduler else LocalProcesses(options.workers)
        if shown:
            tell_compilation()
        with runs_bar("sweep") if shown else nullcontext() as progress, interrupts.patient():
            try:
                result = sweep(
                    options.scenario,
                    design,
                    metrics=options.metric or DEFAULT_METRICS,
                    overrides=dict(options.set),
                    output=output,
                    executor=executor,
                    restart=options.restart,
                    retry_failed=options.retry_failed,
                    progress=progress,
                    stop=lambda: interrupts.requested,
                )
            except StudyError as error:
                result = error.result
        if options.figures and not interrupts.requested:
            draw(result, output)
    except InputError as error:
        complain(PROGRAM, str(error))
        return WRONG_INPUT
    except (FingerPinError, OSError) as error:
        complain(PROGRAM, f"{error}; the same command goes on from what is recorded")
        return NOT_WRITTEN
    if not options.quiet:
        print_text(f"{summary(result)}\n\nResults are in {output}")
    if interrupts.requested and (result["status"] == "missing").any():
        complain(PROGRAM, "interrupted; the same command goes on from there")
        return INTERRUPTED
    if (result["status"] == "failed").all():
        complain(PROGRAM, f"every run failed; the first one: {result['reason'].values.flat[0]}")
        return FAILED
    return DONE


def build_design(options: argparse.Namespace) -> Design:
    """Return the design that the options describe."""
    from finger_pin.exceptions import InputError
    from finger_pin.studies import Grid, LatinHypercube, Listing
    from finger_pin.studies.spelling import parse_range, parse_values

    parse_one: Any = parse_range if options.design == "latin" else parse_values
    given: dict[str, Any] = {}
    for text in options.over:
        key, values = parse_one(text)
        if key in given:
            raise InputError("over", "a key must not come twice", text)
        given[key] = values
    if options.design == "latin":
        return LatinHypercube(given, options.samples, options.seed or 0)
    return Listing(given) if options.design == "list" else Grid(given)


def draw(result: xr.Dataset, output: Path) -> None:
    """Draw the figure of a sweep."""
    from finger_pin.views.plots import plot_sweep, save_figure

    save_figure(plot_sweep(result), output / "figures" / "sweep.png")


def summary(result: xr.Dataset) -> str:
    """Return the ranges of the metrics, how many runs there are, and why runs failed."""
    status = result["status"].values.ravel()
    counts = [f"{(status == kind).sum()} {kind}" for kind in ("done", "failed", "missing") if (status == kind).any()]
    rows = [("", "least", "greatest", "")]
    for name in result.data_vars:
        if name not in ("status", "reason"):
            values = result[name].values[result["status"].values == "done"]
            ends = (f"{values.min():.4g}", f"{values.max():.4g}") if values.size else ("-", "-")
            rows.append((str(name), *ends, result[name].attrs["units"]))
    width = max(len(row[0]) for row in rows)
    lines = [f"{status.size} runs: {', '.join(counts)}", ""]
    lines += [f"  {a.ljust(width)}{b.rjust(12)}{c.rjust(12)}  {d}".rstrip() for a, b, c, d in rows]
    reasons = sorted(set(result["reason"].values.ravel()) - {""})
    if reasons:
        lines += ["", "Why runs failed"] + [f"  {each}" for each in reasons[:5]]
        lines += [f"  and {len(reasons) - 5} more: see sweep.nc"] if len(reasons) > 5 else []
    return "\n".join(lines)


def listing() -> str:
    """Return the metrics, with a line about each."""
    from finger_pin.studies import DEFAULT_METRICS, METRICS

    lines = [f"  {m.name:21}{m.unit:5}{m.long_name}" for m in METRICS.values()]
    return "\n".join(["Metrics", *lines, "", f"Measured by default: {', '.join(DEFAULT_METRICS)}"])


if __name__ == "__main__":
    sys.exit(main())
