"""Search for designs that no other one is better than: small, large and bounded metrics over chosen numbers.

Without arguments: the winding radii of the paper's finger, tracking error against peak tension.
"""

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

PROGRAM = "optimise.py"
EXAMPLE = """examples:
  optimise.py
  optimise.py fig6 --over controller.gain=0.5:4 --minimise tracking_rms --minimise losses
  optimise.py fig6 --minimise tension_peak --constraint "tracking_rms<=0.006" --constraint "self_locking_margin>=2"
  simulate.py results/optimise-fig6/front/01.toml

Force closure is always asked for. The same command again goes on where an earlier one ended, however it ended."""


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    options = parse(arguments)
    try:
        from finger_pin.commands.console import Interrupts

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
    over = "range of a key, LOW:HIGH or LOW:HIGH:log; keys that go together are KEY,KEY2,-KEY3; repeatable"
    add("--over", action="append", default=[], metavar="KEY=RANGE", help=f"{over}; default the finger's radii")
    add("--minimise", action="append", default=[], metavar="NAME", help="metric to be made small; repeatable")
    add("--maximise", action="append", default=[], metavar="NAME", help="metric to be made large; repeatable")
    bound = "NAME>=VALUE or NAME<=VALUE; repeatable; default self_locking_margin>=1.5 and fingertip_force>=0.8"
    add("--constraint", action="append", metavar="BOUND", help=bound)
    add("--no-constraints", action="store_true", help="ask for force closure alone")
    add("--population", type=int, metavar="N", help="designs of a generation; default 24")
    add("--generations", type=int, metavar="N", help="default 20")
    add("--seed", type=int, metavar="S", help="of the search; default 0")
    add("--output", type=Path, metavar="DIR", help="where results go; default results/optimise-<scenario>")
    options = read_study(parser, arguments)
    if options.no_constraints and options.constraint:
        parser.error("--no-constraints: contradicts --constraint")
    return options


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Search, draw, tell what came out; return the exit code."""
    from finger_pin.commands.console import print_text, runs_bar
    from finger_pin.exceptions import FingerPinError, InputError
    from finger_pin.studies import (
        DEFAULT_CONSTRAINTS,
        DEFAULT_OBJECTIVES,
        DaskCluster,
        Effort,
        LocalProcesses,
        optimise,
    )
    from finger_pin.studies.keys import Starting
    from finger_pin.views.plots import plot_pareto, save_figure

    shown = sys.stderr.isatty() and not options.quiet
    effort: dict[str, Any] = {
        name: getattr(options, name)
        for name in ("population", "generations", "seed")
        if getattr(options, name) is not None
    }
    if options.constraint is None:
        options.constraint = [] if options.no_constraints else DEFAULT_CONSTRAINTS
    try:
        name = Starting.load(options.scenario, dict(options.set)).scenario.name
        output = options.output or Path("results", f"optimise-{name}")
        executor = DaskCluster(options.scheduler) if options.scheduler else LocalProcesses(options.workers)
        if shown:
            tell_compilation()
        with runs_bar("search") if shown else nullcontext() as progress, interrupts.patient():
            result = optimise(
                options.scenario,
                options.over or None,
                minimise=options.minimise or (() if options.maximise else DEFAULT_OBJECTIVES),
                maximise=options.maximise,
                constraints=options.constraint,
                effort=Effort(**effort),
                overrides=dict(options.set),
                output=output,
                executor=executor,
                restart=options.restart,
                progress=progress,
                stop=lambda: interrupts.requested,
            )
        if options.figures and not interrupts.requested:
            save_figure(plot_pareto(result), output / "figures" / "pareto.png")
    except InputError as error:
        complain(PROGRAM, str(error))
        return WRONG_INPUT
    except (FingerPinError, OSError) as error:
        complain(PROGRAM, f"{error}; the same command goes on from what is recorded")
        return NOT_WRITTEN
    if not options.quiet:
        print_text(f"{summary(result)}\n\nResults are in {output}")
    if interrupts.requested:
        complain(PROGRAM, "interrupted; the same command goes on from there")
        return INTERRUPTED
    if not result["feasible"].any():
        complain(PROGRAM, "no design keeps all constraints")
        return FAILED
    return DONE


def summary(result: xr.Dataset) -> str:
    """Return the table of the front, and the starting design beside it."""
    metrics = [str(name) for name in result.data_vars if "units" in result[name].attrs]
    keys = [str(key) for key in result.coords]
    status, feasible = result["status"].values, result["feasible"].values
    count = int(result["front"].max())
    head = f"{status.size} designs: {feasible.sum()} keep all bounds, {count} on the front"
    failed = int((status == "failed").sum())
    note = f"; {failed} cannot be run (no force closure, or a run that failed: see optimise.nc)" if failed else ""
    columns = {name: [f"{value:.4g}" for value in result[name].values] for name in (*metrics, *keys)}
    shown = [("start", 0), *((f"{n:02d}", int((result["front"].values == n).argmax())) for n in range(1, count + 1))]
    width = max(len(label(result, name)) for name in columns)
    lines = [f"{head}{note}", "", f"  {'design'.ljust(width)}" + "".join(mark.rjust(11) for mark, _ in shown[:8])]
    lines += [
        f"  {label(result, name).ljust(width)}" + "".join(values[row].rjust(11) for _, row in shown[:8])
        for name, values in columns.items()
    ]
    if len(shown) > 8:
        lines.append(f"  and {len(shown) - 8} more designs on the front: see front.csv")
    return "\n".join(lines)


def label(result: xr.Dataset, name: str) -> str:
    """Return a short name of a metric or key with its unit."""
    from finger_pin.views.plots.sweep import short_key

    return f"{short_key(name)} ({result[name].attrs['units']})"


if __name__ == "__main__":
    sys.exit(main())
