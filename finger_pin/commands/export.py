"""The command export: fingers and results as files that other programs read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finger_pin.commands.console import print_text
from finger_pin.commands.options import Settings, invalid, overrides

if TYPE_CHECKING:
    from finger_pin.description.finger_description import FingerDescription
    from finger_pin.description.scenario import Scenario

#: What a file's name may end with.
ENDINGS = (".urdf", ".xml", ".toml", ".csv")


def export(
    source: Annotated[
        str,
        typer.Argument(metavar="SOURCE", help="A finger, hand or scenario: name or .toml; or results: folder or .nc."),
    ] = "ub",
    target: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="Ends with .urdf, .xml (MJCF), .toml or .csv (results); default <name>.urdf."
        ),
    ] = None,
    settings: Settings = [],  # noqa: B006
) -> None:
    """Write a finger as URDF, MJCF or TOML, or the signals of a result as CSV."""
    from finger_pin.description.tables import is_path
    from finger_pin.files import write_text

    is_result = Path(source).is_dir() or source.endswith(".nc")
    if target is None:
        target = Path(f"{Path(source).stem}{'.csv' if is_result else '.urdf'}")
    if target.suffix not in ENDINGS:
        raise invalid("FILE", f"{target}: must end with {', '.join(ENDINGS)}")
    if is_result != (target.suffix == ".csv"):
        if is_result:
            problem = "signals are written as .csv"
        elif is_path(source) and not Path(source).exists():
            problem = "there is no such file or folder"
        else:
            problem = "has no signals; simulate it, and give the folder of its results"
        raise invalid("SOURCE", f"{source}: {problem}")
    if is_result:
        if settings:
            raise invalid("--set", "is for fingers, hands and scenarios; signals are as they were computed")
        from finger_pin.simulation.netcdf import load, save

        try:
            result = load(source)
        except OSError as error:
            path_prefix = f"{error.filename}: " if error.filename else ""
            raise invalid("SOURCE", f"{source}: cannot be read: {path_prefix}{error.strerror or error}") from None
        target.parent.mkdir(parents=True, exist_ok=True)
        save(result, target)
    else:
        text = description_text(load_description(source, settings), target.suffix)
        target.parent.mkdir(parents=True, exist_ok=True)
        write_text(target, text)
    print_text(f"wrote {target}")


def load_description(source: str, settings: list[str]) -> FingerDescription | Scenario:
    """Return the finger, hand or scenario of a name or a file."""
    from finger_pin.description.loading import load_finger, load_hand, load_scenario
    from finger_pin.description.resolution import kind_of
    from finger_pin.description.tables import is_path, list_benches, list_scenarios, shipped
    from finger_pin.description.validation import suggestion

    kind, changed = kind_of(source), overrides(settings)
    if kind == "scenario":
        names = [*shipped("fingers"), *shipped("hands"), *list_scenarios(), *list_benches()]
        if not is_path(source) and source not in names:
            allowed = f"no such finger, hand or scenario; there are {', '.join(names)}, or the path of a .toml file"
            raise invalid("SOURCE", f"{source}: {allowed}{suggestion(source, names)}")
        return load_scenario(source, changed)
    return (load_hand if kind == "hand" else load_finger)(source, changed)


def description_text(description: FingerDescription | Scenario, ending: str) -> str:
    """Return a description as the text of a file."""
    from finger_pin.description.loading import to_toml
    from finger_pin.description.scenario import Scenario
    from finger_pin.exchange.mjcf import to_mjcf
    from finger_pin.mechanism.coerce import one_finger
    from finger_pin.mechanism.urdf import to_urdf

    if ending == ".toml":
        return to_toml(description)
    if isinstance(description, Scenario):
        description = description.finger
    if ending == ".xml":
        return to_mjcf(description)
    one_finger(description)
    return to_urdf(description)
