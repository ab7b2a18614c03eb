"""The Rosenbrock methods on a finger: convergence, and what steps leave behind."""

import numpy as np
import pytest
from core_cases import Case
from test_core_linearisation import pieces
from validation.order import END, mean_order, smooth_motion, step_errors

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.integrator import _Recorder
from finger_pin.core.stepping.island_stepper import failure
from finger_pin.core.stepping.stepper import TABLEAUS
from finger_pin.core.steps import error_norm, integration


@pytest.fixture(scope="module", params=TABLEAUS)
def method(request):
    return request.param


@pytest.fixture(scope="module")
def smooth():
    """A loop with all its friction, moving so that nothing changes sign, slackens or reaches a limit."""
    return smooth_motion()


@pytest.mark.slow
def test_the_smooth_motion_has_no_kink(smooth):
    times = np.linspace(0.0, END, 200)
    assert not np.any(np.ptp(pieces(Case.of(smooth.loop), times, smooth.exact(times).T), axis=0))


def test_steps_on_a_finger_converge_with_the_order_of_the_method(smooth, method):
    """Steps are imposed: tolerances reject none, and every advance is one step."""
    errors = step_errors(smooth, method)
    assert errors[-1] < {"Rodas4": 2e-8, "Rodas5P": 1e-9}[method]
    order = TABLEAUS[method]().order
    assert order - 0.1 < mean_order(errors) < order + 0.5


def test_the_interpolant_of_a_step_converges_with_its_order(smooth, method):
    """Of one step from the same state: the error of an interpolant of order q is h^(q+1)."""
    x, errors = smooth.start, []
    for h in (2.5e-4, 1.25e-4, 6.25e-5):
        recorder = _Recorder(smooth.stepper(method, step=h), 0, 1)
        part = recorder.part
        assert recorder.advance(h) == integration.DONE and recorder.step_count == 1
        times = np.linspace(0.0, h, 9)
        found, _ = recorder.steps().interpolate(times)
        np.testing.assert_allclose(found[[0, -1]], [x, part.x], rtol=1e-15, atol=1e-18)
        errors.append(smooth.largest(found - smooth.exact(times).T))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - TABLEAUS[method]().order) < 0.5), (errors, orders)


@pytest.mark.parametrize("touching", [False, True], ids=["free", "touching"])
def test_a_rejected_step_leaves_no_trace(cases, method, touching):
    """From a first step that is much too long, the one accepted is the same as if it had been the first tried.

    The pins of a finger that touches are loaded by the contact, whose force turns with the posture.
    """
    case = Case.of(ClosedLoop.from_scenario(fp.load_scenario("press"))) if touching else cases["stick_slip"]
    x = case.loop.initial_state()
    if touching:
        x[1] += 0.37
        x += 1e-5 * np.random.default_rng(2).normal(size=x.shape)
    tried = case.part(method, x=x, step=0.5)
    record = tried.room(1)
    assert tried.advance(1.0, record) == (integration.FULL, 1)
    assert tried.memory.rejected_steps[0] > 0
    direct = case.part(method, x=x, step=tried.time)
    again = direct.room(1)
    assert direct.advance(1.0, again) == (integration.FULL, 1)
    assert direct.memory.rejected_steps[0] == 0
    np.testing.assert_array_equal(direct.x, tried.x)
    for ours, theirs in zip(vars(again).values(), vars(record).values(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_step_that_becomes_too_short_is_a_failure_that_keeps_the_state_and_names_the_culprit(cases, method):
    """An absolute tolerance that no rounding can meet, for one number of the state alone."""
    case = cases["reversals"]
    for culprit in (6, 9):
        part = case.part(method, rtol=0.0)
        part.atol[:] = 1.0
        part.atol[culprit] = 1e-60
        start = part.x.copy()
        status, _ = part.advance(1.0)
        assert status == integration.UNDERFLOW
        np.testing.assert_array_equal(part.x, start)
        assert part.time == 0.0
        name = case.layout.names[culprit]
        assert failure(part, status, case.layout.names).endswith(f"the error is largest in {name}")


def test_a_state_whose_error_is_no_number_is_named_before_any_that_is_only_large():
    """Wherever it stands; else the one with the largest error over its tolerance."""
    x, atol, worst = np.ones(5), np.array([1.0, 1.0, 1e-3, 1.0, 1.0]), error_norm.largest_error_state.py_func
    difference = np.array([3.0, 9.0, 0.1, 1.0, 2.0])
    assert worst(x, difference, 0.0, atol) == 2
    for place in range(5):
        broken = difference.copy()
        broken[place] = np.nan
        assert worst(x, broken, 0.0, atol) == place


@pytest.mark.slow
def test_an_integration_that_creeps_is_a_failure_that_goes_on_no_longer_and_names_the_culprit(cases, method):
    """An absolute tolerance that rounding meets only in steps far below a nanosecond."""
    case = cases["reversals"]
    part = case.part(method, rtol=0.0)
    part.atol[:] = 1.0
    part.atol[9] = 1e-22
    status, _ = part.advance(1.0)
    assert status == integration.STALLED
    tries = part.memory.accepted_steps[0] + part.memory.rejected_steps[0]
    assert 0.0 < part.time < tries * integration.LEAST_MEAN_STEP
    assert failure(part, status, case.layout.names).endswith("the error is largest in passive_velocity[T5]")


def test_a_rate_that_is_not_finite_is_a_failure_that_keeps_the_state_and_names_the_culprit(scenarios, method):
    """A mass at the edge of floating point makes the passive tendon's acceleration infinite, and nothing else."""
    table = scenarios["reversals"].model_dump()
    table["finger"]["passive_tendon"]["mass"] = 3e-308
    case = Case.of(ClosedLoop.from_scenario(fp.Scenario.model_validate(table)))
    x = case.loop.initial_state()
    x[14] = 1e3
    with np.errstate(over="ignore"):
        rate = case.loop.rhs(0.0, x)
    assert list(np.flatnonzero(~np.isfinite(rate))) == [9]
    part = case.part(method, x=x)
    status, _ = part.advance(1.0)
    assert status == integration.NOT_FINITE
    np.testing.assert_array_equal(part.x, x)
    assert failure(part, status, case.layout.names) == "the rate of passive_velocity[T5] is not finite"


def recorded(part, end, size):
    """Advance with a record of some size; return the times, states and interpolants of all steps."""
    record, kept = part.room(size), []
    while part.time < end:
        status, steps = part.advance(end, record)
        assert status in (integration.DONE, integration.FULL)
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


def test_an_advance_ends_exactly_at_the_given_time(cases, method):
    part = cases["reversals"].part(method)
    for end in (1e-9, 1e-3, 1e-3 + 1e-15, 0.1, 1.0 / 3.0):
        part.advance(end)
        assert part.time == end


@pytest.mark.parametrize("held", [False, True], ids=["continuous", "held"])
def test_an_advance_by_next_to_nothing_costs_one_step(cases, method, held):
    """And the step size that was found before is not forgotten."""
    case, taken = cases["reversals"], []
    if held:
        case = case.held()
        case.control.tension[:] = [2.0, 2.0, 6.0, 4.0]
    for gap in (0.0, 1e-12):
        part = case.part(method)
        for period in range(1, 40):
            part.advance(1e-3 * period)
            if period == 10 and gap > 0.0:
                part.advance(part.time + gap)
        taken.append(part.memory.accepted_steps[0])
    assert taken[1] <= taken[0] + 2
