"""The report: every check as text, as JSON, and as one HTML page that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from finger_pin.files import write_text
from validation.check import Check, Verdict
from validation.families import Family, Report
from validation.page import page

PAGE, DATA = "validation.html", "validation.json"


def headline(report: Report) -> str:
    """Return the outcome in a sentence."""
    total = sum(len(family.section.checks) for family in report.families)
    parts = [f"{report.count(Verdict.PASS)} of {total} checks pass"]
    for verdict, words in (
        (Verdict.DIFFERS, "differ by a known amount"),
        (Verdict.SKIPPED, "skipped"),
        (Verdict.FAIL, "FAIL"),
    ):
        if count := report.count(verdict):
            parts.append(f"{count} {words if count > 1 else words.replace('differ ', 'differs ')}")
    return ", ".join(parts)


def text(report: Report) -> str:
    """Return a line per family, every check that did not pass, and the outcome."""
    width = max(len(family.title) for family in report.families)
    lines = [f"{family.title.ljust(width)}  {_tally(family)}" for family in report.families]
    for family in report.families:
        lines += [_line(check) for check in family.section.checks if check.verdict is not Verdict.PASS]
    return "\n".join([*lines, "", headline(report)])


def _tally(family: Family) -> str:
    return ", ".join(f"{count} {verdict}" for verdict in Verdict if (count := family.count(verdict)))


def _line(check: Check) -> str:
    if check.measured is None:
        return f"{check.verdict}: {check.what}: {check.note}"
    said = f"{check.verdict}: {check.what}: {check.measured:.6g} {check.unit}, {check.source}: {check.expected:.6g}"
    return f"{said} {check.unit}, tolerance {check.tolerance:.1g}. {check.note}".rstrip()


def records(report: Report) -> Iterator[dict[str, object]]:
    """Yield every check as a JSON object."""
    for family in report.families:
        for check in family.section.checks:
            yield {"family": family.name, **asdict(check)}


def write(report: Report, folder: Path) -> None:
    """Write the page and the data into a folder that exists, each whole or not at all.

    Raises:
        OSError: If they cannot be written.
    """
    whole = {
        "date": report.date,
        "versions": report.versions,
        "counts": {verdict: report.count(verdict) for verdict in Verdict},
        "checks": list(records(report)),
    }
    contents = {DATA: json.dumps(whole, indent=1) + "\n", PAGE: page(report, headline(report))}
    for name, content in contents.items():
        write_text(folder / name, content)
