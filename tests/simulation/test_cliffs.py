"""Runs that once took millions of steps, gigabytes, or a wrong number without a word."""

import os
import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from validation.wild_fingers import wild_scenario

import finger_pin as fp
from finger_pin.laws.spring import JOINT_SPRING, spring_energy
from finger_pin.mechanism.rows import Rows
from finger_pin.simulation import accuracy, recording
from finger_pin.views.summary import summarize

# Starts beyond ranges are meant.
pytestmark = pytest.mark.filterwarnings("ignore::finger_pin.exceptions.StartWarning")

LINK = {"length": 0.04, "width": 0.015, "mass": 5e-3}


def one_joint(limiter, **sections):
    """One joint with two opposed tendons, 0.45 rad beyond its limit at the start."""
    tendon = {"curvature_offset": 0.5}
    table = {
        "name": "one",
        "finger": {
            "name": "one",
            "joints": {"j": {"range": [-0.5, 0.5], "link": LINK}},
            "tendons": {name: tendon | {"crossings": {"j": {"radius": r}}} for name, r in (("A", 6e-3), ("B", -6e-3))},
            "stroke_limiter": limiter,
        },
        "controller": {"gain": 1.0},
        "reference": {"joints": {"j": {"offset": 0.0}}},
        "simulation": {"duration": 0.1, "initial": {"position": {"j": 0.95}}},
    }
    for name, entries in sections.items():
        table[name] = table[name] | entries
    return table


def steps_of(table, tolerance):
    table["simulation"] |= {"rtol": tolerance, "atol_scale": tolerance}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fp.exceptions.ScenarioWarning)
        return fp.simulate(fp.Scenario.model_validate(table)).attrs["solver_steps"]


@pytest.mark.slow
@pytest.mark.parametrize("limiter", [{"stiffness": 500.0, "damping": 100.0}, {"stiffness": 5e4, "damping": 10.0}])
@pytest.mark.parametrize("pull", [0.3, 0.9])
def test_a_looser_tolerance_never_costs_more_where_a_joint_creeps_out_of_its_limiter(limiter, pull):
    # Pushed outwards by its controller, the joint leaves along the clamp 1 + c theta' = 0.
    table = one_joint(limiter, reference={"joints": {"j": {"offset": pull + 0.9}}})
    counts = [steps_of(table, tolerance) for tolerance in (1e-3, 1e-4, 1e-6, 1e-8)]
    assert all(looser <= 1.1 * tighter for looser, tighter in pairwise(counts)), counts


def test_a_loop_that_diverges_is_stopped_with_the_speed_that_says_so():
    table = one_joint({"stiffness": 0.0})
    table["finger"]["joints"]["j"]["link"] = {"length": 0.01, "width": 0.01, "mass": 1e-5}
    table["controller"]["gain"] = 1e3
    with pytest.raises(fp.IntegrationError, match=r"joint_velocity\[j\] is beyond 34300 rad/s .* physical range"):
        fp.simulate(fp.Scenario.model_validate(table))


def test_what_rings_in_a_slow_run_is_named_with_its_frequency(monkeypatch):
    monkeypatch.setattr(accuracy, "_SLOW_STEPS", 100)
    overrides = {
        "simulation.duration": 1e-3,
        "finger.passive_tendon.mass": 1e-7,
        "finger.tendon_friction.viscous": 0.0,
        "finger.tendon_friction.coulomb": 0.0,
        "simulation.initial.velocity.distal": 50.0,
    }
    result = fp.simulate(fp.load_scenario("reversals", overrides))
    # A mass between two halves of K_h = 2 K_t.
    frequency = np.sqrt(2 * 2 * 5e4 / 1e-7) / (2.0 * np.pi)
    name, _, rest = result.attrs["ringing"].partition(" rings almost undamped at ")
    assert name in ("passive_velocity[T5]", "passive_position[T5]")
    assert float(rest.split(" Hz")[0]) == pytest.approx(frequency, rel=0.15)


@pytest.mark.slow
def test_what_control_and_friction_keep_swinging_in_a_slow_run_is_named_with_its_frequency(monkeypatch):
    monkeypatch.setattr(accuracy, "_SLOW_STEPS", 10_000)
    damped = "hand.fingers.*.finger.joint_friction.viscous"
    overrides = {"simulation.duration": 0.06, "simulation.sample_rate": 1e5, damped: 0.0}
    result = fp.simulate(fp.load_scenario("pinch", overrides))
    name, _, rest = result.attrs["ringing"].partition(" swings at ")
    joint = name.removeprefix("joint_velocity[").rstrip("]")
    # Zero crossings in the last 20 ms, two in a cycle.
    speed = result.joint_velocity.sel(joint=joint).values[-2000:]
    crossings = np.count_nonzero(np.diff(np.sign(speed - speed.mean())))
    assert float(rest.split(" Hz")[0]) == pytest.approx(crossings / 0.04, rel=0.05)


def test_a_result_that_cannot_fit_into_memory_is_refused_by_its_sample_rate(monkeypatch):
    pages = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**18}
    monkeypatch.setattr(os, "sysconf", pages.__getitem__)
    scenario = fp.load_scenario("reversals", {"simulation.sample_rate": 5e5})
    with pytest.raises(
        fp.InputError, match=r"^simulation.sample_rate = 500000.0: .* GiB of memory, .* at most"
    ) as found:
        fp.simulate(scenario)
    fitting = float(str(found.value).rsplit(" ", 1)[-1])
    settings = scenario.simulation.updated(sample_rate=0.99 * fitting)
    recording.check_memory(settings, fp.Finger("ub_stand_in"))


