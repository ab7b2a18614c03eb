"""What a check is: a number that is expected, the number that was found, and how far apart they may be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from matplotlib.figure import Figure

from finger_pin.description.routing import Array


class Verdict(StrEnum):
    """How a check ended."""

    PASS = "pass"
    DIFFERS = "differs"
    SKIPPED = "skipped"
    FAIL = "fail"


@dataclass(frozen=True)
class Check:
    """One comparison.

    Attributes:
        what: What is compared.
        source: Where the expected value comes from.
        expected: The value of the source; None if it did not come to a comparison.
        measured: Ours; None likewise.
        tolerance: How far apart they may be; None likewise.
        unit: Of all three.
        verdict: The outcome.
        note: What a reader should know, such as why a known difference is there.
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
        what: What is compared.
        source: Where the expected value comes from.
        measured: Ours.
        tolerance: How far apart the two may be.
        unit: Of all of them.
        expected: The value of the source; zero where a deviation is measured.
        known: A difference up to this much is known and explained by the note: it is reported, but is no failure.
        note: What a reader should know.
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
    """A figure and a sentence that says what it shows."""

    figure: Figure
    caption: str


@dataclass(frozen=True, eq=False)
class Section:
    """What a family of checks found."""

    checks: tuple[Check, ...]
    pictures: tuple[Picture, ...] = ()

    @classmethod
    def of(cls, checks: Iterable[Check], *pictures: Picture) -> Section:
        """Collect checks and figures."""
        return cls(tuple(checks), pictures)
