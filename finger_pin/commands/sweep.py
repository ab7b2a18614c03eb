"""The command sweep: run a scenario at many points, and draw the metrics of the runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from finger_pin.commands.console import Unsuccessful, print_text
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
    from finger_pin.studies.designs import Design
    from finger_pin.studies.records import Progress

_Over = Annotated[
    list[str],
    typer.Option(
        metavar="KEY=VALUES",
        help="Values of a key: START:STOP:N, START:STOP:N:log or A,B,C; for a latin design LOW:HIGH or "
        "LOW:HIGH:log; repeatable.",
    ),
]
_Design = Annotated[
    Literal["grid", "list", "latin"],
    typer.Option(help="Every combination; first values together, then second ones; a Latin hypercube."),
]
_Output = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where results go; default results/sweep-<scenario and keys>.")
]


def sweep(
    scenario: ScenarioName = "reversals",
    over: _Over = [],  # noqa: B006
    metric: Annotated[list[str], typer.Option(metavar="NAME", help="Metric of the runs; repeatable; see --list.")] = [],  # noqa: B006
    design: _Design = "grid",
    samples: Annotated[int | None, typer.Option(metavar="N", help="Points of a latin design.")] = None,
    seed: Annotated[int | None, typer.Option(metavar="S", help="Of a latin design; default 0.")] = None,
    settings: Settings = [],  # noqa: B006
    output: _Output = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    restart: Restart = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Repeat runs that failed before.")] = False,
    figures: Figures = True,
    format: Format = None,
    quiet: Quiet = False,
    listed: Annotated[bool, typer.Option("--list", help="List metrics, and exit.")] = False,
) -> None:
    """Run a scenario at many points, and draw the metrics of the runs.

    The same command again continues where an earlier one ended, however it ended. For example:

    sweep reversals --over controller.gain=0.5:2:7 --over finger.tendon_friction.coulomb=0.05,0.11,0.2

    sweep reversals --design latin --samples 50 --over controller.gain=0.5:2 --over finger.tendon_friction.drag=0:1
    """
    if listed:
        return print_text(listing())
    _check_options(design, over, samples, seed)
    refuse_format(figures, format)
    if restart and retry_failed:
        raise invalid("--retry-failed", "has no effect with --restart, which repeats all runs")
    changes, executor_context = overrides(settings), open_pool(workers, scheduler)
    from finger_pin.exceptions import StudyError
    from finger_pin.studies import sweep
    from finger_pin.studies.keys import BaseScenario

    points = build_design(design, over, samples, seed or 0)
    name = BaseScenario.from_scenario(scenario, changes).scenario.name
    name_parts = [*over, *metric, *([] if design == "grid" else [design, f"{samples}", f"{seed or 0}"])]
    folder = output or Path("results", folder_name(f"sweep-{name}", *settings, *name_parts))

    def run(progress: Progress | None, stop: Stop) -> xr.Dataset:
        with executor_context as executor:
            try:
                return sweep(
                    scenario,
                    points,
                    metrics=metric or None,
                    overrides=changes,
                    output=folder,
                    executor=executor,
                    restart=restart,
                    retry_failed=retry_failed,
                    progress=progress,
                    stop=stop,
                )
            except StudyError as error:
                return error.result  # the summary says why runs failed

    result = run_study(
        "sweep", run, summary, "sweep", folder, figures=figures, format=format, quiet=quiet, unfinished=is_partial
    )
    if (result["status"] == "failed").all():
        raise Unsuccessful(f"every run failed; the first one: {result['reason'].values.flat[0]}")


def _check_options(design: str, over: list[str], samples: int | None, seed: int | None) -> None:
    """Refuse options that do not go together."""
    if not over:
        raise invalid("--over", "at least one key is needed, such as --over controller.gain=0.5:2:7")
    if (samples is None) == (design == "latin"):
        raise invalid("--samples", "is needed by --design latin, and by no other")
    if seed is not None and design != "latin":
        raise invalid("--seed", "is for --design latin")


def is_partial(result: xr.Dataset) -> bool:
    """Return true if some runs were not made."""
    return bool((result["status"] == "missing").any())


def build_design(kind: str, over: list[str], samples: int | None, seed: int) -> Design:
    """Return the design that the options describe."""
    from finger_pin.exceptions import InputError
    from finger_pin.studies import Grid, LatinHypercube, PointList
    from finger_pin.studies.designs import parse_range, parse_values

    parse: Any = parse_range if kind == "latin" else parse_values
    axes: dict[str, Any] = {}
    for text in over:
        key, values = parse(text)
        if key in axes:
            raise InputError("over", "a key must not come twice", text)
        axes[key] = values
    if kind == "latin":
        return LatinHypercube(axes, samples or 0, seed)
    return PointList(axes) if kind == "list" else Grid(axes)


def summary(result: xr.Dataset) -> str:
    """Return the ranges of the metrics, the number of runs, and the reasons of failures."""
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
    lines += [
        f"  {name.ljust(width)}{least.rjust(12)}{greatest.rjust(12)}  {unit}".rstrip()
        for name, least, greatest, unit in rows
    ]
    reasons = sorted(set(result["reason"].values.ravel()) - {""})
    if reasons:
        lines += ["", "Why runs failed"] + [f"  {reason}" for reason in reasons[:5]]
        lines += [f"  and {len(reasons) - 5} more: see sweep.nc"] if len(reasons) > 5 else []
    return "\n".join(lines)


def listing() -> str:
    """Return the metrics, with a line about each."""
    from finger_pin.studies import DEFAULT_METRICS, METRICS

    lines = [f"  {m.name:21}{m.unit:5}{m.long_name}" for m in METRICS.values()]
    return "\n".join(["Metrics", *lines, "", f"Measured by default: {', '.join(DEFAULT_METRICS)}"])
