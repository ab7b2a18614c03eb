"""The options of law (9), Stribeck exponent and micro-damping, in a motion and in the energy account."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.simulation.energy import powers

OPTIONS = {
    "finger.tendon_friction.stribeck_exponent": [2, 1, 2, 1, 2],
    "finger.joint_friction.stribeck_exponent": [1, 2, 2, 1],
    "finger.tendon_friction.micro_damping": [3.0, 0.0, 1.0, 5.0, 0.5],
    "finger.joint_friction.micro_damping": [2e-3, 1e-3, 0.0, 3e-3],
}
# Far beyond what viscous friction covers, to see the options.
pytestmark = pytest.mark.filterwarnings("ignore::finger_pin.exceptions.MicroDampingWarning")


@pytest.fixture(scope="module")
def optional():
    return fp.Finger(fp.load_finger("ub_stand_in", OPTIONS))


def stiffness(finger, *groups):
    tables = {table.group: table for table in finger.mechanism.rows}
    return np.concatenate([tables[group]["stiffness"] for group in groups])


def random_states(finger, count, seed=0):
    """States that slide, stick, go beyond the limits and go slack, with tensions from zero upwards."""
    draw = np.random.default_rng(seed)
    position = draw.uniform(-0.2, 1.6, (count, 4))
    velocity = draw.normal(0.0, 1.0, (count, 4)) * 10.0 ** draw.uniform(-3.0, 0.7, (count, 1))
    near = finger.tendons.rest_position(position) + draw.normal(0.0, 1e-4, (count, 1))
    passive = draw.normal(0.0, 0.01, (count, 1))
    command = draw.uniform(0.0, 5.0, (count, 4)) * draw.integers(0, 2, (count, 4))
    command += draw.uniform(0.0, 0.2, (count, 4))
    tendon, joint = draw.normal(0.0, 0.2, (count, 5)), draw.normal(0.0, 1e-3, (count, 4))
    return np.hstack([position, near, velocity, passive, tendon, joint]), command


def test_micro_damping_is_booked_so_that_every_power_is_accounted_for(optional):
    """At any state: friction's power on tendons and joints is that of the bristles plus the booked losses."""
    x, command = random_states(optional, 200, seed=3)
    signals = optional.evaluate(x, command)
    booked, state = powers(signals), signals.state
    tendons = np.sum(signals["tendon_friction"] * signals["tendon_velocity"], axis=-1)
    cords = stiffness(optional, "driven_tendons", "passive_tendons")
    stored = np.sum(state.tendon_stiction * signals.at_first_place("rate") / cords, axis=-1)
    losses = booked["tendon_coulomb"] + booked["tendon_viscous"] + booked["tendon_micro_damping"]
    np.testing.assert_allclose(tendons, stored + losses, rtol=1e-10, atol=1e-12 * np.max(np.abs(stored)))
    joints = np.sum(signals["joint_friction"] * state.velocity, axis=-1)
    pins = stiffness(optional, "joint_friction")
    stored = np.sum(state.joint_stiction * signals.rows["joint_friction"].rate / pins, axis=-1)
    losses = booked["joint_coulomb"] + booked["joint_viscous"] + booked["joint_micro_damping"]
    np.testing.assert_allclose(joints, stored + losses, rtol=1e-10, atol=1e-12 * np.max(np.abs(stored)))
    assert np.any(booked["tendon_micro_damping"] != 0.0) and np.any(booked["joint_micro_damping"] != 0.0)


def test_tension_on_a_sticking_tendon_is_damped_by_sigma_1_and_the_normal_force_is_the_papers(optional):
    """Far from slack, bristles at rest: f = f^a - (b + sigma_1) v, F^n = |f^a - b v| + |f^a|."""
    x = optional.rest_state(np.array([0.0, 0.5, 0.5, 0.4]))
    optional.layout.unpack(x).velocity[0] = 1e-2
    command = np.full(4, 5.0)
    found = optional.evaluate(x, command)
    speed = found["tendon_velocity"][:4]
    micro = np.array([3.0, 0.0, 1.0, 5.0])
    np.testing.assert_allclose(found.strands[:4], command - (1.0 + micro) * speed, rtol=1e-14)
    np.testing.assert_allclose(found["tendon_normal_force"][:4], 10.0 - speed, rtol=1e-14)
    assert np.abs(speed[:2]).min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["reversals", "stick_slip"])
def test_a_motion_with_the_options_agrees_between_integrators_and_closes_its_energy_account(scenario):
    results = [
        fp.simulate(fp.load_scenario(scenario, OPTIONS | {"simulation.duration": 0.01, "simulation.method": method}))
        for method in ("Rodas5P", "Radau")
    ]
    for result in results:
        supplied = float(abs(result.energy_exchanged_actuators).max())
        assert float(abs(result.energy_residual).max()) < 1e-5 * supplied
        for kind in ("tendon", "joint"):
            assert float(result[f"energy_exchanged_{kind}_micro_damping"][-1]) > 0.0
    assert float(abs(results[0].joint_position - results[1].joint_position).max()) < 1e-5
    assert float(abs(results[0].tendon_tension - results[1].tendon_tension).max()) < 1e-2


def test_the_options_change_the_motion_and_their_defaults_are_the_papers():
    short = {"simulation.duration": 0.2}
    paper = fp.simulate(fp.load_scenario("reversals", short))
    spelt = {
        f"finger.{kind}_friction.{name}": value
        for kind in ("tendon", "joint")
        for name, value in (("stribeck_exponent", 1), ("micro_damping", 0.0))
    }
    assert fp.simulate(fp.load_scenario("reversals", short | spelt)).joint_position.equals(paper.joint_position)
    assert float(abs(paper.power_tendon_micro_damping).max()) == 0.0
    for entry_name, value in OPTIONS.items():
        other = fp.simulate(fp.load_scenario("reversals", short | {entry_name: value}))
        assert float(abs(other.joint_position - paper.joint_position).max()) > 1e-7, entry_name


@pytest.mark.parametrize("kind", ["tendon", "joint"])
@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("stribeck_exponent", 1.5, "whole number from 1 to 2"),
        ("stribeck_exponent", 3, "at most 2"),
        ("stribeck_exponent", 0.5, "at least 1"),
        ("stribeck_exponent", [1, 2], "list of"),
        ("micro_damping", -1.0, "at least 0"),
        ("micro_damping", [0.0, 1.0], "list of"),
    ],
)
def test_an_option_out_of_its_range_is_refused_by_name(kind, name, value, says):
    entry_name = f"finger.{kind}_friction.{name}"
    with pytest.raises(fp.InputError, match=says) as caught:
        fp.load_finger("ub_stand_in", {entry_name: value})
    assert entry_name in str(caught.value)
