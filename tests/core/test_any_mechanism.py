"""The compiled core against the readable evaluation, on random mechanisms of rows of every law."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from core_cases import Bound, relative
from random_mechanisms import by_listing, kinds_of, random_mechanism, random_states, with_other_numbers

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.core.stepping.solve_ivp import integrate
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows

pytestmark = pytest.mark.slow

#: Sixth-order central differences: where to look, in steps, and weights.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
# Fourth order, of the same evaluations: a kink tells the two apart.
ROUGH = np.array([0.0, 1.0, -8.0, 8.0, -1.0, 0.0]) / 12.0
# Two have contacts, one of them with torsion.
SEEDS = (0, 3, 4, 5)
# States of each whose Jacobian is compared, of those without a kink nearby.
ENOUGH = 2


def aside(row, p):
    return 0.0 * row.length, -row.state - 1.0


def aside_slopes(row, p, signals):
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)


ASIDE = fp.Law("aside", (), aside, aside_slopes, lambda row, p, force, rate, signals: (0.0 * force,), scale=1.0)


@pytest.fixture(scope="module", params=SEEDS)
def drawn(request):
    """A mechanism, inputs, forces at its tips, without forces for every third, and states: few, and many."""
    rng = np.random.default_rng(request.param)
    mechanism = random_mechanism(rng)
    force = rng.normal(size=(len(mechanism.body.tips), 3)) * (request.param % 3 != 0)
    command = rng.uniform(-0.5, 3.0, mechanism.channels)
    return mechanism, command, force, [random_states(mechanism, rng, count) for count in (8, 40)]


def assert_same(found, expected, mechanism, tolerance=4e-12):
    """Compare evaluations at many states: rates by kind, the account, and what every row sees, does and shows."""
    for kind in kinds_of(mechanism):
        assert relative(found.rate[:, kind], expected.rate[:, kind]) < tolerance
    for name in ("torque", "external", "acceleration"):
        largest = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=tolerance * largest, rtol=1e-9)
    for booked, wanted in zip(found.account(), expected.account(), strict=True):
        assert list(booked) == list(wanted) and wanted
        for name, amount in wanted.items():
            little = tolerance * np.abs(amount).max(initial=1.0)
            np.testing.assert_allclose(booked[name], amount, rtol=1e-9, atol=little)
    for group, theirs in expected.rows.items():
        ours = found.rows[group]
        pairs = zip(
            (*ours.row, ours.force, ours.rate, *ours.signals),
            (*theirs.row, theirs.force, theirs.rate, *theirs.signals),
            strict=True,
        )
        for mine, other in pairs:
            np.testing.assert_allclose(mine, other, rtol=1e-9, atol=tolerance * np.abs(other).max(initial=1.0))


def test_the_compiled_evaluation_is_the_readable_one(drawn):
    mechanism, command, force, (_, x) = drawn
    compiled = CompiledMechanism(mechanism)
    assert_same(compiled.evaluate(x, command, force), mechanism.evaluate(x, command, force), mechanism)
    assert_same(compiled.evaluate(x, command), mechanism.evaluate(x, command), mechanism)


@pytest.mark.parametrize("seed", range(5))
def test_a_mechanism_with_a_free_body_evaluates_alike(seed):
    rng = np.random.default_rng(100 + seed)
    mechanism = random_mechanism(rng, free=True)
    x, command = random_states(mechanism, rng, 10), rng.uniform(-0.5, 3.0, mechanism.channels)
    force = rng.normal(size=(len(mechanism.body.tips), 3))
    compiled = CompiledMechanism(mechanism)
    assert_same(compiled.evaluate(x, command, force), mechanism.evaluate(x, command, force), mechanism)


@pytest.mark.parametrize("seed", SEEDS)
def test_tables_may_be_listed_in_any_order(seed):
    """Compiled code would read what the last evaluation has left, did it read a force before that is known."""
    rng = np.random.default_rng(seed)
    mechanism = random_mechanism(rng)
    x, command = random_states(mechanism, rng, 4), rng.uniform(-0.5, 3.0, mechanism.channels)
    expected = mechanism.evaluate(x, command).rate
    listed, places = by_listing(mechanism, rng.permutation(len(mechanism.rows)))
    for evaluator in (listed, CompiledMechanism(listed)):
        found = evaluator.evaluate(x[:, places], command).rate
        np.testing.assert_allclose(found, expected[:, places], rtol=1e-9, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("wiring", ["inputs", "loads"])
def test_forces_that_read_each_other_in_a_circle_are_refused_and_the_circle_named(wiring):
    mechanism = random_mechanism(np.random.default_rng(2))
    body, last, before = mechanism.body, mechanism.rows[-1], mechanism.rows[-2]
    reading = replace(last, **{wiring: {before.group: np.ones((last.count, before.count))}})
    for group, width, circle in (
        (last.group, last.count, f"({before.group} reads {last.group}|{last.group} reads {before.group}) reads"),
        (before.group, before.count, f"{before.group} reads {before.group}$"),
    ):
        reader = replace(before, **{wiring: {group: np.ones((before.count, width))}})
        rows = [*mechanism.rows[:-2], reader, reading]
        with pytest.raises(fp.InputError, match=f"^rows: no force may depend on itself: {circle}"):
            Mechanism(body, rows, mechanism.lumps, mechanism.inertia)


@pytest.mark.parametrize("wiring", ["inputs", "loads", "readings"])
def test_a_reading_of_unknown_rows_or_with_weights_of_another_shape_is_refused(wiring):
    mechanism = random_mechanism(np.random.default_rng(2))
    tables = {table.group: table for table in mechanism.rows}
    body, before = mechanism.body, tables["other"]
    last = tables["one"]
    others = [table for table in mechanism.rows if table is not last]
    reader = replace(last, **{wiring: {"nowhere": np.ones((last.count, 1))}})
    with pytest.raises(fp.InputError, match=f"^rows.{last.group}.{wiring} = .nowhere.: no such table.*other"):
        Mechanism(body, [*others, reader], mechanism.lumps, mechanism.inertia)
    reader = replace(last, **{wiring: {before.group: np.ones((last.count, before.count + 1))}})
    with pytest.raises(fp.InputError, match=f"^rows.{last.group}.{wiring}.{before.group}: must have shape"):
        Mechanism(body, [*others, reader], mechanism.lumps, mechanism.inertia)
    with pytest.raises(fp.InputError, match=f"^rows = .{last.group}.: two tables have this name"):
        Mechanism(body, [*mechanism.rows, last], mechanism.lumps, mechanism.inertia)


@pytest.mark.parametrize("seed", range(3))
def test_rows_that_move_nothing_are_stepped_with_the_rest_and_change_none_of_it(seed):
    """A state that nothing couples, in one island or in one of several: z' = -z - 1 here, to e^-t (1 + z) - 1."""
    mechanism = random_mechanism(np.random.default_rng(seed))
    own = Rows("aside", ASIDE, ("aside",), np.zeros((0, 1)), np.zeros((1, mechanism.coordinates)))
    more = Mechanism(mechanism.body, [*mechanism.listed, own], mechanism.lumps, mechanism.inertia, mechanism.channels)
    x = 0.1 * random_states(mechanism, np.random.default_rng(seed), 1)[0]
    control, ends = held_control(mechanism.channels, mechanism.coordinates), []
    for each, start in ((mechanism, x), (more, np.append(x, 0.5))):
        # Errors of all states count: without tolerances of its own it would shorten steps.
        stepper = Stepper(each, control, start, TABLEAUS["Rodas5P"](), 1e-9, np.full(each.size, 1e-9))
        assert stepper.advance(0.1) == 0
        ends.append(stepper.x)
    np.testing.assert_allclose(ends[1][:-1], ends[0], rtol=1e-5, atol=1e-6)
    assert ends[1][-1] == pytest.approx(1.5 * np.exp(-0.1) - 1.0, abs=1e-8)


