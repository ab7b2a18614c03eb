"""What a search is after: objectives and constraints on metrics."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.studies.metrics import Metric, choose

_CONSTRAINT = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(?P<sense>[<>]=)\s*(?P<bound>\S+)\s*")


@dataclass(frozen=True)
class Objective:
    """A metric to be made small or large.

    Attributes:
        name: Of the metric.
        sign: 1 where less is better, -1 where more is.
    """

    name: str
    sign: int = 1


@dataclass(frozen=True)
class Constraint:
    """A bound that a metric has to keep.

    Attributes:
        name: Of the metric.
        bound: Least or greatest value.
        sign: 1 for a greatest value, -1 for a least one.
    """

    name: str
    bound: float
    sign: int

    def excess(self, value: float) -> float:
        """Return by how much a value breaks the bound, over the size of the bound; not above zero if it keeps it."""
        return self.sign * (value - self.bound) / (abs(self.bound) or 1.0)

    def __str__(self) -> str:
        """Spell it as `parse_constraint` reads it."""
        return f"{self.name}{'<=' if self.sign > 0 else '>='}{self.bound:g}"


def parse_constraint(text: str) -> Constraint:
    """Return the constraint of ``NAME>=VALUE`` or ``NAME<=VALUE``.

    Raises:
        InputError: If it is neither.
    """
    found = _CONSTRAINT.fullmatch(text)
    try:
        bound = float(found["bound"]) if found else math.nan
    except ValueError:
        bound = math.nan
    if found is None or not math.isfinite(bound):
        raise InputError("constraint", "must be NAME>=VALUE or NAME<=VALUE, such as self_locking_margin>=1.5", text)
    return Constraint(found["name"], bound, 1 if found["sense"] == "<=" else -1)


@dataclass(frozen=True)
class Goals:
    """Objectives and constraints, with the metrics that they need.

    Attributes:
        objectives: At least one.
        constraints: Any number.
        metrics: All that are needed, each once.
    """

    objectives: tuple[Objective, ...]
    constraints: tuple[Constraint, ...]
    metrics: tuple[Metric, ...]

    @classmethod
    def of(
        cls,
        minimise: Iterable[str | Metric],
        maximise: Iterable[str | Metric],
        constraints: Iterable[str | Constraint],
        further: Iterable[Metric] = (),
    ) -> Goals:
        """Collect goals.

        Args:
            minimise: Metrics to be made small, by name or as such.
            maximise: Metrics to be made large.
            constraints: As `Constraint` or spelt as `parse_constraint` reads them.
            further: Metrics of one's own that constraints name.

        Raises:
            InputError: If there is no objective, a metric is unknown or comes twice among them.
        """
        small, large, bounds = list(minimise), list(maximise), list(constraints)
        chosen = choose([*small, *large])
        objectives = tuple(Objective(m.name, 1 if i < len(small) else -1) for i, m in enumerate(chosen))
        limits = tuple(each if isinstance(each, Constraint) else parse_constraint(each) for each in bounds)
        known = {metric.name: metric for metric in (*chosen, *further)}
        needed = {name: known.get(name, name) for name in (*(o.name for o in objectives), *(c.name for c in limits))}
        return cls(objectives, limits, choose(needed.values()))

    def values(self, metrics: Mapping[str, float]) -> Array:
        """Return the objectives of a run, each to be made small."""
        return np.array([each.sign * metrics[each.name] for each in self.objectives])

    def excesses(self, metrics: Mapping[str, float]) -> Array:
        """Return the excesses of a run over the constraints."""
        return np.array([each.excess(metrics[each.name]) for each in self.constraints])

    def describe(self) -> dict[str, Any]:
        """Return them for a TOML file."""
        return {
            "minimise": [each.name for each in self.objectives if each.sign > 0],
            "maximise": [each.name for each in self.objectives if each.sign < 0],
            "constraints": [str(each) for each in self.constraints],
        }
