"""The search: NSGA-II of pymoo, a generation at a time, the same for the same seed.

K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE
Transactions on Evolutionary Computation 6(2), 2002; J. Blank and K. Deb, pymoo: Multi-Objective Optimization in Python,
IEEE Access 8, 2020.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import qmc

from finger_pin.exceptions import InputError
from finger_pin.typing import Array

# How far out a design is that cannot be run at all: farther than any that breaks a bound within reason.
HOPELESS = 1e6


class Search:
    """An evolutionary search in the unit cube.

    It knows of the objectives and constraints only what `tell` says, so a search with the same values takes the
    same course: one is continued by repeating it with recorded values.
    """

    def __init__(self, size: int, objectives: int, constraints: int, population: int, seed: int, start: Array | None):
        """Begin.

        Args:
            size: Number of variables.
            objectives: Number of objectives.
            constraints: Number of constraints.
            population: Designs of a generation.
            seed: Of the random numbers.
            start: A design to begin with, shape (size,), besides a Latin hypercube.

        Raises:
            InputError: If pymoo is not installed.
        """
        try:
            from pymoo.algorithms.moo.nsga2 import NSGA2
            from pymoo.core.problem import Problem
        except ImportError:
            raise InputError("optimise", "needs pymoo: python -m pip install pymoo") from None
        first = qmc.LatinHypercube(size, rng=np.random.default_rng(seed)).random(population)
        if start is not None:
            first[0] = start
        self._problem = Problem(n_var=size, n_obj=objectives, n_ieq_constr=constraints, xl=0.0, xu=1.0)
        self._algorithm: Any = NSGA2(pop_size=population, sampling=first)
        # It ends when it is no longer asked.
        self._algorithm.setup(self._problem, termination=("n_gen", np.inf), seed=seed, verbose=False)
        self._asked: Any = None

    def ask(self) -> Array:
        """Return the designs of the next generation, shape (population, size), each in the unit cube."""
        self._asked = self._algorithm.ask()
        return np.asarray(self._asked.get("X"), dtype=float)

    def tell(self, values: Array, excesses: Array) -> None:
        """Take objectives and excesses of designs.

        Args:
            values: Objectives, to be made small, shape (population, objectives).
            excesses: Over the constraints, above zero where broken, shape (population, constraints).
        """
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        Evaluator().eval(StaticProblem(self._problem, F=values, G=excesses), self._asked)
        self._algorithm.tell(infills=self._asked)


def nondominated(values: Array) -> Any:
    """Return a mask of the designs that no other is better than; objectives are to be made small, shape (m, k)."""
    better = (values[:, None] <= values[None]).all(axis=2) & (values[:, None] < values[None]).any(axis=2)
    return ~better.any(axis=0)