def test_an_earlier_run_does_not_change_a_later_one():
    """Nothing of a motion is left in what islands of the same wiring share."""
    rng = np.random.default_rng(206)
    mechanism = random_mechanism(rng, free=True)
    x, force = random_states(mechanism, rng, 2), rng.normal(size=(len(mechanism.body.tips), 3))
    control = held_control(mechanism.channels, mechanism.coordinates)
    given = mechanism, control, x[1], TABLEAUS["Rodas5P"](), 1e-4, np.full(mechanism.size, 1e-4), force
    ends = []
    for _ in range(2):
        stepper = Stepper(*given)
        stepper.hold(np.ones(mechanism.channels))
        assert stepper.advance(0.02) == 0
        ends.append(stepper.x)
        other = Stepper(with_other_numbers(mechanism, rng), control, x[0], *given[3:])
        other.advance(0.02)
    assert np.array_equal(*ends)


def jacobian(mechanism, x, command, force, step=5e-4):
    """Return the Jacobian by differences of the readable evaluation, or None where it has a kink nearby."""
    near = (x + step * OFFSETS[:, None, None] * np.eye(len(x))).reshape(-1, len(x))
    rates = mechanism.evaluate(near, command, force).rate.reshape(len(OFFSETS), len(x), len(x))
    rough, found = (np.tensordot(weights, rates, axes=1).T / step for weights in (ROUGH, WEIGHTS))
    return found if np.abs(rough - found).max() < 1e-7 * np.abs(found).max() else None


