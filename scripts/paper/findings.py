"""Findings of the experiments: the paper's conclusions as claims, the measurements, and the verdicts."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from finger_pin.description.validation import expand
from finger_pin.files import write_table
from finger_pin.typing import Array
from paper.delivery import BROKEN, PassiveDelivery, crossing
from paper.influence import MOST_TENDON_FRICTION, FrictionInfluence, Sweep, error_at_work
from paper.posture import Transmission

_MILLI = 1e3
#: A posture matters to a tendon if a controller that ignores it errs by more than this share of the tension.
MATTERS = 0.02
#: A tendon obeys steady sliding if it deviates from it by less than this share.
_SETTLED = 0.05
#: Extrapolated and predicted locking agree within this share.
_AGREES = 0.05
#: How much more friction counts as "high" in the comparison of the two.
_HIGH = 3.0


class Verdict(Enum):
    """The verdict of measurements on a claim."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"

    @classmethod
    def of(cls, cases: Iterable[bool]) -> Verdict:
        """Return the verdict of several cases: all, some or none of them bear the claim out."""
        borne_out = list(cases)
        return cls.HOLDS if all(borne_out) else cls.PARTLY if any(borne_out) else cls.FAILS


@dataclass(frozen=True)
class Finding:
    """One line of the table of conclusions.

    Attributes:
        part: Which conclusion, such as ``b``.
        claim: The claim, as a statement that a measurement can contradict.
        measured: Measured values, with units.
        verdict: The verdict on it.
    """

    part: str
    claim: str
    measured: str
    verdict: Verdict


def findings_table(findings: Sequence[Finding], width: int | None = None) -> str:
    """Return findings as a table for a terminal.

    Args:
        findings: Findings to show, in this order.
        width: In columns; that of the terminal by default, at least 80 and at most 140.
    """
    table = Table("", "claim", "measured", "verdict", box=box.SIMPLE_HEAD, pad_edge=False, show_lines=True)
    columns = width or min(max(shutil.get_terminal_size().columns, 80), 140)
    table.columns[1].ratio, table.columns[2].ratio = 4, 6
    table.columns[3].no_wrap = True
    table.expand = True
    for each in findings:
        table.add_row(each.part, Text(each.claim), Text(each.measured), each.verdict.value)
    text = io.StringIO()
    Console(file=text, width=columns, color_system=None).print(table)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines())


def write_findings(findings: Sequence[Finding], path: str | Path) -> Path:
    """Write findings as CSV, whole or not at all, and return its path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    rows = ([each.part, each.claim, each.measured, each.verdict.value] for each in findings)
    write_table(target, [["part", "claim", "measured", "verdict"], *rows])
    return target


def transmission_findings(found: Transmission) -> list[Finding]:
    """Return the table's lines on conclusion (a)."""
    names, pulling = found.tendons, found.workspace.pulling
    low, high = pulling.min(axis=0), pulling.max(axis=0)
    ranges = ", ".join(f"{name} {b:.3f} to {a:.3f}" for name, a, b in zip(names, low, high, strict=True))
    blind = found.blind_error
    errors = ", ".join(f"{name} {100.0 * error:.1f} %" for name, error in zip(names, blind, strict=True))
    motion = found.motion
    pulled = np.where(motion.sliding & (motion.direction > 0.0), motion.ratio, np.nan)
    released = np.where(motion.sliding & (motion.direction < 0.0), motion.ratio, np.nan)
    seen = [name for index, name in enumerate(names) if np.isfinite(pulled[:, index]).any()]
    moving = ", ".join(f"{name} {np.nanmin(pulled[:, names.index(name)]):.3f}" for name in seen)
    let_go = ", ".join(
        f"{name} {np.nanmax(released[:, names.index(name)]):.3f}"
        for name in names
        if np.isfinite(released[:, names.index(name)]).any()
    )
    off = found.unsettled
    return [
        Finding(
            "a",
            "a tendon's friction depends on the posture",
            f"f/f^a over the workspace, steady pulling: {ranges}",
            Verdict.of(high - low > 1e-9),
        ),
        Finding(
            "a",
            "so much that a controller must consider it",
            f"error of the tension, at worst, with one coefficient for all postures: {errors} (matters above "
            f"{100.0 * MATTERS:.0f} %)",
            Verdict.of(blind > MATTERS),
        ),
        Finding(
            "a",
            "in motion the loss is that of steady sliding at the posture of the moment",
            f"least f/f^a pulling: {moving}; greatest releasing: {let_go}; off steady sliding by "
            f"{100.0 * np.max(off[np.isfinite(off)], initial=0.0):.1f} % rms at most while sliding",
            Verdict.of(off[np.isfinite(off)] < _SETTLED),
        ),
    ]


