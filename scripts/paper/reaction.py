"""The command reaction: the error of the joint reaction (17) along a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from finger_pin.commands.console import count_bar, error_note, print_text, shows_progress
from finger_pin.commands.options import Format, Output, Quiet, ScenarioName, Settings, numbers, overrides

if TYPE_CHECKING:
    from rich.table import Table

    from finger_pin.description.scenario import Scenario
    from paper.joint_reactions import JointReactions, ReactionDifference

FORCE = "environment.fingertip_force"
AS_IT_IS = "as it is"
TEXTS = ("fingertip force", "joint")
# The parts of the difference that are reported, with their labels.
PARTS = {
    "direction": "tendons' direction",
    "weight": "weight",
    "inertia": "inertia",
    "static": "quasi-static, all",
    "full": "with inertia, all",
    "other_groove": "grooves proximal",
}


def reaction(
    scenario: ScenarioName = "reversals",
    settings: Settings = [],  # noqa: B006
    forces: Annotated[str, typer.Option(metavar="N,N,...", help="At the fingertip; empty for none.")] = "0.5,1,2",
    output: Output = Path("results/reaction"),
    format: Format = None,
    quiet: Quiet = False,
) -> None:
    """Measure the error of the joint reaction (17) along a scenario: weight, inertia and tendons' real paths."""
    changed, shown = overrides(settings), shows_progress(quiet)
    sizes = numbers("--forces", forces) if forces else []
    import numpy as np

    from finger_pin.description.loading import load_scenario
    from finger_pin.files import write_table
    from finger_pin.simulation.simulate import simulate
    from finger_pin.views.plots import save_figure
    from paper.joint_reactions import fingertip_loads, joint_reactions
    from paper.plot_reaction import plot_reaction

    loaded = load_scenario(scenario, changed)
    cases = {AS_IT_IS: loaded.environment.fingertip_force} | fingertip_loads(sizes)
    studies: dict[str, JointReactions] = {}
    motions: dict[str, list[float]] = {}
    with count_bar(shown, len(cases)) as advance, error_note("nothing was written"):
        for label, force in cases.items():
            entries = changed | {FORCE: list(force)}
            result = simulate(load_scenario(scenario, entries))
            studies[label] = joint_reactions(result)
            # Only now is it known that the scenario serves; the other forces would take long before nothing is written.
            output.mkdir(parents=True, exist_ok=True)
            other = simulate(load_scenario(scenario, entries | corrected(loaded, studies[label])))
            moved = np.rad2deg(other.joint_position.values - result.joint_position.values)
            motions[label] = np.sqrt(np.mean(moved**2, axis=0)).tolist()
            advance(1)
    rows = [row for label, study in studies.items() for row in table_rows(label, study.differences(), motions[label])]
    texts = ([f"{each:.6g}" if isinstance(each, float) else each for each in row.values()] for row in rows)
    write_table(output / "reaction.csv", [rows[0], *texts])
    more = {label: study for label, study in studies.items() if label != AS_IT_IS}
    save_figure(plot_reaction(studies[AS_IT_IS], more), output / "reaction", format)
    if not quiet:
        show(rows)
        print_text(f"Table and figure are in {output}")


def corrected(scenario: Scenario, study: JointReactions) -> dict[str, list[float]]:
    """Return M^d and M^c of every joint times its mean ratio of the full quasi-static reaction to (17)."""
    import numpy as np

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


def show(rows: list[dict[str, Any]]) -> None:
    """Print differences without further forces, and the worst of all forces."""
    from rich.console import Console

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
    from rich import box
    from rich.table import Table

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
