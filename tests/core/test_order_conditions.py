"""The coefficients of the Rosenbrock methods: order conditions, stages and stability."""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np
import pytest

from finger_pin.core.stepping.stepper import TABLEAUS

ORDER = {"Rodas4": 4, "Rodas5P": 5}


@cache
def trees(order):
    """All rooted trees with so many nodes; a tree is the sorted tuple of its branches."""
    if order == 1:
        return ((),)
    found = set()
    for sizes in _partitions(order - 1):
        choices = [()]
        for size in set(sizes):
            picked = combinations_with_replacement(trees(size), sizes.count(size))
            choices = [some + more for some in choices for more in list(picked)]
        found.update(tuple(sorted(each)) for each in choices)
    return tuple(sorted(found))


def _partitions(total, most=None):
    if total == 0:
        return [()]
    return [
        (first, *rest)
        for first in range(min(total, most or total), 0, -1)
        for rest in _partitions(total - first, first)
    ]


def size_of(tree):
    return 1 + sum(map(size_of, tree))


def density(tree):
    """Gamma of the tree: the product of the sizes of all subtrees."""
    return size_of(tree) * int(np.prod([density(branch) for branch in tree]))


class Classical:
    """A method in the coefficients in which the order conditions are written: alpha, Gamma and weights."""

    def __init__(self, tableau):
        """Undo the transformation that spares the products with J."""
        stages = len(tableau.nodes)
        self.gamma = np.linalg.inv(np.eye(stages) / tableau.gamma - tableau.coupling)
        self.alpha = tableau.stage @ self.gamma
        last = tableau.stage[-1].copy()
        last[-1] += 1.0
        self.weights = last @ self.gamma
        self.embedded = tableau.stage[-1] @ self.gamma
        self.dense = tableau.dense @ self.gamma

    def stages_of(self, tree):
        """Elementary weights of the stages: one branch alone sees Gamma too."""
        matrix = self.alpha + self.gamma if len(tree) == 1 else self.alpha
        branches = [matrix @ self.stages_of(branch) for branch in tree]
        return np.prod([np.ones(len(self.alpha)), *branches], axis=0)

    def defect(self, weights, tree, s=1.0):
        return weights @ self.stages_of(tree) - s ** size_of(tree) / density(tree)

    def interpolated(self, s):
        """Weights of the interpolant at a fraction of the step."""
        bend = self.dense[-1]
        for row in self.dense[-2::-1]:
            bend = row + s * bend
        return s * (self.weights + (1.0 - s) * bend)


@pytest.fixture(scope="module", params=TABLEAUS)
def method(request):
    return request.param


@pytest.fixture(scope="module")
def classical(method):
    return Classical(TABLEAUS[method]())


def test_trees_are_counted_as_in_the_literature():
    assert [len(trees(order)) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


def test_all_order_conditions_hold_up_to_the_order_and_not_beyond(method, classical):
    assert TABLEAUS[method]().order == ORDER[method]
    for size in range(1, ORDER[method] + 1):
        for tree in trees(size):
            assert abs(classical.defect(classical.weights, tree)) < 1e-12
    assert max(abs(classical.defect(classical.weights, tree)) for tree in trees(ORDER[method] + 1)) > 1e-6


def test_the_embedded_method_has_one_order_less(method, classical):
    for size in range(1, ORDER[method]):
        for tree in trees(size):
            assert abs(classical.defect(classical.embedded, tree)) < 1e-12
    assert max(abs(classical.defect(classical.embedded, tree)) for tree in trees(ORDER[method])) > 1e-6


@pytest.mark.parametrize("s", [0.1, 0.35, 0.5, 0.8])
def test_the_interpolant_has_one_order_less_everywhere_in_the_step(method, classical, s):
    for size in range(1, ORDER[method]):
        for tree in trees(size):
            assert abs(classical.defect(classical.interpolated(s), tree, s)) < 1e-12


def test_stages_lie_at_their_nodes_and_see_time_as_one_more_state(method, classical):
    tableau = TABLEAUS[method]()
    np.testing.assert_allclose(classical.alpha.sum(axis=1), tableau.nodes, atol=1e-13)
    np.testing.assert_allclose(classical.gamma.sum(axis=1), tableau.time, atol=1e-13)
    np.testing.assert_allclose(np.diag(classical.gamma), tableau.gamma, rtol=1e-13)


def amplification(classical, z):
    """Return R(z) of x' = lambda x with z = h lambda."""
    stages = len(classical.alpha)
    matrix = np.eye(stages) - z * (classical.alpha + classical.gamma)
    return 1.0 + z * classical.weights @ np.linalg.solve(matrix, np.ones(stages))


def test_the_methods_are_a_stable_and_forget_the_stiffest_parts(classical):
    for y in np.logspace(-3.0, 6.0, 400):
        assert abs(amplification(classical, 1j * y)) <= 1.0 + 1e-12
    assert abs(amplification(classical, -1e9)) < 1e-6
