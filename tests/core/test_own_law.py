"""The mechanism is open: a law that stands in this file alone, in both evaluators, with its Jacobian and account."""

from dataclasses import replace

import numpy as np
import pytest
import test_every_law
from core_cases import Bound
from law_cases import random_parameters, random_rows

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.tables.inputs import held_control
from finger_pin.laws.law import Law
from finger_pin.mechanism.rows import Rows

pytestmark = pytest.mark.slow


def hysteresis_rate(state, speed, stiffness, level):
    """Dahl's model: z' = s (v - z |v| / level)."""
    return stiffness * (speed - state * np.abs(speed) / level)


def value(row, p):
    linear, cubic, stiffness, level = p
    elastic = linear * row.length + cubic * row.length**3
    rate = hysteresis_rate(row.state, row.speed, stiffness, level)
    return -elastic - row.state, rate, elastic, row.state


def slopes(row, p, signals):
    linear, cubic, stiffness, level = p
    by_speed = stiffness * (1.0 - row.state * np.sign(row.speed) / level)
    by_state = -stiffness * np.abs(row.speed) / level
    by_length = -linear - 3.0 * cubic * row.length**2
    return (by_length, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0), (0.0, by_speed, by_state, 0.0, 0.0, 0.0)


def account(row, p, force, rate, signals):
    linear, cubic, stiffness, level = p
    elastic = linear * row.length**2 / 2.0 + cubic * row.length**4 / 4.0
    return elastic + row.state**2 / (2.0 * stiffness), row.state**2 * np.abs(row.speed) / level


RUBBER = Law(
    name="rubber with hysteresis",
    parameters=("linear", "cubic", "stiffness", "level"),
    value=value,
    slopes=slopes,
    account=account,
    signals=("elastic", "hysteresis"),
    losses=("hysteresis",),
    scale=1e-2,
)
# Of the proximal and the medial joint of `ub`: N m/rad, N m/rad3, N m/rad, N m.
NUMBERS = np.array([[0.02, 0.01], [0.05, 0.02], [1.0, 2.0], [2e-3, 1e-3]])


def with_rubber(description, law=RUBBER):
    """A finger with two rows of the law above."""
    rows = Rows(group="rubber", law=law, names=("proximal", "medial"), parameters=NUMBERS, arm=np.eye(5)[1:3])
    return fp.Finger(description, rows=[rows])


@pytest.fixture(scope="module")
def rubber(ub):
    return with_rubber(ub)


def states(finger, rng, count):
    """Random packed states within the ranges."""
    x = np.array([finger.rest_state(q) for q in rng.uniform(0.1, 0.8, (count, 4)) * [0.1, 1.0, 1.0, 1.0]])
    return x + rng.normal(size=x.shape) * 0.05 * finger.layout.scales()


def test_the_law_itself_keeps_what_every_law_promises():
    rng = np.random.default_rng(1)
    drawn = RUBBER, random_rows(rng, test_every_law.COUNT), random_parameters(RUBBER, rng, test_every_law.COUNT)
    test_every_law.test_slopes_are_the_derivatives_of_the_value(drawn)
    test_every_law.test_the_account_explains_the_power_of_every_row(drawn)


def test_its_states_join_the_packed_state_with_names_and_scales(rubber, finger):
    assert rubber.layout.names == (*finger.layout.names, "rubber[proximal]", "rubber[medial]")
    np.testing.assert_array_equal(rubber.layout.scales()[-2:], 1e-2)


def test_both_evaluators_give_its_torque_at_any_state(rubber, finger):
    """Against the bare finger: the difference of what inverse dynamics needs is the torque of the law by hand."""
    rng = np.random.default_rng(2)
    x, command = states(rubber, rng, 30), rng.uniform(1.0, 5.0, (30, 4))
    numpy, compiled = rubber.evaluate(x, command), CompiledFinger(rubber).evaluate(x, command)
    bare = finger.evaluate(x[:, :-2], command)
    for k, (q, z) in enumerate(zip(x[:, :4], x[:, -2:], strict=True)):
        torque = np.zeros(4)
        torque[1:3] = -NUMBERS[0] * q[1:3] - NUMBERS[1] * q[1:3] ** 3 - z
        for found in (numpy, compiled):
            difference = rubber.rigid_body.mass_matrix(q) @ (
                found["joint_acceleration"][k] - bare["joint_acceleration"][k]
            )
            np.testing.assert_allclose(difference, torque, atol=1e-9)