def influence_findings(found: FrictionInfluence) -> list[Finding]:
    """Return the table's lines on conclusion (b)."""
    low, grip = found.minimum.runs, found.gripping
    law, size = found.scenario.finger.joint_friction, len(found.scenario.finger.joints)
    static = float(np.max(expand(law.stiction, size)))
    tensions = found.minimum.values
    findings = [
        Finding(
            "b",
            "joint friction grows with the sum of the tensions",
            f"with f0 from {tensions[0]:g} to {tensions[-1]:g} N the mean sum of tensions on a joint goes from "
            f"{low.reaction[0]:.1f} to {low.reaction[-1]:.1f} N, its mean friction from "
            f"{_MILLI * low.joint_friction[0]:.2f} to {_MILLI * low.joint_friction[-1]:.2f} mN m",
            Verdict.of(np.diff(low.joint_friction) > 0.0),
        ),
        Finding(
            "b",
            "high friction or tension makes a joint grip itself",
            f"locks at {_MILLI * static * grip.predicted:.3f} mm by the statics, at "
            f"{_MILLI * static * grip.predicted * grip.extrapolated:.3f} mm by extrapolation of simulated tensions; "
            f"the finger has {_MILLI * static:.2f} mm; {100.0 * np.min(grip.followed):.0f} % of the travel is left "
            f"at {grip.shares[-1]:g} of critical",
            Verdict.of([abs(grip.extrapolated - 1.0) < _AGREES, grip.followed[-1] < 0.5]),
        ),
        Finding(
            "b",
            "excessive tensions have to be avoided",
            f"rms error {_degrees(low.error[0])} at f0 = {tensions[0]:g} N, {_degrees(low.error[-1])} at "
            f"{tensions[-1]:g} N",
            Verdict.of([low.error[-1] > 1.5 * low.error[0]]),
        ),
    ]
    senses = _senses(found)
    findings += [
        Finding("b", f"joint friction is the more crucial: {claim}", text, Verdict.of([yes]))
        for claim, text, yes in senses
    ]
    agree = [yes for *_, yes in senses]
    return [
        *findings,
        Finding(
            "b",
            "joint friction is more crucial than tendon friction",
            f"in {sum(agree)} of {len(agree)} senses",
            Verdict.of(agree),
        ),
    ]


