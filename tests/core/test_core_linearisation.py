"""The compiled linearisation against sixth-order differences of the readable right-hand side, away from its kinks."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from core_cases import LOOPS, Case
from numpy.linalg import norm

from finger_pin.control.interface import ControlSignals
from finger_pin.core.tables.inputs import HELD
from finger_pin.laws.capstan import PASSIVE_FRICTION

pytestmark = pytest.mark.slow

#: Sixth-order central differences: where to look, in steps, and weights.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
#: By kind of state: small against what curves the right-hand side, large against rounding.
STEPS = {
    "position": 1e-4,
    "passive_position": 1e-8,
    "motor_position": 1e-5,
    "velocity": 1e-3,
    "passive_velocity": 1e-5,
    "motor_velocity": 1e-3,
    "tendon_stiction": 1e-4,
    "joint_stiction": 1e-6,
    "gearbox_stiction": 1e-5,
}
TIME_STEP = 1e-3
STATES = 40


@dataclass(frozen=True)
class Derivative:
    """A difference quotient and its rounding error; what is not more than rounding is zero."""

    value: np.ndarray
    rounding: np.ndarray

    @classmethod
    def of(cls, rates, step):
        """Take differences of rates along the first axis; steps along the last one."""
        value, rounding = np.tensordot(WEIGHTS, rates, axes=1) / step, 1e-14 * np.abs(rates).max(axis=0) / step
        return cls(np.where(np.abs(value) > rounding, value, 0.0), rounding)


@dataclass(frozen=True)
class Held:
    """A controller that keeps its tensions."""

    tension: tuple[float, ...]

    def command(self, time, reference, position, velocity):
        tension = np.broadcast_to(self.tension, (*position.shape[:-1], len(self.tension)))
        return ControlSignals(np.zeros_like(position), tension)


def pieces(case, times, x):
    """The smooth piece of the right-hand side of each state: equal rows mean the same piece."""
    loop, finger = case.loop, case.loop.finger
    signals = loop.evaluate(times, x)
    found, state = signals.finger, signals.finger.state
    tendon_floor = finger.tendons.friction[PASSIVE_FRICTION.parameters.index("floor"), : len(finger.routing.tendons)]
    rows = [
        np.sign(state.position),
        np.sign(state.velocity),
        np.sign(found["tendon_velocity"]),
        np.sign(found.command),
        np.sign(found.rows["limiter"]["depth"]),
        found["limiter_torque"] != 0.0,
        found.strands > 0.0,
        found.at_all_places("level") > tendon_floor,
        found.rows["joint_friction"]["level"] > finger.description.numbers["joint_friction"]["floor"],
    ]
    if finger.actuators.names:
        rows += [
            np.sign(state.motor_velocity),
            found.rows["driven_tendons"].row.command > 0.0,
            np.sign(found.rows["elastic_tendons"]["pull"]),
            np.sign(
                found["motor_torque"]
                - found.rows["driven_tendons"].row.command[..., finger.actuators.tendons] @ finger.actuators.spools
            ),
            np.abs(found["motor_current"]) < finger.actuators.motor[3],
        ]
    actuated = finger.routing.actuated
    steady = state.tendon_stiction + finger.tendons.viscous * found["tendon_velocity"]
    rows.append(found.rows["driven_tendons"].row.command > steady[..., :actuated])
    if case.control.kind != HELD:
        # The tendon at its least tension, (22).
        slack = (signals.control.tension - loop.controller.minimum) / loop.controller.internal
        rows.append(np.argmin(slack, axis=-1)[:, None])
    return np.concatenate(rows, axis=-1)


def smooth_states(case, rng):
    """Yield times and states with the differences of the right-hand side by state and by time."""
    loop, size = case.loop, case.layout.size
    step = np.zeros(size)
    for kind, own in STEPS.items():
        getattr(case.layout.unpack(step), kind)[:] = own
    for time, x in zip(rng.uniform(0.0, 4.0, STATES), case.states(rng, STATES), strict=True):
        near = (x + OFFSETS[:, None, None] * np.diag(step)).reshape(-1, size)
        times = time + TIME_STEP * OFFSETS
        stayed = np.tile(x, (len(OFFSETS), 1))
        visited = np.concatenate([pieces(case, np.full(len(near), time), near), pieces(case, times, stayed)])
        if np.any(np.ptp(visited, axis=0)):
            continue
        rates = loop.evaluate(np.full(len(near), time), near).finger.rate.reshape(len(OFFSETS), size, size)
        jacobian = Derivative.of(np.moveaxis(rates, 1, 2), step)
        rates = loop.evaluate(times, stayed).finger.rate
        yield time, x, jacobian, Derivative.of(rates, TIME_STEP)


def held(case):
    """The same finger under tensions that do not change."""
    still = case.held()
    still.control.tension[:] = np.linspace(1.0, 4.0, len(still.control.tension))
    return replace(still, loop=replace(case.loop, controller=Held(tuple(still.control.tension))))


PUSHED = [name for name in LOOPS if name.endswith("_pushed")]
FEW = ["reversals", "carried", "reversals_held", "two_passive_pushed_held", "lugre_held"]


@pytest.fixture(scope="module", params=[*PUSHED, *FEW])
def examined(request, cases):
    """A loop, and the states at which its right-hand side is smooth nearby."""
    name = request.param
    case = held(cases[name.removesuffix("_held")]) if name.endswith("_held") else cases[name]
    found = list(smooth_states(case, np.random.default_rng(7)))
    assert len(found) > STATES // 2
    return case, found


def extracted(case: Case, time, x, g):
    """Return J from the solutions of (g - J) u = r."""
    return g * np.eye(len(x)) - np.linalg.inv(case.solve(time, x, g)[1][:, :-1])


def test_every_block_of_the_jacobian_is_that_of_differences(examined):
    case, found = examined
    for time, x, jacobian, _ in found:
        ours = extracted(case, time, x, 1e5)
        for rows in case.kinds:
            for columns in case.kinds:
                block = np.ix_(rows, columns)
                scale = np.abs(jacobian.value[block]).max()
                if scale > 0.0:
                    error = np.abs(ours - jacobian.value)[block]
                    assert np.all(error < 2e-5 * scale + jacobian.rounding[block])


def test_the_states_examined_touch_a_limiter_and_have_a_slack_tendon(examined):
    case, found = examined
    x = np.array([each[1] for each in found])
    signals = case.loop.evaluate(np.array([each[0] for each in found]), x).finger
    assert np.any(signals["limiter_torque"] > 0.0) and np.any(signals["limiter_torque"] < 0.0)
    assert np.any(signals.strands == 0.0)


@pytest.mark.parametrize("g", [1e1, 1e3, 1e6])
def test_the_linear_system_is_solved(examined, g):
    """Against a dense solution with the differences' Jacobian, by kind of state, for long and for short steps."""
    case, found = examined
    rng = np.random.default_rng(8)
    for time, x, jacobian, _ in found:
        r = rng.normal(size=len(x)) * case.layout.scales()
        _, solution, solved = case.solve(time, x, g)
        u = solution[:, :-1] @ r
        expected = np.linalg.solve(g * np.eye(len(x)) - jacobian.value, r)
        assert solved
        for kind in case.kinds:
            assert norm(u[kind] - expected[kind]) < 1e-4 * norm(expected[kind])


def test_the_derivative_in_time_is_that_of_differences(examined):
    """It enters through the reference alone; tensions that are held have none."""
    case, found = examined
    for time, x, _, derivative in found:
        solution = case.solve(time, x, 1e3)[1]
        expected = solution[:, :-1] @ derivative.value
        rounding = np.abs(solution[:, :-1]) @ derivative.rounding
        for kind in case.kinds:
            error = np.abs(solution[:, -1] - expected)[kind]
            assert np.all(error <= 1e-4 * norm(expected[kind]) + rounding[kind])
    assert (case.control.kind == HELD) != any(np.any(each[3].value) for each in found)


def test_a_system_that_cannot_be_factorised_is_reported(cases):
    case = cases["reversals"]
    x = case.loop.initial_state()
    assert case.solve(0.0, x, 1e3)[2]
    for entry in (4, 9, 12):
        broken = x.copy()
        broken[entry] = np.nan
        assert not case.solve(0.0, broken, 1e3)[2]