def test_bodies_whose_contacts_cannot_fit_into_memory_are_refused_before_it_is_asked_for(monkeypatch):
    """Every part has three rows and two states, each with gains by positions, velocities and these states."""
    finger = fp.load_scenario("pinch")
    hand = fp.Hand(finger.finger, objects=finger.environment.objects)
    parts = len(hand.scene.contacts.names)
    least = 8 * (3 + 2) * parts * (2 * hand.mechanism.coordinates + 2)
    pages = {"SC_PAGE_SIZE": 1, "SC_PHYS_PAGES": least}
    monkeypatch.setattr(os, "sysconf", pages.__getitem__)
    with pytest.raises(fp.InputError, match=rf"^contacts: {parts} parts of bodies can touch, which needs .* GiB"):
        fp.Simulator(hand)


def test_a_simulator_refuses_what_is_no_time_and_tensions_that_push(finger):
    simulator = fp.Simulator(finger)
    with pytest.raises(fp.InputError, match=r"^dt = .*above 0"):
        simulator.step([1.0] * 4, "a")
    with pytest.raises(fp.InputError, match=r"^inputs = .*must not be negative"):
        simulator.step([1.0, -1.0, 1.0, 1.0], 1e-3)
    assert simulator.time == 0.0


def forgetful(row, p, force, rate, signals):
    """The account of a spring that does not mention its damping."""
    return spring_energy(row.length, p[0], p[1]), 0.0 * row.speed


def share_left_open(result):
    works = [abs(values).max() for name, values in result.items() if name.startswith("energy_exchanged_")]
    return float(abs(result.energy_residual).max()) / float(sum(works))


def test_a_body_that_flies_freely_is_told_that_its_account_is_of_what_it_stores(tmp_path):
    """Nothing pulls, touches or weighs: a share of the energy exchanged would be one of nothing."""
    path = tmp_path / "brick.toml"
    path.write_text("""
finger = {base = "planar", gravity = [0, 0, 0]}
controller = {kind = "tensions"}
simulation = {duration = 10, rtol = 1e-3, atol_scale = 1e-3}
[environment.objects.brick]
shape = "box"
sides = [0.02, 0.04, 0.08]
position = [0, 0, 1]
mass = 0.1
angular_velocity = [0.001, 5, 0]
""")
    result = fp.simulate(path)
    assert " of the energy stored, as next to none is exchanged:" in result.attrs["account"]


@pytest.mark.slow
def test_an_account_that_does_not_close_is_warned_of():
    for law, tells in ((JOINT_SPRING, False), (replace(JOINT_SPRING, account=forgetful), True)):
        rows = Rows("band", law, ("medial",), np.array([[0.05], [0.0], [2e-3]]), np.eye(5)[2:3])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fp.exceptions.ScenarioWarning)
            result = fp.simulate("reversals", finger=fp.Finger("ub_stand_in", rows=[rows]))
        assert (
            (share_left_open(result) > 1e-4)
            == tells
            == ("account closes only to" in summarize(result).replace("\n", " "))
        )
        # A tighter tolerance does not help: the result is what was asked for.
        assert result.attrs["rtol"] == 1e-6


def test_an_impact_from_deep_inside_a_stiff_limiter_is_booked_to_a_hundred_thousandth():
    # What was stored at the start is lost in the limiter, nearly all of it, within a thousandth of a second.
    assert (
        share_left_open(fp.simulate(fp.Scenario.model_validate(one_joint({"stiffness": 5e4, "damping": 10.0})))) < 1e-5
    )


def test_the_account_closes_where_a_limiter_that_would_have_to_pull_lets_go_of_a_joint_inside_it():
    # A limiter loses 0.8 J in the first millisecond, the last of it without a force: past the clamp of (2).
    # Small errors grow there: whether its accuracy can be judged is a matter of rounding, which processors differ in.
    assert share_left_open(fp.simulate(wild_scenario(328))) < 1e-6


def test_a_power_that_bends_at_the_very_end_of_a_step_is_booked_to_a_millionth():
    # A limiter lets go in the last twentieth of a step, where no node of a quadrature inside the step is.
    result = fp.simulate(wild_scenario(1146))
    assert share_left_open(result) < 1e-6


def test_an_account_that_is_open_at_the_tolerance_is_told_and_closes_at_a_tighter_one():
    tight = wild_scenario(854).updated(simulation={"rtol": 1e-8, "atol_scale": 1e-8})
    result, closed = fp.simulate(wild_scenario(854)), fp.simulate(tight)
    assert share_left_open(result) > 1e-4 and "account closes only to" in result.attrs["account"]
    assert share_left_open(closed) < 1e-5 and "account" not in closed.attrs


def test_no_step_passes_over_a_limiter_that_presses_in_its_middle_alone():
    # A joint creeps out of its limiter along the clamp of (2): a step begins and ends past it, and not in between.
    result = fp.simulate(wild_scenario(1451))
    assert share_left_open(result) < 1e-5