def delivery_findings(found: PassiveDelivery) -> list[Finding]:
    """Return the table's lines on conclusion (c)."""
    causes = ", ".join(f"{name} {100.0 * value:.0f} %" for name, value in found.causes.items() if name != "none")
    speed = crossing(found.speeds, found.grid.deviation[:, 0])
    friction = crossing(found.factors, found.grid.deviation[0])
    limit = f"{100.0 * BROKEN:.0f} %"
    usual = found.grid.deviation[list(found.speeds).index(1.0), list(found.factors).index(1.0)]
    least = min(float(found.grid.least.min()), float(found.given.least))
    return [
        Finding(
            "c",
            "force closure sets the passive tension, if nothing else acts",
            f"rms deviation of delivered from planned {100.0 * found.causes['none']:.1f} % slowly, without friction "
            "and weight, with f5^d = lambda f^k_5",
            Verdict.of([found.causes["none"] < 0.05]),
        ),
        Finding(
            "c",
            "the motion is slow enough for inertial forces to be small",
            f"without friction it deviates by {limit} at {_times(speed, found.speeds[-1])} the scenario's speed; at "
            f"that speed itself by {100.0 * found.causes['speed']:.1f} %",
            Verdict.of([found.causes["speed"] < BROKEN, speed > 1.0]),
        ),
        Finding(
            "c",
            "the finger's friction is not preponderant",
            f"slowly it deviates by {limit} at {_times(friction, found.factors[-1])} the finger's friction; with all "
            f"of it, at the scenario's speed, by {100.0 * usual:.0f} %",
            Verdict.of([friction > 1.0, usual < BROKEN]),
        ),
        Finding(
            "c",
            "only inertia and friction make it differ",
            f"each by itself: {causes}",
            Verdict.of([found.causes["reference"] < 0.05, found.causes["weight"] < 0.05]),
        ),
        Finding(
            "c",
            "the controller can keep the passive tendon taut",
            f"it carries at least {least:.2f} N in all runs; as the scenario is, it deviates by "
            f"{100.0 * found.given.deviation:.0f} %",
            Verdict.of([least > 0.0]),
        ),
    ]


def _senses(found: FrictionInfluence) -> list[tuple[str, str, bool]]:
    """Return every sense of "more crucial": its meaning, the measurement, and the verdict."""
    as_is = _row(found.joint, 1.0)
    here = int(np.argmin(np.abs(found.minimum.runs.error - found.joint.runs.error[as_is])))
    joint, tendon = found.elasticity_joint[here], found.elasticity_tendon[here]
    without_joint, without_tendon = found.joint.runs.error[0], found.tendon.runs.error[0]
    work = float(found.tendon_alone.runs.tendon_work[_row(found.tendon_alone, 1.0)])
    works = found.joint_alone.runs.joint_work, found.tendon_alone.runs.tendon_work
    alone = [error_at_work(s, w, work) for s, w in zip((found.joint_alone, found.tendon_alone), works, strict=True)]
    high = [sweep.runs.error[_row(sweep, _HIGH)] for sweep in (found.joint, found.tendon)]
    followed = bool(found.gripping.followed[-1] < 0.5)
    return [
        (
            "a small change of it is felt more",
            f"d ln(error) / d ln(friction): {joint:.2f} of joints, {tendon:.2f} of tendons",
            bool(joint > tendon),
        ),
        (
            "its removal gains more",
            f"rms error {_degrees(found.joint.runs.error[as_is])} with both, {_degrees(without_joint)} without joint, "
            f"{_degrees(without_tendon)} without tendon friction",
            bool(without_joint < without_tendon),
        ),
        (
            "it costs more accuracy for the same energy lost",
            f"each alone, losing {_MILLI * work:.0f} mJ: {_degrees(alone[0])} by joints, {_degrees(alone[1])} by "
            "tendons",
            alone[0] > alone[1],
        ),
        (
            f"{found.joint.values[_row(found.joint, _HIGH)]:g} times as much of it does more harm",
            f"rms error {_degrees(high[0])} with joint, {_degrees(high[1])} with tendon friction raised",
            bool(high[0] > high[1]),
        ),
        (
            "only it can stop the finger",
            f"joints lock at {found.gripping.predicted:.2f} times their friction, tendons at "
            f"{_times(found.gripping.tendons_lock, MOST_TENDON_FRICTION)} theirs, by the statics",
            followed and bool(found.gripping.tendons_lock > found.gripping.predicted),
        ),
    ]


def _row(sweep: Sweep, value: float) -> int:
    return int(np.argmin(np.abs(sweep.values - value)))


def _degrees(error: float | Array) -> str:
    return f"{float(np.rad2deg(error)):.2f} deg"


def _times(value: float, most: float) -> str:
    return f"{value:.2g} times" if np.isfinite(value) else f"more than {most:g} times"
