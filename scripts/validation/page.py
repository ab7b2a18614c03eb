"""The report as one HTML page: figures are inside it, nothing is loaded from anywhere."""

from __future__ import annotations

from html import escape

from finger_pin.views.document import document, image
from validation.check import Check, Picture, Verdict
from validation.families import Family, Report

_STYLE = """
.outcome { font-size: 1.15rem; font-weight: 600; margin: .8rem 0 .2rem; }
.checks td:nth-child(2) { min-width: 13rem; }
th:last-child, td:last-child { padding-right: 0; white-space: nowrap; }
.verdict { display: inline-block; min-width: 4.2rem; text-align: center; padding: 0 .5rem; border-radius: .75rem;
  font-size: .8rem; font-weight: 600; border: 1px solid currentcolor; }
.pass { color: #0b7a55; background: #eaf6f1; } .differs { color: #a15c00; background: #fdf3e2; }
.fail { color: #fff; background: #c0271d; } .skipped { color: #5d6678; background: #f0f1f4; }
a { color: inherit; text-decoration-color: #e3e6ec; text-underline-offset: .2em; }
figure { margin: 1.2rem 0 0; }
"""


def page(report: Report, headline: str) -> str:
    """Return the page as text."""
    versions = ", ".join(f"{name} {version}" for name, version in report.versions.items() if version)
    missing = ", ".join(name for name, version in report.versions.items() if version is None)
    parts = [
        f'<p class="outcome">{escape(headline)}</p><p class="soft">{escape(report.date)}. {escape(versions)}.',
        f"Not installed: {escape(missing)}." if missing else "",
        "</p>",
        _summary(report),
        *(_family(family) for family in report.families),
    ]
    return document("finger_pin: validation", "\n".join(parts), _STYLE)


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
    note = f'<div class="doubt">{escape(check.note)}</div>' if check.note else ""
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
    caption = f'<figcaption class="soft">{escape(picture.caption)}</figcaption>'
    return f"<figure>{image(picture.figure, picture.caption)}{caption}</figure>"