@pytest.fixture(scope="module")
def linearised(drawn):
    """States with their Jacobians by differences, and the compiled model."""
    mechanism, command, force, (few, many) = drawn
    control = held_control(mechanism.channels, mechanism.coordinates)
    control.tension[:] = command
    found = ((x, jacobian(mechanism, x, command, force)) for x in (*few, *many))
    return Bound(mechanism, control, force), [*islice((each for each in found if each[1] is not None), ENOUGH)]


def test_the_compiled_jacobian_is_that_of_differences_of_the_readable_evaluation(linearised):
    bound, states = linearised
    assert len(states) == ENOUGH
    for x, expected in states:
        _, solution, solved = bound.solve(0.0, x, 30.0)
        found = 30.0 * np.eye(len(x)) - np.linalg.inv(solution[:, :-1])
        assert solved
        for rows in kinds_of(bound.mechanism):
            for columns in kinds_of(bound.mechanism):
                block = np.ix_(rows, columns)
                assert np.abs(found - expected)[block].max() < 1e-7 * np.abs(expected[rows]).max() + 1e-9


@pytest.mark.parametrize("g", [3.0, 1e2, 1e4])
def test_the_condensed_solution_is_that_of_the_dense_system(linearised, g):
    bound, states = linearised
    for x, expected in states:
        _, solution, _ = bound.solve(0.0, x, g)
        dense = np.linalg.inv(g * np.eye(len(x)) - expected)
        assert np.abs(solution[:, :-1] - dense).max() < 1e-6 * np.abs(dense).max()


DURATION = 3e-3  # s


def ends(mechanism, x, control, force):
    """The states of a mechanism after `DURATION` by both compiled methods."""
    given = 1e-10, np.full(len(x), 1e-10), force
    steppers = [Stepper(mechanism, control, x, method(), *given) for method in TABLEAUS.values()]
    assert not any(stepper.advance(DURATION) for stepper in steppers)
    return [stepper.x for stepper in steppers]


def with_changed(mechanism, which):
    """The mechanism with other numbers in some of its tables."""
    tables = [
        replace(table, arm=1.3 * table.arm, parameters=1.1 * table.parameters) if which(table) else table
        for table in mechanism.rows
    ]
    return Mechanism(mechanism.body, tables, mechanism.lumps, mechanism.inertia)


def test_the_textbook_and_the_compiled_integrators_read_the_same_tables():
    """Their motions agree, also when the numbers of all tables are others; with this seed those of any table act."""
    rng = np.random.default_rng(33)
    mechanism = random_mechanism(rng)
    x, command = random_states(mechanism, rng, 1)[0], rng.uniform(0.5, 3.0, mechanism.channels)
    force = rng.normal(size=(len(mechanism.body.tips), 3))
    control = held_control(mechanism.channels, mechanism.coordinates)
    control.tension[:] = command
    # The readable rates take most of the time, and LSODA asks for the fewest of them.
    tight = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-9}
    for each in (mechanism, with_changed(mechanism, lambda table: True)):
        found = integrate(lambda _, y, each=each: each.evaluate(y, command, force).rate, x, DURATION, **tight)
        for end in ends(each, x, control, force):
            np.testing.assert_allclose(end, found.interpolate(np.array([DURATION]))[0], atol=1e-6)
    before = ends(mechanism, x, control, force)
    for table in mechanism.rows:
        after = ends(with_changed(mechanism, lambda other, own=table: other is own), x, control, force)
        assert min(np.abs(one - other).max() for one, other in zip(after, before, strict=True)) > 1e-4, table.law.name
