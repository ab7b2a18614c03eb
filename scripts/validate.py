"""Compare the simulator with independent sources: closed forms, experiments in print, other programs."""

from __future__ import annotations

import sys
from collections.abc import Collection
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from finger_pin.commands.application import run_function
from finger_pin.commands.console import bar, error_note, print_text, shows_progress
from finger_pin.commands.options import Output, invalid

if TYPE_CHECKING:
    from validation.families import Family

#: Names on the command line, and the modules in scripts/validation, in the order of the report.
FAMILIES = {
    "kinematics": "kinematics",
    "rigid-body": "rigid_body",
    "mujoco": "mujoco_motion",
    "lugre": "lugre",
    "closed-forms": "closed_forms",
    "servo": "servo",
    "methods": "methods",
    "order": "order",
    "symmetry": "symmetry",
    "stiffness": "stiffness",
    "energy": "energy",
    "printed-figures": "printed_figures",
}


def validate(
    only: Annotated[str, typer.Option(metavar="NAMES", help=f"Some of {','.join(FAMILIES)}.")] = ",".join(FAMILIES),
    output: Output = Path("results/validation"),
    random: Annotated[int, typer.Option(metavar="N", min=0, help="Check N random models instead.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first random model.")] = 0,
    observer: Annotated[str, typer.Option(metavar="NAMES", help="Measure the observer: some cases, or all.")] = "",
    seeds: Annotated[int, typer.Option(metavar="N", min=1, help="Fingers that --observer draws, of each case.")] = 20,
    hands: Annotated[Path | None, typer.Option(metavar="DIR", help="Close the hands of a folder on a ball.")] = None,
) -> int:
    """Compare the simulator with independent sources, and write a report.

    Closed forms, published experiments, Pinocchio, yourdfpy, MuJoCo, and the simulator against itself. With --random,
    random models are computed in two ways each, nothing is written, and what fails is printed with its seed. With
    --observer, a table says how far estimates of an observer are off, and what its bands hold, of random fingers. With
    --hands, a table says how true the primitives are that MuJoCo models and URDFs of a folder get for their meshes.

    Exit codes: 0 every check passed, differs by a known amount, or was skipped because an optional package is not
    installed; 1 some failed, or the report cannot be written; 2 wrong options; 130 interrupted, nothing written.
    """
    names = chosen("--only", only, FAMILIES)
    shows_progress(quiet=False)
    if observer:
        from validation.observer import CASES, print_tables

        print_tables(tuple(CASES) if observer == "all" else chosen("--observer", observer, CASES), seeds)
        return 0
    if hands is not None:
        from validation.hands import print_table

        return 0 if print_table(hands) else 1
    if random:
        from validation import random_models

        return 1 if random_models.check(random, seed) else 0
    from validation import report
    from validation.check import Verdict
    from validation.families import Report

    output.mkdir(parents=True, exist_ok=True)
    with error_note("nothing was written"):
        whole = Report.now(measured(names))
    report.write(whole, output)
    print_text(f"{report.text(whole)}\n\nThe report is {output / report.PAGE}")
    return 1 if whole.count(Verdict.FAIL) else 0


def chosen(option: str, names: str, known: Collection[str]) -> tuple[str, ...]:
    """Parse names with commas between; keep the usual order of those that are known."""
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise invalid(option, f"{name}: must be some of {', '.join(known)}{hint}")
    return tuple(name for name in known if name in wanted)


def measured(names: tuple[str, ...]) -> tuple[Family, ...]:
    """Return the results of the named families of checks; on a terminal, show progress."""
    from validation.check import Section, failed
    from validation.families import Family

    found: list[Family] = []
    with bar(sys.stderr.isatty(), "families", len(names)) as show:
        for name in names:
            module = import_module(f"validation.{FAMILIES[name]}")
            show(len(found), text=module.TITLE)
            about = " ".join((module.__doc__ or "").strip().split("\n\n")[0].split())
            try:
                section = module.measure()
            except Exception as error:
                # One family that breaks is a failure to report, and no reason to lose the others.
                section = Section.of([failed(module.TITLE, f"{type(error).__name__}: {error}")])
            found.append(Family(name, module.TITLE, about, section))
    return tuple(found)


main = partial(run_function, validate)

if __name__ == "__main__":
    sys.exit(main())
