"""A search: its variables, objectives and constraints, and NSGA-II of Optuna, a generation at a time.

K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE
Transactions on Evolutionary Computation 6(2), 2002; T. Akiba et al., Optuna: A Next-generation Hyperparameter
Optimization Framework, KDD 2019.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from finger_pin.description.parameters import Tendon
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, description_of
from finger_pin.studies.designs import Range, parse_range
from finger_pin.studies.keys import BaseScenario, Point
from finger_pin.studies.metrics import Metric, resolve_metrics
from finger_pin.typing import Array
from finger_pin.version import installing

# How far out a design is that cannot be run at all: farther than any that breaks a bound within reason.
FAILED_EXCESS = 1e6
# Distribution indices of simulated binary crossover and polynomial mutation.
_CROSSOVER_INDEX, _MUTATION_INDEX = 15.0, 20.0
#: Least winding radius that a search of radii tries, m: a thinner pulley bends a tendon too sharply.
LEAST_RADIUS = 3e-3
_CONSTRAINT = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*(?P<sense>[<>]=)\s*(?P<bound>\S+)\s*")


class Search:
    """An evolutionary search in the unit cube.

    It depends on the objectives and constraints only by `tell`, so a search with the same values takes the
    same course: one is continued by repeating it with recorded values.
    """

    def __init__(self, size: int, objectives: int, population: int, seed: int, start: Array | None):
        """Start with a Latin hypercube.

        Args:
            size: Number of variables.
            objectives: Number of objectives.
            population: Designs of a generation.
            seed: Of the random numbers.
            start: Replaces a design of the hypercube, shape (size,).
        """
        try:
            import optuna
            from optuna.samplers import NSGAIISampler, nsgaii
        except ImportError:
            raise InputError("optimise", f"needs Optuna: {installing('optimise')}") from None
        with warnings.catch_warnings(action="ignore", category=optuna.exceptions.ExperimentalWarning):
            sampler = NSGAIISampler(
                population_size=population,
                seed=seed,
                crossover=nsgaii.SBXCrossover(eta=_CROSSOVER_INDEX),
                mutation=nsgaii.PolynomialMutation(eta=_MUTATION_INDEX),
            )
        verbosity = optuna.logging.get_verbosity()
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._study = optuna.create_study(directions=["minimize"] * objectives, sampler=sampler)
        optuna.logging.set_verbosity(verbosity)
        self._range: Any = {f"{number}": optuna.distributions.FloatDistribution(0.0, 1.0) for number in range(size)}
        designs = qmc.LatinHypercube(size, rng=np.random.default_rng(seed)).random(population)
        if start is not None:
            designs[0] = start
        for design in designs:
            self._study.enqueue_trial(dict(zip(self._range, design.tolist(), strict=True)))
        self._population, self._trials = population, list[Any]()

    def ask(self) -> Array:
        """Return the designs of the next generation, shape (population, size), each in the unit cube."""
        self._trials = [self._study.ask(self._range) for _ in range(self._population)]
        return np.array([[trial.params[name] for name in self._range] for trial in self._trials])

    def tell(self, values: Array, excesses: Array) -> None:
        """Record the objectives and excesses of designs.

        Args:
            values: Objectives, to be made small, shape (population, objectives).
            excesses: Over the constraints, above zero where broken, shape (population, constraints).
        """
        for trial, objectives, trial_excesses in zip(self._trials, values, excesses, strict=True):
            for number, excess in enumerate(trial_excesses.tolist()):
                trial.set_constraint(f"{number}", excess)
            self._study.tell(trial, objectives.tolist())


def nondominated(values: Array) -> Any:
    """Return a mask of the nondominated designs of objectives to be minimised, shape (m, k)."""
    dominates = (values[:, None] <= values[None]).all(axis=2) & (values[:, None] < values[None]).any(axis=2)
    return ~dominates.any(axis=0)


@dataclass(frozen=True)
class Variable:
    """Variable of a search.

    Attributes:
        keys: The keys that hold it.
        signs: 1 or -1 for each: a key with -1 holds the negative of the first one.
        range: Of the first key.
    """

    keys: tuple[str, ...]
    signs: tuple[int, ...]
    range: Range

    def at(self, share: float) -> Point:
        """Return the numbers of all keys at a share of the way from low to high."""
        value = float(self.range.at(share))
        return {key: sign * value for key, sign in zip(self.keys, self.signs, strict=True)}


def parse_variable(text: str) -> Variable:
    """Return the variable of ``KEY=LOW:HIGH`` or, for keys that go together, ``KEY,KEY2,-KEY3=LOW:HIGH``."""
    names, interval = parse_range(text)
    keys, signs = [], []
    for name in names.split(","):
        match = re.fullmatch(r"\s*(-?)\s*(\S+)\s*", name)
        if match is None:
            raise InputError("over", "must be KEY=LOW:HIGH, or KEY,KEY2,-KEY3=LOW:HIGH for keys that go together", text)
        keys.append(match[2])
        signs.append(-1 if match[1] else 1)
    if signs[0] < 0:
        raise InputError("over", "the range is that of the first key, which has no sign", text)
    return Variable(tuple(keys), tuple(signs), interval)


def radii(finger: FingerLike) -> list[Variable]:
    """Return the winding radii of a finger as variables: from `LEAST_RADIUS` to half the width of the joint's link.

    Radii of zero stay so, and so do signs. Tendons that cross the same joints at radii alike but for their signs are
    mirror images, and stay so.
    """
    description = description_of(finger)
    variables: dict[Any, list[tuple[str, float]]] = {}
    widths = {}
    for name, tendon in description.tendons.items():
        for joint, crossing in tendon.crossings.items():
            link = description.joints[joint].link
            if crossing.radius and link is not None and 0.5 * link.width > LEAST_RADIUS:
                widths[joint] = 0.5 * link.width
                key = f"finger.tendons.{name}.crossings.{joint}.radius"
                variables.setdefault((_shape(tendon), joint), []).append((key, crossing.radius))
    result = []
    for (_, joint), members in variables.items():
        first = members[0][1]
        ends = (LEAST_RADIUS, widths[joint]) if first > 0.0 else (-widths[joint], -LEAST_RADIUS)
        signs = tuple(1 if radius * first > 0.0 else -1 for _, radius in members)
        result.append(Variable(tuple(key for key, _ in members), signs, Range(*ends)))
    return result


def check_variables(variables: Sequence[Variable], base: BaseScenario) -> None:
    """Check that there are variables, and that their keys take numbers of their ranges."""
    if not variables:
        raise InputError("over", "at least one key is needed")
    varied: set[str] = set()
    for variable in variables:
        variable.range.check(variable.keys[0])
        for key, sign in zip(variable.keys, variable.signs, strict=True):
            if key in varied:
                raise InputError(key, "must not come twice")
            varied.add(key)
            base.check(key, [sign * float(variable.range.at(share)) for share in (0.5, 0.0, 1.0)])


def point_at(variables: Sequence[Variable], shares: Sequence[float]) -> Point:
    """Return the numbers of all keys at shares of the ways from low to high, one per variable."""
    return {key: value for v, share in zip(variables, shares, strict=True) for key, value in v.at(share).items()}


def start_values(variables: Sequence[Variable], base: BaseScenario) -> Mapping[str, float]:
    """Return the scenario's numbers at the keys."""
    return {key: base.number(key) for variable in variables for key in variable.keys}


