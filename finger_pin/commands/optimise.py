"""The command optimise: search for designs that no other one is better than."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finger_pin.commands.console import Unsuccessful
from finger_pin.commands.options import (
    Figures,
    Format,
    Quiet,
    Restart,
    ScenarioName,
    Scheduler,
    Settings,
    Workers,
    folder_name,
    invalid,
    open_pool,
    overrides,
    refuse_format,
    run_study,
)

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.cancellation import Stop
    from finger_pin.studies.records import Progress

_Over = Annotated[
    list[str],
    typer.Option(
        metavar="KEY=RANGE",
        help="Range of a key, LOW:HIGH or LOW:HIGH:log; keys that go together are KEY,KEY2,-KEY3; repeatable; "
        "default the finger's radii.",
    ),
]
_Constraint = Annotated[
    list[str],
    typer.Option(
        metavar="BOUND",
        help="NAME>=VALUE or NAME<=VALUE; repeatable; default self_locking_margin>=1.5 and fingertip_force>=0.8.",
    ),
]
_Output = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where results go; default results/optimise-<scenario, goals>.")
]


def optimise(
    scenario: ScenarioName = "reversals",
    over: _Over = [],  # noqa: B006
    minimise: Annotated[list[str], typer.Option(metavar="NAME", help="Metric to be made small; repeatable.")] = [],  # noqa: B006
    maximise: Annotated[list[str], typer.Option(metavar="NAME", help="Metric to be made large; repeatable.")] = [],  # noqa: B006
    constraint: _Constraint = [],  # noqa: B006
    no_constraints: Annotated[bool, typer.Option("--no-constraints", help="Keep every design that runs.")] = False,
    population: Annotated[int | None, typer.Option(metavar="N", help="Designs of a generation; default 24.")] = None,
    generations: Annotated[int | None, typer.Option(metavar="N", help="Default 20.")] = None,
    seed: Annotated[int | None, typer.Option(metavar="S", help="Of the search; default 0.")] = None,
    settings: Settings = [],  # noqa: B006
    output: _Output = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    restart: Restart = False,
    figures: Figures = True,
    format: Format = None,
    quiet: Quiet = False,
) -> None:
    """Search for designs that no other one is better than: small, large and bounded metrics over chosen numbers.

    Without arguments: the winding radii of the paper's finger, tracking error against peak tension. Designs that
    cannot keep their tendons taut do not count. The same command again continues where an earlier one ended, however it
    ended. For example:

    optimise reversals --over controller.gain=0.5:4 --minimise tracking_rms --minimise losses --no-constraints

    optimise reversals --minimise tension_peak --constraint "tracking_rms<=0.006" --constraint "self_locking_margin>=2"

    simulate results/optimise-reversals/front/01.toml
    """
    if no_constraints and constraint:
        raise invalid("--no-constraints", "contradicts --constraint")
    refuse_format(figures, format)
    search_options = {"population": population, "generations": generations, "seed": seed}
    effort = {name: value for name, value in search_options.items() if value is not None}
    changes, executor_context = overrides(settings), open_pool(workers, scheduler)
    from finger_pin.studies import DEFAULT_CONSTRAINTS, DEFAULT_OBJECTIVES, Effort, optimise
    from finger_pin.studies.keys import BaseScenario

    goals = [*over, *minimise, *(f"max.{name}" for name in maximise), *constraint, *["no-constraints"] * no_constraints]
    study = f"optimise-{BaseScenario.from_scenario(scenario, changes).scenario.name}"
    folder = output or Path(
        "results", folder_name(study, *settings, *goals, *(f"{key}={effort[key]}" for key in effort))
    )

    def run(progress: Progress | None, stop: Stop) -> xr.Dataset:
        with executor_context as executor:
            return optimise(
                scenario,
                over or None,
                minimise=minimise or (() if maximise else DEFAULT_OBJECTIVES),
                maximise=maximise,
                constraints=constraint or (() if no_constraints else DEFAULT_CONSTRAINTS),
                effort=Effort(**effort),
                overrides=changes,
                output=folder,
                executor=executor,
                restart=restart,
                progress=progress,
                stop=stop,
            )

    result = run_study("search", run, summary, "pareto", folder, figures=figures, format=format, quiet=quiet)
    if not result["feasible"].any():
        raise Unsuccessful("no design keeps all constraints")


def summary(result: xr.Dataset) -> str:
    """Return the table of the front and the starting design."""
    metrics = [str(name) for name in result.data_vars if "units" in result[name].attrs]
    keys = [str(key) for key in result.coords]
    status, feasible = result["status"].values, result["feasible"].values
    count = int(result["front"].max())
    header = f"{status.size} designs: {feasible.sum()} keep all bounds, {count} on the front"
    failed = int((status == "failed").sum())
    note = (
        f"; {failed} cannot be run (tendons that cannot be kept taut, or a run that failed: see optimise.nc)"
        if failed
        else ""
    )
    columns = {name: [f"{value:.4g}" for value in result[name].values] for name in (*metrics, *keys)}
    designs = [("start", 0), *((f"{n:02d}", int((result["front"].values == n).argmax())) for n in range(1, count + 1))]
    width = max(len(label(result, name)) for name in columns)
    lines = [f"{header}{note}", "", f"  {'design'.ljust(width)}" + "".join(title.rjust(11) for title, _ in designs[:8])]
    lines += [
        f"  {label(result, name).ljust(width)}" + "".join(values[row].rjust(11) for _, row in designs[:8])
        for name, values in columns.items()
    ]
    if len(designs) > 8:
        lines.append(f"  and {len(designs) - 8} more designs on the front: see front.csv")
    return "\n".join(lines)


def label(result: xr.Dataset, name: str) -> str:
    """Return a short name of a metric or key with its unit."""
    from finger_pin.views.plots.sweep_metrics import short_key

    return f"{short_key(name)} ({result[name].attrs['units']})"