def test_its_jacobian_is_exact(rubber):
    rng, control = np.random.default_rng(3), held_control(4, 5)
    control.tension[:] = [2.0, 2.0, 5.0, 4.0]
    bound = Bound(rubber.mechanism, control)
    own = rubber.layout.size - 2 + np.arange(2)
    for x in states(rubber, rng, 20):
        solution = bound.solve(0.0, x, 1e4)[1]
        found = 1e4 * np.eye(len(x)) - np.linalg.inv(solution[:, :-1])
        # Of its states: dz' by velocities and by z itself, by hand.
        speed, z = x[6:8], x[own]
        expected = np.zeros((2, len(x)))
        expected[[0, 1], [6, 7]] = NUMBERS[2] * (1.0 - z * np.sign(speed) / NUMBERS[3])
        expected[[0, 1], own] = -NUMBERS[2] * np.abs(speed) / NUMBERS[3]
        np.testing.assert_allclose(found[own], expected, atol=1e-7 * np.abs(expected).max())
        # And by the states, of the joints' accelerations: -M^-1 A^T.
        arms = np.eye(4)[:, 1:3]
        expected = -np.linalg.solve(rubber.rigid_body.mass_matrix(x[:4]), arms)
        np.testing.assert_allclose(found[5:9, own], expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


@pytest.fixture(scope="module")
def simulated(rubber):
    """The start of `reversals` with the law at two joints, by the compiled core and by scipy on the readable model."""
    found = {}
    for method in ("Rodas5P", "Radau"):
        settings = {"duration": 0.01, "method": method, "rtol": 1e-8, "atol_scale": 1e-8, "sample_rate": 2000.0}
        scenario = fp.load_scenario("reversals", {f"simulation.{name}": value for name, value in settings.items()})
        found[method] = fp.simulate(scenario, finger=rubber)
    return found


@pytest.mark.parametrize("method", ["Rodas5P", "Radau"])
def test_a_simulation_shows_its_signals_and_books_its_energy_and_its_loss(simulated, method):
    result = simulated[method]
    assert list(result["rubber"].values) == ["proximal", "medial"]
    q, v = (result[f"joint_{name}"].values[:, 1:3] for name in ("position", "velocity"))
    z = result["rubber_hysteresis"].values
    assert result["rubber_elastic"].dims == ("time", "rubber") and np.abs(z).max() > 1e-4
    np.testing.assert_allclose(result["rubber_elastic"], NUMBERS[0] * q + NUMBERS[1] * q**3, rtol=1e-12)
    stored = NUMBERS[0] * q**2 / 2.0 + NUMBERS[1] * q**4 / 4.0 + z**2 / (2.0 * NUMBERS[2])
    np.testing.assert_allclose(result["energy_rubber"], stored.sum(axis=1), rtol=1e-12)
    power = np.sum(z**2 * np.abs(v) / NUMBERS[3], axis=1)
    np.testing.assert_allclose(result["power_rubber_hysteresis"], power, rtol=1e-12)
    lost = float(np.trapezoid(power, result["time"]))
    assert float(result["energy_exchanged_rubber_hysteresis"][-1]) == pytest.approx(lost, rel=1e-2)
    assert float(abs(result["energy_residual"]).max()) < 1e-6 * float(abs(result["energy_rubber"]).max())


def test_both_integrators_give_the_motion_with_the_law_and_it_is_another_one(simulated):
    for name, little in (("joint_position", 1e-7), ("rubber_hysteresis", 1e-7)):
        assert float(abs(simulated["Rodas5P"][name] - simulated["Radau"][name]).max()) < little
    bare = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.01, "simulation.sample_rate": 2000.0}))
    assert float(abs(simulated["Rodas5P"]["joint_position"] - bare["joint_position"]).max()) > 1e-3


def soft(length):
    assert length < 1.0
    return length


def strict(row, p):
    return (-soft(row.length), *value(row, p)[1:])


def test_a_law_that_may_raise_is_refused_as_compiled_code_would_tell_nobody(ub):
    finger = with_rubber(ub, replace(RUBBER, value=strict))
    with pytest.raises(fp.InputError, match=r"^law.soft: must raise no exception, .*return nan"):
        CompiledFinger(finger)
