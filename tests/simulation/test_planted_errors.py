"""The energy account exposes a law that is wrong, whichever it is."""

from dataclasses import replace

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control import proportional as controller_block
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.solve_ivp import integrate
from finger_pin.laws import capstan
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.simulation.energy import account


def share_left_open(loop, duration=0.006):
    """Integrate the Python right-hand side, keep its account, and return the residual over the turnover.

    A wrong law can make the system unstable; then the account of the first steps must do.
    """
    steps = []
    trajectory = integrate(
        loop.rhs,
        loop.initial_state(),
        duration,
        method="BDF",
        rtol=1e-6,
        atol=1e-6 * loop.finger.layout.scales(),
        watch=lambda time, x: steps.append(time),
        stop=lambda: len(steps) == 300,
    )
    times = np.linspace(0.0, trajectory.breakpoints[-1], 101)
    x = trajectory.interpolate(times)
    state = loop.finger.layout.unpack(x)
    motion = loop.dynamics.motion(state.position, state.velocity)
    kept = account(loop, trajectory, times, loop.evaluate(times, x), motion)
    return np.abs(kept.residual).max() / np.abs(kept.works.values).max(axis=0).sum()


@pytest.fixture(scope="module")
def loop():
    """The finger of reversals, pushed at its tip and driven a little into its lower limits."""
    settings = {
        "environment.fingertip_force": [0.2, 0.3, -0.3],
        "reference.joints.medial.offset": 0.42,
        "reference.joints.proximal.offset": 0.42,
    }
    return ClosedLoop.from_scenario(fp.load_scenario("reversals", settings))


@pytest.mark.slow
def test_the_account_of_the_loop_to_be_tampered_with_closes(loop):
    assert share_left_open(loop, 0.015) < 1e-5


def tampered(loop, monkeypatch, group, wrong):
    """Let the law of a table of rows return something else: `wrong` maps its arguments and its result."""
    rows = []
    for table in loop.finger.mechanism.rows:
        if table.group == group:

            def value(row, p, right=table.law.value):
                return wrong(row, *right(row, p))

            table = replace(table, law=replace(table.law, value=value))
        rows.append(table)
    monkeypatch.setattr(loop.finger.mechanism, "rows", tuple(rows))


def wrong_delivery(loop, monkeypatch):
    def pushed(row, force, rate, friction, *others):
        return np.maximum(0.0, row.command + friction), rate, friction, *others

    tampered(loop, monkeypatch, "driven_tendons", pushed)


def wrong_passive_friction(loop, monkeypatch):
    tampered(loop, monkeypatch, "passive_tendons", lambda row, force, *others: (-force, *others))


def wrong_passive_spring(loop, monkeypatch):
    tampered(loop, monkeypatch, "passive_halves", lambda row, force, *others: (-force, *others))


def wrong_joint_friction(loop, monkeypatch):
    tampered(loop, monkeypatch, "joint_friction", lambda row, force, *others: (-force, *others))


def wrong_stiction_rate(loop, monkeypatch):
    def halved(stiction, velocity, level, stiffness, _side):
        return stiffness * (velocity - 0.5 * stiction * np.abs(velocity) / level)

    monkeypatch.setattr(capstan, "stiction_rate", halved)


def wrong_gravity(loop, monkeypatch):
    original = Finger.motion

    def flipped(*arguments):
        found = original(*arguments)
        return found._replace(potential_energy=-found.potential_energy)

    monkeypatch.setattr(Finger, "motion", flipped)


def wrong_external_torque(loop, monkeypatch):
    original = RigidBody.forward_dynamics
    lever = np.array([1e-3, 0.0, 0.0, 0.0])
    monkeypatch.setattr(RigidBody, "forward_dynamics", lambda self, q, v, torque: original(self, q, v, torque + lever))


def wrong_command(monkeypatch):
    monkeypatch.setattr(controller_block, "proportional_torque", lambda gain, reference, q: gain * (q - reference))


@pytest.mark.slow
@pytest.mark.parametrize(
    "plant",
    [
        wrong_delivery,
        wrong_passive_friction,
        wrong_passive_spring,
        wrong_joint_friction,
        wrong_stiction_rate,
        wrong_gravity,
        wrong_external_torque,
    ],
)
def test_the_account_exposes_a_wrong_law(plant, loop, monkeypatch):
    plant(loop, monkeypatch)
    # A torque at a joint does work once the joint moves.
    duration = 0.015 if plant is wrong_external_torque else 0.006
    assert share_left_open(loop, duration) > 1e-3


@pytest.mark.slow
def test_the_account_does_not_judge_the_controller(loop, monkeypatch):
    """Whatever the actuators are told, the books balance: the account is about the finger."""
    wrong_command(monkeypatch)
    assert share_left_open(loop) < 1e-5
