"""The report as one HTML page: figures are inside it, nothing is loaded from anywhere."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

from validation.check import Check, Picture, Verdict

if TYPE_CHECKING:
    from validation.report import Family, Report

_STYLE = """
:root { --ink: #1d2433; --soft: #5d6678; --line: #e3e6ec; --pass: #0b7a55; --differs: #a15c00; --fail: #c0271d; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: #f6f7f9; font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 68rem; margin: 0 auto; padding: 2.5rem 1.25rem 4rem; }
h1 { font-size: 1.7rem; margin: 0; }
h2 { font-size: 1.2rem; margin: 0; }
p { margin: .3rem 0; }
.soft { color: var(--soft); }
.outcome { font-size: 1.15rem; font-weight: 600; margin: .8rem 0 .2rem; }
section { background: #fff; border: 1px solid var(--line); border-radius: .5rem;
  padding: 1.25rem; margin-top: 1.25rem; }
table { border-collapse: collapse; width: 100%; margin-top: .8rem; font-size: .875rem; }
th { text-align: left; color: var(--soft); font-weight: 500; border-bottom: 2px solid var(--line); }
th, td { padding: .35rem .8rem .35rem 0; vertical-align: top; }
td { border-bottom: 1px solid var(--line); }
tr:last-child td { border-bottom: 0; }
.checks td:nth-child(2) { min-width: 13rem; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
th:last-child, td:last-child { padding-right: 0; white-space: nowrap; }
.verdict { display: inline-block; min-width: 4.2rem; text-align: center; padding: 0 .5rem; border-radius: .75rem;
  font-size: .8rem; font-weight: 600; border: 1px solid currentcolor; }
.pass { color: var(--pass); background: #eaf6f1; } .differs { color: var(--differs); background: #fdf3e2; }
.fail { color: #fff; background: var(--fail); } .skipped { color: var(--soft); background: #f0f1f4; }
.note { color: var(--differs); font-size: .82rem; }
a { color: inherit; text-decoration-color: var(--line); text-underline-offset: .2em; }
figure { margin: 1.2rem 0 0; }
figure img { display: block; max-width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: .85rem; margin-top: .3rem; }
@media print { body { background: #fff; } section { break-inside: avoid; } }
@media (max-width: 45rem) { section { overflow-x: auto; } }
"""


def page(report: Report, headline: str) -> str:
    """Return the page as text."""
    versions = ", ".join(f"{name} {version}" for name, version in report.versions.items() if version)
    missing = ", ".join(name for name, version in report.versions.items() if version is None)
    return "\n".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>finger_pin: validation</title><style>{_STYLE}</style></head><body><main>",
            "<h1>finger_pin: validation</h1>",
            f'<p class="outcome">{escape(headline)}</p>',
            f'<p class="soft">{escape(report.date)}. {escape(versions)}.',
            f"Not installed: {escape(missing)}." if missing else "",
            "</p>",
            _summary(report),
            *(_family(family) for family in report.families),
            "</main></body></html>",
        ]
    )


def _summary(report: Report) -> str:
    rows = []
    for family in report.families:
        badges = " ".join(
            _badge(verdict, f"{count} {verdict}") for verdict in Verdict if (count := family.count(verdict))
        )
        link = f'<a href="#{family.name}">{escape(family.title)}</a>'
        rows.append(f"<tr><td>{link}</td><td>{_sources(family)}</td><td>{badges}</td></tr>")
    head = "<tr><th>What</th><th>Against</th><th>Outcome</th></tr>"
    return f"<section><h2>Summary</h2><table>{head}{''.join(rows)}</table></section>"


def _sources(family: Family) -> str:
    return escape("; ".join(dict.fromkeys(check.source for check in family.section.checks)))


def _family(family: Family) -> str:
    head = (
        '<tr><th>What</th><th>Source</th><th class="number">Expected</th><th class="number">Measured</th>'
        '<th class="number">Tolerance</th><th>Unit</th><th>Verdict</th></tr>'
    )
    rows = "".join(map(_row, family.section.checks))
    pictures = "".join(map(_picture, family.section.pictures))
    return (
        f'<section id="{family.name}"><h2>{escape(family.title)}</h2><p class="soft">{escape(family.about)}</p>'
        f'<table class="checks">{head}{rows}</table>{pictures}</section>'
    )


def _row(check: Check) -> str:
    note = f'<div class="note">{escape(check.note)}</div>' if check.note else ""
    expected, measured = _number(check.expected), _number(check.measured, check.expected)
    tolerance = "" if check.tolerance is None else f"{check.tolerance:.2g}"
    numbers = "".join(f'<td class="number">{escape(each)}</td>' for each in (expected, measured, tolerance))
    unit = "" if check.unit == "1" else check.unit
    return (
        f"<tr><td>{escape(check.what)}{note}</td><td>{escape(check.source)}</td>{numbers}"
        f"<td>{escape(unit)}</td><td>{_badge(check.verdict, check.verdict)}</td></tr>"
    )


def _number(value: float | None, expected: float | None = None) -> str:
    """Write a value in full, a deviation from zero by its size."""
    if value is None:
        return ""
    return f"{value:.1e}" if expected == 0.0 else f"{value:.7g}"


def _badge(verdict: Verdict, words: str) -> str:
    return f'<span class="verdict {verdict}">{escape(words)}</span>'


def _picture(picture: Picture) -> str:
    buffer = io.BytesIO()
    picture.figure.savefig(buffer, format="png", dpi=130)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    caption = escape(picture.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}" '
        f'width="{100 * picture.figure.get_figwidth():.0f}"><figcaption>{caption}</figcaption></figure>'
    )
