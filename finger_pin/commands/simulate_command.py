"""The command simulate: run a scenario, write its results, print a summary."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from finger_pin.cancellation import CancelToken
from finger_pin.commands.console import error_note, print_error, print_text, progress_bar, shows_progress
from finger_pin.commands.options import Figures, Format, Quiet, Settings, folder_name, invalid, overrides, refuse_format
from finger_pin.exceptions import FingerPinError, IntegrationError, Interrupted, ScenarioWarning

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.description.scenario import Scenario
    from finger_pin.simulation.result_folder import ResultFolder


class NotDrawn(FingerPinError):
    """Raised when figures or animation cannot be drawn; the data are kept."""


def simulate(
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="Name, or path of a .toml file.", show_default="fig6")
    ] = None,
    settings: Settings = [],  # noqa: B006
    duration: Annotated[str | None, typer.Option(metavar="S", help="Override simulation.duration.")] = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help="Override simulation.method.")] = None,
    output: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where results go; default results/<scenario and overrides>.")
    ] = None,
    view: Annotated[bool, typer.Option(help="Open the viewer and play the result.")] = False,
    figures: Figures = True,
    format: Format = None,
    check: Annotated[
        bool, typer.Option("--check", help="Repeat the run at a tighter tolerance, and report where the two part.")
    ] = False,
    mujoco: Annotated[
        Path | None, typer.Option(metavar="XML", help="Instead of a scenario: move the hand of a MuJoCo model.")
    ] = None,
    meshes: Annotated[
        str | None,
        typer.Option(metavar="KIND", help="Of --mujoco: fit, none or a kind for its meshes; or NAME=KIND,NAME=KIND."),
    ] = None,
    variables: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Variables to store, such as joint_position,tendon_tension.")
    ] = None,
    quiet: Quiet = False,
    listed: Annotated[bool, typer.Option("--list", help="List scenarios, fingers, hands, methods, and exit.")] = False,
) -> None:
    """Simulate a scenario, write its results, and print a summary."""
    changes = overrides(settings, duration=duration, method=method)
    refuse_format(figures, format)
    if scenario is not None and mujoco is not None:
        raise invalid("SCENARIO", f"{scenario}: --mujoco takes its place")
    if listed:
        if beside := scenario or mujoco:
            raise invalid("--list", f"lists all there is; leave out {beside}")
        print_text(listing())
        return
    from finger_pin.simulation.convergence import scenario_to_repeat

    loaded = _load("fig6" if scenario is None else scenario, mujoco, meshes, changes, quiet)
    output = output or Path("results", default_name(loaded, settings, duration, method, meshes))
    if check:
        scenario_to_repeat(loaded)
    names = None if variables is None else _read_variables(variables, loaded)
    result, problem = _publish(loaded, output, names, quiet, check, figures, format)
    if not quiet:
        from finger_pin.views.summary import summarize

        print_text(f"{summarize(result)}\n\nResults are in {output}")
    if problem is not None:
        problem.add_note(f"what was computed is in {output}")
        raise problem
    if view:
        from finger_pin.views.viewer import view as show_view

        show_view(result, block=True)


def _publish(
    scenario: Scenario,
    output: Path,
    names: list[str] | None,
    quiet: bool,
    check: bool,
    figures: bool,
    format: str | None,
) -> tuple[xr.Dataset, BaseException | None]:
    """Simulate, and write the result with its pictures into its folder, all or nothing.

    Returns:
        The whole result, and the exception that stopped the run or the drawing, or None.
    """
    from finger_pin.simulation.recording import select
    from finger_pin.simulation.result_folder import ResultFolder

    with ResultFolder(output) as folder:
        token = CancelToken()
        result, problem = compute(scenario, token, quiet, check)
        if result is None:
            assert problem is not None
            problem.add_note("nothing was computed")
            raise problem
        with error_note("earlier results are as they were"):
            with token:
                folder.write(result if names is None else select(result, [*names, "convergence_difference"]))
            drawing_problem = draw(result, folder, token, figures, format)
            with token:
                folder.publish()
    return result, (problem or drawing_problem) if token.cancelled else (drawing_problem or problem)


def _read_variables(text: str, scenario: Scenario) -> list[str]:
    """Return the names of the variables to store; pictures and summary are of all."""
    from finger_pin.control.closed_loop import ClosedLoop
    from finger_pin.simulation.recording import check_variables
    from finger_pin.simulation.variables import variables

    names = [name.strip() for name in text.split(",")]
    check_variables("--variables", names, variables(ClosedLoop.from_scenario(scenario)))
    return names


def _load(scenario: str, mujoco: Path | None, meshes: str | None, changes: dict[str, Any], quiet: bool) -> Scenario:
    """Return a scenario by its name, or that of a MuJoCo model, whose meshes become what a text says."""
    from finger_pin.description.loading import load_scenario

    if mujoco is None:
        if meshes is not None:
            raise invalid("--meshes", "has no effect without --mujoco")
        return load_scenario(scenario, changes)
    text = "fit" if meshes is None else meshes
    pairs = [each.partition("=") for each in text.split(",")]
    by_name = {name.strip(): kind.strip() for name, _, kind in pairs}
    if len(by_name) < len(pairs):
        raise invalid("--meshes", f"{text}: names one twice")
    return _mujoco_scenario(mujoco, by_name if "=" in text else text, changes, quiet)


def _mujoco_scenario(path: Path, meshes: str | dict[str, str], changes: dict[str, Any], quiet: bool) -> Scenario:
    """Return a scenario that moves the hand of a MuJoCo model; print the elements that are not carried over."""
    from finger_pin.description.demo_motion import demo_motion, idle_inputs
    from finger_pin.description.loading import read_scenario
    from finger_pin.exceptions import LeftOutWarning
    from finger_pin.exchange.from_mujoco import from_mujoco

    with warnings.catch_warnings():
        if not quiet:
            # The printed list has them.
            warnings.simplefilter("ignore", LeftOutWarning)
        description = from_mujoco(path, path.stem, meshes=meshes)
    if not quiet and description.tree.left_out:
        print_text("\n".join(["Not carried over:", *(f"  {line}" for line in description.tree.left_out), ""]))
    if not quiet and (idle := idle_inputs(description)):
        print_text(f"Held at zero, as their controls have no range: {', '.join(idle)}\n")
    return read_scenario(demo_motion(description), changes)


def default_name(
    scenario: Scenario, settings: list[str], duration: str | None, method: str | None, meshes: str | None
) -> str:
    """Return the name of the folder of results: the scenario's, and its overrides."""
    options = ("duration", duration), ("method", method), ("meshes", meshes)
    short = [f"{name}={text}" for name, text in options if text is not None]
    return folder_name(scenario.name, *(each for each in settings if each.partition("=")[0].strip() != "name"), *short)


