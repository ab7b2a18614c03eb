"""Compare the simulator with everything that is not ours, and write a report.

Closed forms, published experiments, Pinocchio, yourdfpy, MuJoCo, and the simulator against itself.

Exit codes: 0 every check passed, differs by a known amount, or was skipped because an optional package is not
installed; 1 some failed, or the report cannot be written; 2 wrong options; 130 interrupted, nothing written.
"""

from __future__ import annotations

import argparse
import sys
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from command_line import INTERRUPTED, NOT_WRITTEN, Parser, complain

if TYPE_CHECKING:
    from validation.report import Family

PROGRAM = "validate.py"
#: Names on the command line, and the modules in scripts/validation, in the order of the report.
FAMILIES = {
    "kinematics": "kinematics",
    "rigid-body": "rigid_body",
    "mujoco": "mujoco_motion",
    "lugre": "lugre",
    "closed-forms": "closed_forms",
    "methods": "methods",
    "order": "order",
    "symmetry": "symmetry",
    "stiffness": "stiffness",
    "energy": "energy",
}


def main(arguments: list[str] | None = None) -> int:
    """Check, print, and write; return the exit code."""
    options = parse(arguments)
    try:
        from validation import report
        from validation.check import Verdict

        from finger_pin.commands.console import print_text

        options.output.mkdir(parents=True, exist_ok=True)
        families = validate(options.only)
        whole = report.Report.now(families)
        report.write(whole, options.output)
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted; nothing was written")
        return INTERRUPTED
    except OSError as error:
        complain(PROGRAM, f"{options.output}: cannot be written: {error.strerror or error}")
        return NOT_WRITTEN
    print_text(f"{report.text(whole)}\n\nThe report is {options.output / report.PAGE}")
    return 1 if whole.count(Verdict.FAIL) else 0


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Parse a command line, or exit."""
    summary, _, rest = (__doc__ or "").partition("\n\n")
    parser = Parser(prog=PROGRAM, description=summary, epilog=rest, allow_abbrev=False)
    parser.add_argument(
        "--only", type=chosen, default=tuple(FAMILIES), metavar="NAME", help=f"one or more of {','.join(FAMILIES)}"
    )
    parser.add_argument(
        "--output", type=Path, default=Path("results/validation"), metavar="DIR", help="default %(default)s"
    )
    return parser.read(arguments)


def chosen(names: str) -> tuple[str, ...]:
    """Parse names of families with commas between; keep their usual order."""
    wanted = [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in FAMILIES:
            near = get_close_matches(name, FAMILIES, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise argparse.ArgumentTypeError(f"{name}: no such family; there are {', '.join(FAMILIES)}{hint}")
    return tuple(name for name in FAMILIES if name in wanted)


def validate(names: tuple[str, ...]) -> tuple[Family, ...]:
    """Return what the named families of checks found; on a terminal, show how far it is."""
    from validation.check import Section, failed
    from validation.progress import bar
    from validation.report import Family

    found: list[Family] = []
    with bar(len(names)) as advance:
        for name in names:
            module = import_module(f"validation.{FAMILIES[name]}")
            advance(len(found), module.TITLE)
            about = " ".join((module.__doc__ or "").strip().split("\n\n")[0].split())
            try:
                section = module.measure()
            except Exception as error:
                # One family that breaks is a failure to report, and no reason to lose the others.
                section = Section.of([failed(module.TITLE, f"{type(error).__name__}: {error}")])
            found.append(Family(name, module.TITLE, about, section))
    return tuple(found)


if __name__ == "__main__":
    sys.exit(main())
