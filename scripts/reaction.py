"""Tell how good the joint reaction (17) is along a scenario: against weight, inertia and the tendons' real paths."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from command_line import DONE, FAILED, INTERRUPTED, NOT_WRITTEN, WRONG_INPUT, Parser, complain, override
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import finger_pin as fp
from finger_pin.analysis import JointReactions, ReactionDifference, fingertip_loads, joint_reactions
from finger_pin.files import replacing
from finger_pin.views.plots import save_figure
from finger_pin.views.plots.reaction import plot_reaction

PROGRAM = "reaction.py"
FORCE = "environment.fingertip_force"
AS_IT_IS = "as it is"
TEXTS = ("fingertip force", "joint")
# What of the difference is told, and in which words.
PARTS = {
    "direction": "tendons' direction",
    "weight": "weight",
    "inertia": "inertia",
    "static": "quasi-static, all",
    "full": "with inertia, all",
    "other_groove": "grooves proximal",
}


def main(arguments: list[str] | None = None) -> int:
    """Do what a command line says; return the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, allow_abbrev=False)
    parser.add_argument("scenario", nargs="?", default="fig6", metavar="SCENARIO", help="name or path; default fig6")
    parser.add_argument("--set", action="append", default=[], type=override, metavar="KEY=VALUE", help="repeatable")
    parser.add_argument(
        "--forces", type=float, nargs="*", default=[0.5, 1.0, 2.0], metavar="N", help="at the fingertip"
    )
    parser.add_argument("--output", type=Path, default=Path("results/reaction"), help="default results/reaction")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    options = parser.read(arguments)
    try:
        return run(options)
    except fp.InputError as error:
        complain(PROGRAM, str(error))
        return WRONG_INPUT
    except fp.IntegrationError as error:
        complain(PROGRAM, f"{error}; nothing was written")
        return FAILED
    except OSError as error:
        complain(PROGRAM, f"the results cannot be written: {error}")
        return NOT_WRITTEN
    except KeyboardInterrupt:
        complain(PROGRAM, "interrupted; nothing was written")
        return INTERRUPTED


def run(options: argparse.Namespace) -> int:
    """Simulate all cases, compare, write and show."""
    settings = dict(options.set)
    scenario = fp.load_scenario(options.scenario, settings)
    forces = {AS_IT_IS: scenario.environment.fingertip_force} | fingertip_loads(options.forces)
    studies: dict[str, JointReactions] = {}
    motions: dict[str, list[float]] = {}
    shown = sys.stderr.isatty() and not options.quiet
    console = Console(stderr=True)
    for label, force in track(forces.items(), "Simulating", console=console, transient=True, disable=not shown):
        entries = settings | {FORCE: list(force)}
        result = fp.simulate(fp.load_scenario(options.scenario, entries))
        studies[label] = joint_reactions(result)
        other = fp.simulate(fp.load_scenario(options.scenario, entries | corrected(scenario, studies[label])))
        moved = np.rad2deg(other.joint_position.values - result.joint_position.values)
        motions[label] = np.sqrt(np.mean(moved**2, axis=0)).tolist()
    rows = [row for label, study in studies.items() for row in table_rows(label, study.differences(), motions[label])]
    write_csv(rows, options.output / "reaction.csv")
    loaded = {label: study for label, study in studies.items() if label != AS_IT_IS}
    save_figure(plot_reaction(studies[AS_IT_IS], loaded), options.output / "reaction.png")
    if not options.quiet:
        show(rows)
        print(f"Table and figure are in {options.output}")
    return DONE


def corrected(scenario: fp.Scenario, study: JointReactions) -> dict[str, list[float]]:
    """Return M^d and M^c of every joint times its mean ratio of the full quasi-static reaction to (17)."""
    ratio = np.array([1.0 + each.static.mean for each in study.differences()])
    friction = scenario.finger.joint_friction
    values = {"coulomb": friction.coulomb, "stiction": friction.stiction}
    return {f"finger.joint_friction.{name}": (np.asarray(value) * ratio).tolist() for name, value in values.items()}


def table_rows(
    label: str, differences: Iterable[ReactionDifference], moved: Iterable[float]
) -> Iterator[dict[str, Any]]:
    """Yield one row per joint: differences in percent of mean (17), friction in mN m, motion in degrees."""
    for each, motion in zip(differences, moved, strict=True):
        parts = {part: getattr(each, part) for part in PARTS}
        yield {
            "fingertip force": label,
            "joint": each.joint,
            "mean (17), N": each.paper,
            **{f"{part} mean, %": 100.0 * found.mean for part, found in parts.items()},
            **{f"{part} max, %": 100.0 * found.largest for part, found in parts.items()},
            "friction mean, mN m": 1e3 * each.friction[0],
            "friction max, mN m": 1e3 * each.friction[1],
            "motion rms, deg": motion,
            "thrust max, N": each.thrust,
            "tilt mean, mN m": 1e3 * each.tilt,
        }


def write_csv(rows: list[dict[str, Any]], path: Path) -> None:
    """Write all rows, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(
            {key: f"{value:.6g}" if isinstance(value, float) else value for key, value in row.items()} for row in rows
        )


def show(rows: list[dict[str, Any]]) -> None:
    """Print differences without further forces, and the worst of all forces."""
    given = [row for row in rows if row["fingertip force"] == AS_IT_IS]
    print("What (17) misses at each joint, % of its mean: mean (largest)")
    Console().print(table("as it is", given))
    further = [[row for row in rows if row["joint"] == each["joint"] and row not in given] for each in given]
    if all(further):
        worst = [
            {key: max((row[key] for row in same), key=abs) for key in same[0] if key not in TEXTS}
            | {"joint": same[0]["joint"]}
            for same in further
        ]
        Console().print(table(f"worst of {len(further[0])} forces", worst))


def table(title: str, joints: list[dict[str, Any]]) -> Table:
    """Return the table that is printed, a column per joint."""
    found = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    found.add_column(title)
    for row in joints:
        found.add_column(row["joint"], justify="right")
    found.add_row("mean of (17), N", *(f"{row['mean (17), N']:.1f}" for row in joints))
    for part, text in PARTS.items():
        found.add_row(text, *(f"{row[f'{part} mean, %']:.1f} ({row[f'{part} max, %']:.1f})" for row in joints))
    shares = (f"{row['friction mean, mN m']:.2f} ({row['friction max, mN m']:.2f})" for row in joints)
    found.add_row("friction, mN m", *shares)
    found.add_row("motion, deg rms", *(f"{row['motion rms, deg']:.3f}" for row in joints))
    return found


if __name__ == "__main__":
    sys.exit(main())
