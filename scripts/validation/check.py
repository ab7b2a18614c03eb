"""Checks: a number expected, the number found, and the difference allowed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from matplotlib.figure import Figure

from finger_pin.typing import Array


class Verdict(StrEnum):
    """The outcome of a check."""

    PASS = "pass"
    DIFFERS = "differs"
    SKIPPED = "skipped"
    FAIL = "fail"


@dataclass(frozen=True)
class Check:
    """One comparison.

    Attributes:
        what: Quantity compared.
        source: Source of the expected value.
        expected: The value of the source; None if it did not come to a comparison.
        measured: Ours; None likewise.
        tolerance: Difference allowed; None likewise.
        unit: Of all three.
        verdict: The outcome.
        note: Remark for the reader, such as the cause of a known difference.
    """

    what: str
    source: str
    expected: float | None
    measured: float | None
    tolerance: float | None
    unit: str
    verdict: Verdict
    note: str = ""


def compare(
    what: str,
    source: str,
    measured: float,
    tolerance: float,
    unit: str,
    *,
    expected: float = 0.0,
    known: float = 0.0,
    note: str = "",
) -> Check:
    """Judge a number; one that is not finite fails.

    Args:
        what: Quantity compared.
        source: Source of the expected value.
        measured: Ours.
        tolerance: Difference allowed.
        unit: Of all of them.
        expected: The value of the source; zero where a deviation is measured.
        known: A difference up to this much is known and explained by the note: it is reported, but is no failure.
        note: Remark for the reader.
    """
    gap = abs(float(measured) - expected)
    verdict = Verdict.PASS if gap <= tolerance else Verdict.DIFFERS if gap <= known else Verdict.FAIL
    return Check(what, source, float(expected), float(measured), float(tolerance), unit, verdict, note)


def skipped(what: str, source: str, why: str) -> Check:
    """Return a check that could not be made."""
    return Check(what, source, None, None, None, "", Verdict.SKIPPED, why)


def failed(what: str, why: str) -> Check:
    """Return a check that broke before it came to a number."""
    return Check(what, "", None, None, None, "", Verdict.FAIL, why)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The same quantity from two sides, both of the same shape."""

    measured: Array
    expected: Array

    @property
    def largest(self) -> float:
        """The largest difference."""
        return float(np.max(np.abs(np.asarray(self.measured) - self.expected)))


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure and its caption."""

    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class Section:
    """The results of a family of checks."""

    checks: tuple[Check, ...]
    pictures: tuple[Picture, ...] = ()

    @classmethod
    def of(cls, checks: Iterable[Check], *pictures: Picture) -> Section:
        """Collect checks and figures."""
        return cls(tuple(checks), pictures)
