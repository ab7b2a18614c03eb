"""The state after a period under held inputs, and its derivatives, against closed forms and differences of runs."""

import numpy as np
import pytest
import scipy.linalg
from hinged_link import HINGED_INERTIA, hinged_link

import finger_pin as fp
from finger_pin.core.stepping.period_map import PeriodMap
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.exceptions import InputError

PERIOD = 1e-3
KEYS = (
    "finger.joints.mcp.spring.stiffness",
    "finger.tendon_friction.coulomb",
    "finger.actuators.servo.spool_radius",
    "finger.tendons.flexor.crossings.pip.radius",
)


@pytest.fixture(scope="module")
def wound():
    """A finger with a servo in motion: the scenario, finger, state, and the voltage that moves it."""
    scenario = fp.load_scenario("wound")
    finger = fp.Finger(scenario.finger)
    simulator, voltage = fp.Simulator(finger, [0.1, 0.1, 0.1]), np.array([1.5])
    for _ in range(60):
        simulator.step(voltage, PERIOD)
    return scenario, finger, simulator.x, voltage


def with_changes(scenario, changes):
    """Return the scenario's finger, and that with each number changed."""
    family = ParametrisedScenario(scenario, KEYS)
    values = np.array(family.values)
    return [
        (
            fp.Finger(family.with_values((values + change * values * np.eye(len(KEYS))[k]).tolist()).finger),
            change * values[k],
        )
        for k, change in enumerate(changes)
    ]


def end(finger, x, inputs, force=None):
    """Return the state after a period by a run with small errors."""
    simulator = fp.Simulator(finger, [0.1, 0.1, 0.1], rtol=1e-9, atol_scale=1e-9)
    simulator.x = x
    simulator.step(inputs, PERIOD, force)
    return simulator.x


def test_derivatives_by_inputs_forces_and_parameters_are_differences_of_runs(wound):
    scenario, finger, x, voltage = wound
    periods = PeriodMap(finger, x, with_changes(scenario, [1e-6] * len(KEYS)), rtol=1e-9, atol_scale=1e-9)
    periods.inputs[:] = voltage
    assert not periods.advance(PERIOD)
    scale, size = finger.layout.scales(), len(x)
    expected = [(end(finger, x, voltage + 1e-3) - end(finger, x, voltage - 1e-3)) / 2e-3]
    for axis in np.eye(3):
        expected.append((end(finger, x, voltage, 1e-2 * axis) - end(finger, x, voltage, -1e-2 * axis)) / 2e-2)
    for (up, step), (down, _) in zip(
        with_changes(scenario, [1e-5] * len(KEYS)), with_changes(scenario, [-1e-5] * len(KEYS)), strict=True
    ):
        expected.append((end(up, x, voltage) - end(down, x, voltage)) / (2.0 * step))
    for column, slopes in zip(periods.derivatives[:, size:].T, expected, strict=True):
        assert np.abs((column - slopes) / scale).max() <= 1.5e-2 * np.abs(slopes / scale).max() + 1e-5


def test_rates_and_tensions_by_inputs_and_parameters_are_differences_of_fingers(wound):
    """Over a moment the state changes by its rate; only rows that a number changes are evaluated again."""
    scenario, finger, x, voltage = wound
    moment, size, names = 1e-9, len(x), ("tendon_tension", "spool_tension")
    periods = PeriodMap(finger, x, with_changes(scenario, [1e-6] * len(KEYS)))
    periods.inputs[:] = voltage
    periods.watch(names)
    slopes = periods.watched()[1].copy()
    assert not periods.advance(moment)

    def difference(up, down, step):
        pairs = []
        for other, inputs in (up, down):
            signals = other.evaluate(x, inputs)
            pairs.append((other.rhs(0.0, x, inputs), np.concatenate([signals[name] for name in names])))
        return [(first - second) / step for first, second in zip(*pairs, strict=True)]

    expected = [difference((finger, voltage + 1e-3), (finger, voltage - 1e-3), 2e-3)]
    ups, downs = (with_changes(scenario, [change] * len(KEYS)) for change in (1e-5, -1e-5))
    expected += [
        difference((up, voltage), (down, voltage), 2.0 * step) for (up, step), (down, _) in zip(ups, downs, strict=True)
    ]
    at = size + np.r_[0, np.arange(4, 4 + len(KEYS))]
    for column, (rate, tension) in zip(at, expected, strict=True):
        np.testing.assert_allclose(periods.derivatives[:, column] / moment, rate, atol=2e-3 * np.abs(rate).max())
        np.testing.assert_allclose(slopes[:, column], tension, rtol=1e-3, atol=1e-3)


def test_derivatives_by_the_state_are_differences_of_runs(wound):
    _, finger, x, voltage = wound
    periods, scale = PeriodMap(finger, x, rtol=1e-9, atol_scale=1e-9), finger.layout.scales()
    periods.inputs[:] = voltage
    periods.advance(PERIOD)
    steps = 1e-5 * scale
    changed = [(end(finger, x + step, voltage) - end(finger, x - step, voltage)) for step in np.diag(steps)]
    expected = np.array(changed).T / (2.0 * steps)
    error = np.abs(periods.derivatives[:, : len(x)] - expected) / scale[:, None] * scale
    assert error.max() <= 2e-2 * np.abs(expected / scale[:, None] * scale).max()


