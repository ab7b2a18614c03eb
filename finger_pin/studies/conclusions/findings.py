"""What an experiment says: a claim, what was measured, and a verdict that is computed from it."""

from __future__ import annotations

import csv
import io
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from finger_pin.files import replacing


class Verdict(Enum):
    """Whether what was measured bears a claim out."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"

    @classmethod
    def of(cls, cases: Iterable[bool]) -> Verdict:
        """Return what follows from several cases: all, some or none of them bear the claim out."""
        borne_out = list(cases)
        return cls.HOLDS if all(borne_out) else cls.PARTLY if any(borne_out) else cls.FAILS


@dataclass(frozen=True)
class Finding:
    """One line of the table of conclusions.

    Attributes:
        part: Which conclusion, such as ``b``.
        claim: What is claimed, as a statement that a measurement can contradict.
        measured: What was measured, with units.
        verdict: What follows from it.
    """

    part: str
    claim: str
    measured: str
    verdict: Verdict


def findings_table(findings: Sequence[Finding], width: int | None = None) -> str:
    """Return findings as a table for a terminal.

    Args:
        findings: What to show, in this order.
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
    with replacing(target) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["part", "claim", "measured", "verdict"])
        writer.writerows([each.part, each.claim, each.measured, each.verdict.value] for each in findings)
    return target
