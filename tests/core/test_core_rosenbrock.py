"""The Rosenbrock methods: order conditions, stability, convergence on a finger, and what steps leave behind."""

from functools import cache
from itertools import combinations_with_replacement

import kernels
import numpy as np
import pytest
from core_cases import Case
from test_core_linearisation import pieces

import finger_pin as fp
from finger_pin.commands.validation.order import END, mean_order, smooth_motion, step_errors
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core import rosenbrock
from finger_pin.core.integrator import _Recorder
from finger_pin.core.part import failure
from finger_pin.core.stepper import TABLEAUS

METHODS = tuple(TABLEAUS)
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


@pytest.fixture(scope="module", params=METHODS)
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


@pytest.fixture(scope="module")
def smooth():
    """A loop with all its friction, moving so that nothing changes sign, slackens or reaches a limit."""
    return smooth_motion()


def test_the_smooth_motion_has_no_kink(smooth):
    times = np.linspace(0.0, END, 200)
    assert not np.any(np.ptp(pieces(Case.of(smooth.loop), times, smooth.exact(times).T), axis=0))


def test_steps_on_a_finger_converge_with_the_order_of_the_method(smooth, method):
    """Steps are imposed: tolerances reject none, and every advance is one step."""
    errors = step_errors(smooth, method)
    assert errors[-1] < {"Rodas4": 2e-8, "Rodas5P": 1e-9}[method]
    assert ORDER[method] - 0.1 < mean_order(errors) < ORDER[method] + 0.5


def test_the_interpolant_of_a_step_converges_with_its_order(smooth, method):
    """Of one step from the same state: the error of an interpolant of order q is h^(q+1)."""
    x, errors = smooth.start, []
    for h in (2.5e-4, 1.25e-4, 6.25e-5):
        recorder = _Recorder(smooth.stepper(method, step=h), 0, 1)
        part = recorder.part
        assert recorder.advance(h) == rosenbrock.DONE and recorder.taken == 1
        times = np.linspace(0.0, h, 9)
        found, _ = recorder.steps().interpolate(times)
        np.testing.assert_allclose(found[[0, -1]], [x, part.x], rtol=1e-15, atol=1e-18)
        errors.append(smooth.largest(found - smooth.exact(times).T))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - ORDER[method]) < 0.5), (errors, orders)