def _shape(tendon: Tendon) -> Any:
    return tendon.kind, tuple((joint, abs(crossing.radius)) for joint, crossing in tendon.crossings.items())


@dataclass(frozen=True)
class Objective:
    """Objective: a metric to be minimised or maximised.

    Attributes:
        name: Of the metric.
        sign: 1 where less is better, -1 where more is.
    """

    name: str
    sign: int = 1


@dataclass(frozen=True)
class Constraint:
    """Bound of a metric.

    Attributes:
        name: Of the metric.
        bound: Least or greatest value.
        sign: 1 for a greatest value, -1 for a least one.
    """

    name: str
    bound: float
    sign: int

    def excess(self, value: float) -> float:
        """Return the relative excess of a value over the bound; at most zero if it is kept."""
        return self.sign * (value - self.bound) / (abs(self.bound) or 1.0)

    def __str__(self) -> str:
        """Return its text for `parse_constraint`."""
        return f"{self.name}{'<=' if self.sign > 0 else '>='}{self.bound:g}"


def parse_constraint(text: str) -> Constraint:
    """Return the constraint of ``NAME>=VALUE`` or ``NAME<=VALUE``."""
    match = _CONSTRAINT.fullmatch(text)
    try:
        bound = float(match["bound"]) if match else math.nan
    except ValueError:
        bound = math.nan
    if match is None or not math.isfinite(bound):
        raise InputError("constraint", "must be NAME>=VALUE or NAME<=VALUE, such as self_locking_margin>=1.5", text)
    return Constraint(match["name"], bound, 1 if match["sense"] == "<=" else -1)


@dataclass(frozen=True)
class Goals:
    """Objectives and constraints, with their metrics.

    Attributes:
        objectives: At least one.
        constraints: Any number.
        metrics: All metrics needed, each once.
    """

    objectives: tuple[Objective, ...]
    constraints: tuple[Constraint, ...]
    metrics: tuple[Metric, ...]

    @classmethod
    def from_metrics(
        cls,
        minimise: Iterable[str | Metric],
        maximise: Iterable[str | Metric],
        constraints: Iterable[str | Constraint],
        custom_metrics: Iterable[Metric] = (),
    ) -> Goals:
        """Collect goals.

        Args:
            minimise: Metrics to be made small, by name or as such.
            maximise: Metrics to be made large.
            constraints: Instances of `Constraint`, or texts for `parse_constraint`.
            custom_metrics: Custom metrics that constraints name.
        """
        minimised, maximised, texts = list(minimise), list(maximise), list(constraints)
        chosen = resolve_metrics([*minimised, *maximised])
        objectives = tuple(Objective(m.name, 1 if i < len(minimised) else -1) for i, m in enumerate(chosen))
        bounds = tuple(c if isinstance(c, Constraint) else parse_constraint(c) for c in texts)
        metrics_by_name = {m.name: m for m in (*chosen, *custom_metrics)}
        needed = {
            name: metrics_by_name.get(name, name) for name in (*(o.name for o in objectives), *(c.name for c in bounds))
        }
        return cls(objectives, bounds, resolve_metrics(needed.values()))

    def values(self, metrics: Mapping[str, float]) -> Array:
        """Return the objectives of a run, with the signs of those to be maximised reversed."""
        return np.array([each.sign * metrics[each.name] for each in self.objectives])

    def excesses(self, metrics: Mapping[str, float]) -> Array:
        """Return the excesses of a run over the constraints."""
        return np.array([each.excess(metrics[each.name]) for each in self.constraints])

    def describe(self) -> dict[str, str]:
        """Return the names of the metrics, and the constraints, by kind."""
        minimise = [each.name for each in self.objectives if each.sign > 0]
        maximise = [each.name for each in self.objectives if each.sign < 0]
        texts = {"minimise": minimise, "maximise": maximise, "constraints": map(str, self.constraints)}
        return {kind: ", ".join(names) for kind, names in texts.items()}