def compute(
    scenario: Scenario, token: CancelToken, quiet: bool, check: bool
) -> tuple[xr.Dataset | None, BaseException | None]:
    """Return the result as far as it goes, its convergence if asked, and the exception that stopped it, or None."""
    from finger_pin.simulation.convergence import check_convergence
    from finger_pin.simulation.simulate import run

    bar = progress_bar(shows_progress(quiet), scenario.simulation.duration)
    with bar as progress, token, warnings.catch_warnings():
        # The summary has these warnings.
        warnings.simplefilter("ignore", ScenarioWarning)
        try:
            result = run(scenario, progress=progress, stop=token)
        except (IntegrationError, Interrupted) as error:
            return error.result, error
        if not check:
            return result, None
        try:
            convergence = check_convergence(scenario, result, progress=progress, stop=token)
            return convergence.attach(result), None
        except IntegrationError as error:
            print_error("simulate", f"convergence could not be checked: {error}")
        except Interrupted as error:
            error.add_note("before convergence was checked")
            return result, error
    return result, None


def draw(
    result: xr.Dataset, folder: ResultFolder, token: CancelToken, figures: bool, format: str | None
) -> BaseException | None:
    """Draw animation and figures, all or none; return the exception that prevented it, or None."""
    try:
        if token.cancelled:
            # After an interruption the data are kept, and the views are not drawn: that takes too long.
            raise KeyboardInterrupt
        from finger_pin.views.viewer import write_animation

        write_animation(result, folder.stage / "animation.html")
        if figures:
            from finger_pin.views.plots import figure_files

            figure_files.draw_all(result, folder.stage / "figures", format=format)
    except OSError:
        raise
    except (KeyboardInterrupt, Exception) as error:
        # The result is kept without its pictures.
        folder.discard_views()
        if isinstance(error, KeyboardInterrupt):
            return error
        return NotDrawn(f"animation and figures cannot be drawn: {type(error).__name__}: {error}")
    return None


def listing() -> str:
    """Return the names that the command line takes, with a line about each."""
    from finger_pin.description.simulation_settings import METHODS
    from finger_pin.description.tables import list_fingers, list_hands, list_motors, list_scenarios

    tables = {
        "Scenarios": list_scenarios(),
        "Fingers": list_fingers(),
        "Hands": list_hands(),
        "Motors": list_motors(),
        "Methods": dict.fromkeys(METHODS, ""),
    }
    rows = {title: [f"  {name:15}{text}".rstrip() for name, text in table.items()] for title, table in tables.items()}
    return "\n\n".join("\n".join([title, *lines]) for title, lines in rows.items())