@pytest.mark.parametrize("touching", [False, True], ids=["free", "touching"])
def test_a_rejected_step_leaves_no_trace(cases, method, touching):
    """From a first step that is much too long, the one accepted is the same as if it had been the first tried.

    The pins of a finger that touches are loaded by the contact, whose force turns with the posture.
    """
    case = Case.of(ClosedLoop.from_scenario(fp.load_scenario("press"))) if touching else cases["stick_slip"]
    x = case.loop.initial_state()
    if touching:
        x[1] += 0.37
        x += 1e-3 * np.random.default_rng(2).normal(size=x.shape)
    tried = case.part(method, x=x, step=0.5)
    record = tried.room(1)
    assert tried.advance(1.0, record) == (rosenbrock.FULL, 1)
    assert tried.memory[rosenbrock.REJECTED] > 0
    direct = case.part(method, x=x, step=tried.time)
    again = direct.room(1)
    assert direct.advance(1.0, again) == (rosenbrock.FULL, 1)
    assert direct.memory[rosenbrock.REJECTED] == 0
    np.testing.assert_array_equal(direct.x, tried.x)
    for ours, theirs in zip(vars(again).values(), vars(record).values(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_step_that_becomes_too_short_is_a_failure_that_keeps_the_state_and_names_the_culprit(cases, method):
    """An absolute tolerance that no rounding can meet, for one number of the state alone."""
    case = cases["fig6"]
    for culprit in (6, 9):
        part = case.part(method, rtol=0.0)
        part.atol[:] = 1.0
        part.atol[culprit] = 1e-60
        start = part.x.copy()
        status, _ = part.advance(1.0)
        assert status == rosenbrock.UNDERFLOW
        np.testing.assert_array_equal(part.x, start)
        assert part.time == 0.0
        name = case.layout.names[culprit]
        assert failure(part, status, case.layout.names).endswith(f"the error is largest in {name}")


def test_a_state_whose_error_is_no_number_is_named_before_any_that_is_only_large():
    """Wherever it stands; else the one with the largest error over its tolerance."""
    x, atol = np.ones(5), np.array([1.0, 1.0, 1e-3, 1.0, 1.0])
    difference = np.array([3.0, 9.0, 0.1, 1.0, 2.0])
    assert kernels.worst(x, difference, 0.0, atol) == 2
    for place in range(5):
        broken = difference.copy()
        broken[place] = np.nan
        assert kernels.worst(x, broken, 0.0, atol) == place


def test_an_integration_that_creeps_is_a_failure_that_goes_on_no_longer_and_names_the_culprit(cases, method):
    """An absolute tolerance that rounding meets only in steps far below a nanosecond."""
    case = cases["fig6"]
    part = case.part(method, rtol=0.0)
    part.atol[:] = 1.0
    part.atol[9] = 1e-22
    status, _ = part.advance(1.0)
    assert status == rosenbrock.CREEPING
    tries = part.memory[[rosenbrock.ACCEPTED, rosenbrock.REJECTED]].sum()
    assert 0.0 < part.time < tries * rosenbrock.LEAST_MEAN_STEP
    assert failure(part, status, case.layout.names).endswith("the error is largest in passive_velocity[T5]")


def test_a_rate_that_is_not_finite_is_a_failure_that_keeps_the_state_and_names_the_culprit(scenarios, method):
    """A mass at the edge of floating point makes the passive tendon's acceleration infinite, and nothing else."""
    table = scenarios["fig6"].model_dump()
    table["finger"]["passive_tendon"]["mass"] = 1e-320
    case = Case.of(ClosedLoop.from_scenario(fp.Scenario.model_validate(table)))
    x = case.loop.initial_state()
    x[14] = 0.1
    with np.errstate(over="ignore"):
        rate = case.loop.rhs(0.0, x)
    assert list(np.flatnonzero(~np.isfinite(rate))) == [9]
    part = case.part(method, x=x)
    status, _ = part.advance(1.0)
    assert status == rosenbrock.NOT_FINITE
    np.testing.assert_array_equal(part.x, x)
    assert failure(part, status, case.layout.names) == "the rate of passive_velocity[T5] is not finite"


def recorded(part, end, size):
    """Advance with a record of some size; return the times, states and interpolants of all steps."""
    record, kept = part.room(size), []
    while part.time < end:
        status, steps = part.advance(end, record)
        assert status in (rosenbrock.DONE, rosenbrock.FULL)
        kept.append([each[:steps].copy() for each in vars(record).values()])
    return [np.concatenate(each) for each in zip(*kept, strict=True)]


@pytest.mark.parametrize("held", [False, True], ids=["continuous", "held"])
def test_steps_do_not_depend_on_the_size_of_the_record_nor_on_the_run(cases, method, held):
    """Bit by bit. Held tensions jump at every period, which shall not happen where a record is full."""
    runs = []
    for size in (1, 4, 7, 10_000, 10_000):
        case = cases["stick_slip"]
        if held:
            case = case.held()
        part, kept = case.part(method), []
        for period in range(5):
            case.control.tension[:] = [6.0 + period, 6.0, 14.0 - period, 10.0]
            kept.append(recorded(part, 2e-3 * (period + 1), size))
        runs.append([np.concatenate(each) for each in zip(*kept, strict=True)])
    assert len(runs[0][0]) > 40
    for run in runs[1:]:
        for ours, first in zip(run, runs[0], strict=True):
            np.testing.assert_array_equal(ours, first)


def test_an_advance_ends_exactly_where_it_is_told(cases, method):
    part = cases["fig6"].part(method)
    for end in (1e-9, 1e-3, 1e-3 + 1e-15, 0.1, 1.0 / 3.0):
        part.advance(end)
        assert part.time == end


@pytest.mark.parametrize("held", [False, True], ids=["continuous", "held"])
def test_an_advance_by_next_to_nothing_costs_one_step(cases, method, held):
    """And the step size that was found before is not forgotten."""
    case, taken = cases["fig6"], []
    if held:
        case = case.held()
        case.control.tension[:] = [2.0, 2.0, 6.0, 4.0]
    for gap in (0.0, 1e-12):
        part = case.part(method)
        for period in range(1, 40):
            part.advance(1e-3 * period)
            if period == 10 and gap > 0.0:
                part.advance(part.time + gap)
        taken.append(part.memory[rosenbrock.ACCEPTED])
    assert taken[1] <= taken[0] + 2
