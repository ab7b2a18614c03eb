"""Search by NSGA-II of Optuna, a generation at a time, the same for the same seed.

K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE
Transactions on Evolutionary Computation 6(2), 2002; T. Akiba et al., Optuna: A Next-generation Hyperparameter
Optimization Framework, KDD 2019.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.stats import qmc

from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from finger_pin.version import installing

# How far out a design is that cannot be run at all: farther than any that breaks a bound within reason.
FAILED_EXCESS = 1e6
# Distribution indices of simulated binary crossover and polynomial mutation.
_CROSSOVER_INDEX, _MUTATION_INDEX = 15.0, 20.0


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