def test_derivatives_of_a_linear_finger_are_its_matrix_exponential():
    spring = {"stiffness": 0.4, "damping": 2e-3}
    finger = hinged_link(joints={"hinge": {"range": [-3.0, 3.0], "limited": False, "spring": spring}})
    periods = PeriodMap(finger, finger.rest_state([0.3], [-2.0]), rtol=1e-8, atol_scale=1e-8)
    periods.inputs[:] = 0.05
    assert not periods.advance(0.02)
    inertia = HINGED_INERTIA
    # By the states, and by the torque of the actuator.
    rates = np.array([[0.0, 1.0, 0.0], [-0.4 / inertia, -2e-3 / inertia, 1.0 / inertia], [0.0, 0.0, 0.0]])
    expected = scipy.linalg.expm(0.02 * rates)
    by_all = periods.derivatives[:2, [0, 1, len(periods.x)]]
    np.testing.assert_allclose(by_all, expected[:2], rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(periods.x[:2], (expected @ [0.3, -2.0, 0.05])[:2], rtol=1e-6)


def test_a_state_near_its_own_forgets_no_step(wound):
    _, finger, x, voltage = wound
    steps = []
    for forgets in (False, True):
        periods = PeriodMap(finger, x)
        periods.inputs[:] = voltage
        periods.advance(20 * PERIOD)
        before = periods.steps
        for period in range(21, 41):
            if forgets:
                periods.restart(periods.x)
            else:
                periods.x += 1e-12
            periods.advance(period * PERIOD)
        steps.append(periods.steps - before)
    assert 2 * steps[0] < steps[1]


def test_watched_tensions_and_their_slopes_are_those_of_the_finger(wound):
    _, finger, x, voltage = wound
    periods = PeriodMap(finger, x)
    periods.inputs[:] = voltage
    periods.watch(("tendon_tension", "spool_tension"))
    values, slopes = periods.watched()
    names = ("tendon_tension", "spool_tension")

    def tensions(state):
        signals = finger.evaluate(state, voltage)
        return np.concatenate([signals[name] for name in names])

    np.testing.assert_allclose(values, tensions(x), rtol=1e-12)
    for k, step in enumerate(1e-6 * finger.layout.scales()):
        shift = step * (np.arange(len(x)) == k)
        np.testing.assert_allclose(
            slopes[:, k], (tensions(x + shift) - tensions(x - shift)) / (2.0 * step), rtol=1e-3, atol=1e-3
        )


def test_bristles_are_limited_to_their_levels(wound):
    _, finger, x, _ = wound
    places = [k for k, name in enumerate(finger.layout.names) if name.startswith("gearbox_stiction")]
    bent = x.copy()
    bent[places] = 5.0
    periods = PeriodMap(finger, bent)
    levels = periods.limit_bristles()
    assert np.isfinite(levels[places]).all() and np.isinf(levels[: 2 * finger.mechanism.coordinates]).all()
    np.testing.assert_array_equal(periods.x[places], levels[places])
    # A level of (9) with its load and speed: what the law itself says.
    expected = finger.evaluate(bent, np.zeros(1)).rows["gearboxes"].rows
    assert expected.count == 1
    np.testing.assert_allclose(
        levels[places], finger.evaluate(bent, np.zeros(1)).field("gearboxes", "level"), rtol=1e-12
    )


def test_friction_without_bristles_limits_no_number_of_the_state():
    finger = fp.Finger(fp.load_scenario("wound", {"finger.joint_friction.law": "coulomb"}).finger)
    width = finger.mechanism.coordinates
    x = finger.rest_state([0.1, 0.1, 0.1], [3.0, 2.0, 1.0])
    periods = PeriodMap(finger, x)
    levels = periods.limit_bristles()
    np.testing.assert_array_equal(periods.x[: 2 * width], x[: 2 * width])
    assert np.isinf(levels[: 2 * width]).all() and np.isfinite(levels[2 * width :]).all()


def test_a_motor_fed_with_a_current_turns_by_its_torque_constant(wound):
    _, finger, _x, _ = wound
    slack = finger.rest_state([0.5, 0.5, 0.5])
    motor = finger.description.actuators["servo"].motor
    turns = list(finger.layout.names).index("motor_velocity[servo]")
    speeds = {}
    for current in (0.4, 0.5):
        periods = PeriodMap(finger, slack, currents=True)
        periods.inputs[:] = current
        periods.advance(1e-5)
        speeds[current] = periods.x[turns]
    # Friction, which has not begun to slide, is the same in both to the first order in time.
    expected = motor.constants[0] * 0.1 / motor.inertia * 1e-5
    assert speeds[0.5] - speeds[0.4] == pytest.approx(expected, rel=2e-3)


def test_what_a_period_map_cannot_follow_is_refused(wound):
    _scenario, finger, x, _ = wound
    other = fp.Finger(fp.load_scenario("pendulum").finger)
    with pytest.raises(InputError, match="the same finger with another number"):
        PeriodMap(finger, x, [(other, 1.0)])
    palm = fp.load_scenario("pour")
    moved = fp.Finger(palm.finger, objects=palm.environment.objects)
    with pytest.raises(InputError, match="must be at rest as a whole, without free bodies"):
        PeriodMap(moved, moved.rest_state(np.zeros(len(moved.routing.joints))))
