"""A validation: families of checks, when it was made, and with which versions."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata

from validation.check import Section, Verdict

_PACKAGES = (
    "finger-pin",
    "pin",
    "numpy",
    "scipy",
    "numba",
    "xarray",
    "matplotlib",
    "mujoco",
    "yourdfpy",
    "scikit-sundae",
)


@dataclass(frozen=True, eq=False)
class Family:
    """A family of checks.

    Attributes:
        name: As on the command line.
        title: For people.
        about: A sentence on what is compared.
        section: Its results.
    """

    name: str
    title: str
    about: str
    section: Section

    def count(self, verdict: Verdict) -> int:
        """Return the number of checks with an outcome."""
        return sum(check.verdict is verdict for check in self.section.checks)


@dataclass(frozen=True, eq=False)
class Report:
    """A whole validation.

    Attributes:
        families: In the order of the report.
        date: When, UTC.
        versions: Of Python, the system, and the packages that took part; None where one is not installed.
    """

    families: tuple[Family, ...]
    date: str
    versions: dict[str, str | None]

    @classmethod
    def now(cls, families: tuple[Family, ...]) -> Report:
        """Return the report of results of this hour on this machine."""
        return cls(families, datetime.now(UTC).isoformat(" ", "minutes").replace("+00:00", " UTC"), versions())

    def count(self, verdict: Verdict) -> int:
        """Return the number of checks with an outcome."""
        return sum(family.count(verdict) for family in self.families)


def versions() -> dict[str, str | None]:
    """Return the versions of the programs compared."""
    found: dict[str, str | None] = {"Python": platform.python_version(), "system": platform.platform(terse=True)}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found
