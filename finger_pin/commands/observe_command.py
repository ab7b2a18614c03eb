"""The command observe: from a log of motor signals to joint angles, tensions and touch, with bands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from finger_pin.commands.console import print_text, shows_progress
from finger_pin.commands.options import (
    Figures,
    Format,
    Quiet,
    ScenarioName,
    Settings,
    folder_name,
    invalid,
    number,
    overrides,
    pairs,
    refuse_format,
)
from finger_pin.exceptions import InputError, Interrupted

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.description.scenario import Scenario


def observe(
    scenario: ScenarioName,
    log: Annotated[
        str,
        typer.Argument(
            metavar="LOG",
            help="CSV file: columns time, motor_position.NAME, motor_current.NAME; or a bench, or BENCH:RECORDING.",
        ),
    ],
    settings: Settings = [],  # noqa: B006
    uncertain: Annotated[
        list[str], typer.Option(metavar="KEY=PART", help="Standard deviation of a number, as a part of it; repeatable.")
    ] = [],  # noqa: B006
    fit: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="identification.nc of identify: its estimates, and intervals for --uncertain."
        ),
    ] = None,
    forces: Annotated[
        list[str],
        typer.Option("--force", metavar="TIP=N", help="Tip that something may press on, and how hard; repeatable."),
    ] = [],  # noqa: B006
    period: Annotated[float, typer.Option(metavar="S", help="Of the steps.")] = 1e-3,
    level: Annotated[float, typer.Option(metavar="P", help="Of the bands.")] = 0.95,
    output: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where results go; default results/<scenario>_observed.")
    ] = None,
    figures: Figures = True,
    format: Format = None,
    quiet: Quiet = False,
) -> None:
    """Tell joint angles, tensions and touch from a log of motor signals, with bands.

    The finger is the scenario's; what surrounds it is not looked at. For example: observe wound log.csv
    """
    changes = overrides(settings)
    refuse_format(figures, format)
    spreads = _numbers("--uncertain", uncertain, "KEY=PART, such as finger.tendon_friction.coulomb=0.1")
    sizes = _numbers("--force", forces, "TIP=N, such as fingertip=0.15")
    if fit is not None and uncertain:
        raise invalid("--uncertain", f"has no effect with --fit: intervals are those of {fit}")
    from finger_pin.description.loading import load_scenario

    loaded, left_out = load_scenario(scenario, changes), list[str]()
    known: dict[str, float] | xr.Dataset | None = spreads or None
    if fit is not None:
        loaded, known, left_out = _with_fit(loaded, fit, changes)
    output = output or Path("results", folder_name(f"{loaded.name}_observed", *settings))
    if output.exists() and not output.is_dir():
        raise InputError("output", "is a file; name a folder", str(output))
    options = {"uncertain": known, "forces": sizes or ("fingertip",), "period": period, "level": level}
    result, problem = _observe(loaded, log, options | {"progress": shows_progress(quiet)})
    result.attrs["left_out"] += left_out
    # After an interruption figures are not drawn: that takes too long.
    _write(result, output, figures and problem is None, format)
    if not quiet:
        from finger_pin.views.observation_text import summarize_observed

        print_text(f"{summarize_observed(result)}\n\nResults are in {output}")
    if problem is not None:
        problem.add_note(f"what was observed is in {output}")
        raise problem


def _observe(scenario: Scenario, log: str, options: dict[str, Any]) -> tuple[xr.Dataset, Interrupted | None]:
    """Return the observation as far as it goes, and the interruption that ended it, or None."""
    from finger_pin.observation.observe import observe

    try:
        return cast("xr.Dataset", observe(scenario, log, **options)), None
    except Interrupted as error:
        if error.result is None:
            error.add_note("nothing was observed")
            raise
        return error.result, error


def _numbers(option: str, texts: list[str], form: str) -> dict[str, float]:
    return {key: number(f"{option} {key}", value) for key, value in pairs(option, texts, form).items()}


def _with_fit(scenario: Scenario, path: Path, changes: dict[str, Any]) -> tuple[Scenario, xr.Dataset, list[str]]:
    """Return a scenario with the estimates of an identification, its result about the scenario, and what else it has.

    Args:
        scenario: The scenario.
        path: File of the result.
        changes: Other overrides, by key, which may not be of the same entries.
    """
    from finger_pin.identification.parameters.keys import recording_pattern
    from finger_pin.identification.parameters.scenarios import with_parameters
    from finger_pin.simulation.netcdf import load

    try:
        fit = load(path)
    except OSError as error:
        raise invalid("--fit", f"{path}: cannot be read: {error.strerror or error}") from None
    if not {"parameter", "estimate"} <= {*fit.variables}:
        raise invalid("--fit", f"{path}: must be the result of an identification, identification.nc")
    # An offset of one recording's column says nothing of the finger.
    apart = [str(key) for key in fit["parameter"].values if recording_pattern(str(key))]
    fit = fit.drop_sel(parameter=apart)
    estimates = {
        str(key): float(value) for key, value in zip(fit["parameter"].values, fit["estimate"].values, strict=True)
    }
    entries = {key.partition("[")[0] for key in estimates}
    if twice := [key for key in changes if key.partition("[")[0] in entries]:
        raise invalid("--set", f"{twice[0]}: --fit sets the same entry")
    return with_parameters(scenario, estimates), fit, [f"{key} of the fit" for key in apart]


def _write(result: xr.Dataset, output: Path, figures: bool, format: str | None) -> None:
    """Write a result and its figure; a figure of an earlier result does not stay beside it."""
    from finger_pin.simulation.netcdf import save
    from finger_pin.views.plots import plot_observed, save_figure
    from finger_pin.views.plots.figure_files import FORMATS

    output.mkdir(parents=True, exist_ok=True)
    for ending in FORMATS:
        (output / "figures" / f"observed.{ending}").unlink(missing_ok=True)
    save(result, output / "observed.nc")
    if figures:
        save_figure(plot_observed(result), output / "figures" / "observed", format)
