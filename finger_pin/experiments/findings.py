"""What an experiment says: a claim, what was measured, and a verdict that is computed from it."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from finger_pin.files import replacing


@dataclass(frozen=True)
class Finding:
    """One line of the table of conclusions.

    Attributes:
        part: Which conclusion, such as ``b``.
        claim: What is claimed, as a statement that a measurement can contradict.
        measured: What was measured, with units.
        verdict: What follows from it.
        holds: Whether the claim holds; None for a measurement that no claim rests on.
    """

    part: str
    claim: str
    measured: str
    verdict: str
    holds: bool | None = None


def write_findings(findings: Sequence[Finding], path: str | Path) -> Path:
    """Write findings as CSV, whole or not at all; ``holds`` is yes, no or empty."""
    words = {True: "yes", False: "no", None: ""}
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["part", "claim", "measured", "verdict", "holds"])
        for each in findings:
            writer.writerow([each.part, each.claim, each.measured, each.verdict, words[each.holds]])
    return target
