"""Touches between two stages of a step: none is missed, whatever the tolerance and the method."""

import numpy as np
import pytest
from scipy.optimize import brentq

import finger_pin as fp
from finger_pin.core.stepping.rosenbrock import DONE, STEP
from finger_pin.simulation.setup import Setup

SURFACE = "{ stiffness = 1e5, damping = 0.0 }"
OBJECTS = "[environment.objects."
#: A ball of 5 mm is dropped 0.1 m onto a shelf of 20 mm, beside a finger at rest.
SHELF = f"""
finger = "ub"
{OBJECTS}shelf]
shape = "box"
sides = [0.1, 0.1, 0.02]
position = [0.3, 0.0, -0.015]
surface = {SURFACE}
{OBJECTS}ball]
shape = "sphere"
radius = 0.005
mass = 0.01
position = [0.3, 0.0, 0.1]
surface = {SURFACE}
[simulation]
duration = 1.0
"""
#: The first ball runs into the second, which is as heavy and at rest.
HEAD_ON = f"""
extends = "fig6"
[finger]
gravity = [0.0, 0.0, 0.0]
{OBJECTS}first]
shape = "sphere"
radius = 0.005
mass = 0.01
position = [0.3, 0.0, 0.0]
velocity = [0.05, 0.0, 0.0]
surface = {SURFACE}
{OBJECTS}second]
shape = "sphere"
radius = 0.005
mass = 0.01
position = [0.35, 0.0, 0.0]
surface = {SURFACE}
[simulation]
duration = 2.0
"""
#: A ball comes down on a finger that is held.
HELD = f"""
finger = "ub"
{OBJECTS}ball]
shape = "sphere"
radius = 0.003
mass = 0.001
position = [0.02, 0.0, 0.3]
velocity = [0.0, 0.0, -0.1]
surface = {SURFACE}
[simulation]
duration = 0.6
"""
#: A small ball lies on a thin plate beside the finger in full motion.
BESIDE = f"""
extends = "fig6"
{OBJECTS}plate]
shape = "box"
sides = [0.1, 0.1, 0.001]
position = [0.3, 0.0, -0.0005]
surface = {SURFACE}
{OBJECTS}ball]
shape = "sphere"
radius = 0.001
mass = 1e-4
position = [0.3, 0.0, 0.02]
surface = {SURFACE}
[simulation]
duration = 2.0
"""
#: A ball is dropped 1 m onto a thin plate, far from a finger at rest.
THIN = f"""
finger = "ub"
{OBJECTS}plate]
shape = "box"
sides = [0.1, 0.1, 0.005]
position = [30.0, 0.0, -1.0075]
surface = {SURFACE}
{OBJECTS}ball]
shape = "sphere"
radius = 0.005
mass = 0.01
position = [30.0, 0.0, 0.0]
surface = {SURFACE}
"""


def result_of(folder, text, **settings):
    path = folder / "case.toml"
    path.write_text(text)
    overrides = {f"simulation.{name}": each for name, each in settings.items()}
    return fp.simulate(fp.load_scenario(path, overrides=overrides))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
def test_a_ball_dropped_on_a_shelf_bounces_back_to_where_it_came_from(tmp_path, tolerance):
    """The floor is a spring without loss: the ball meets it after sqrt(2 h / g), for pi sqrt(m / k), or little less."""
    result = result_of(tmp_path, SHELF, rtol=tolerance, atol_scale=tolerance)
    height = result.object_position.sel(object="ball", axis="z").values
    fall, stay = np.sqrt(2.0 * 0.1 / 9.81), np.pi * np.sqrt(0.01 / 1e5)
    period = 2.0 * fall + stay
    since = np.mod(result.time.values, period)
    expected = 0.1 - 0.5 * 9.81 * np.minimum(since, period - since) ** 2
    assert height.min() > -1e-3
    assert height == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("stiffness", "mass", "tolerance"), [(1e9, 1e-3, 1e-3), (1e4, 1e-12, 1e-6)])
def test_no_impact_is_swallowed_however_short(stiffness, mass, tolerance):
    """Without gravity meanwhile m v dv = -k d (1 + c v) dd, so that v / c - ln(1 + c v) / c^2 is as before."""
    c, radius, gravity = 2.0, 0.008, 9.81
    for height in 10.0 ** np.linspace(-3.0, -0.7, 24):
        fall = np.sqrt(2.0 * gravity * height)
        kept = fall / c - np.log1p(c * fall) / c**2
        back = brentq(lambda v, kept=kept: -v / c - np.log1p(-c * v) / c**2 - kept, 0.0, (1.0 - 1e-15) / c)
        surface = {"stiffness": stiffness, "damping": c}
        shelf = {"shape": "box", "sides": [0.1, 0.1, 0.02], "position": [0.0, 0.3, -0.01], "surface": surface}
        ball = {"shape": "sphere", "radius": radius, "mass": mass, "position": [0.0, 0.3, radius + height]}
        entries = {"environment.objects": {"shelf": shelf, "ball": ball}, "simulation.rtol": tolerance}
        # Until it is highest.
        entries["simulation.duration"] = float((fall + back) / gravity)
        height_after = fp.simulate(fp.load_scenario("fig6", entries)).object_position[-1, 0, 2].item() - radius
        assert height_after == pytest.approx(back**2 / (2.0 * gravity), rel=1e-2)


def test_two_equal_balls_that_meet_head_on_exchange_their_velocities(tmp_path):
    velocity = result_of(tmp_path, HEAD_ON).object_velocity.sel(axis="x").isel(time=-1)
    assert velocity.values == pytest.approx([0.0, 0.05], abs=1e-6)


def test_a_ball_stays_above_a_finger_that_is_held_under_it(tmp_path):
    ball = result_of(tmp_path, HELD).object_velocity.sel(object="ball", axis="z")
    assert float(ball.max()) > 0.0


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_small_ball_stays_on_a_thin_plate_beside_a_finger_in_full_motion(tmp_path, tolerance):
    result = result_of(tmp_path, BESIDE, rtol=tolerance, atol_scale=tolerance)
    assert 0.0 < float(result.object_position.sel(object="ball", axis="z").min()) < 0.0011


def test_a_stepped_finger_refuses_to_start_deep_inside_an_object_as_a_run_does(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(SHELF.replace("position = [0.3, 0.0, 0.1]", "position = [0.3, 0.0, -0.005]"))
    scenario = fp.load_scenario(path)
    finger = fp.Finger(scenario.finger, objects=scenario.environment.objects)
    for begin in (lambda: fp.simulate(scenario), lambda: fp.Simulator(finger)):
        with pytest.raises(fp.InputError, match=r"shelf.* starts 5 mm deep in each other"):
            begin()


def test_a_body_that_flies_freely_has_an_account_that_closes(tmp_path):
    """It exchanges no energy: what is left open is a share of what it has."""
    text = HEAD_ON.replace("0.05, 0.0, 0.0", "0.0, 0.0, 1.0").replace(
        'extends = "fig6"', 'extends = "fig6"\ncontroller.gain = 0.1'
    )
    assert "account" not in result_of(tmp_path, text, duration=0.2).attrs


def test_what_sleeps_and_is_met_and_left_within_one_step_is_met(tmp_path):
    """A ball falls fast at a thin plate, with a step that would end far behind it, and is thrown back as fast."""
    path = tmp_path / "case.toml"
    path.write_text(THIN)
    (part,) = (each for each in Setup.of(fp.load_scenario(path)).stepper().parts if len(each.objects))
    width = len(part.tables.parents) + len(part.tables.lumps)
    assert part.advance(0.3)[0] == DONE and np.all(part.work.paths.asleep[: part.tables.touching])
    # Only the ball is integrated as exactly as ever, so that nothing else makes this step short.
    exact = np.concatenate([part.objects, width + part.objects])
    part.atol[np.setdiff1d(np.arange(len(part.atol)), exact)] = 1.0
    part.memory[STEP] = 0.3
    assert part.advance(0.6)[0] == DONE
    fall, stay = np.sqrt(2.0 * 1.0 / 9.81), np.pi * np.sqrt(0.01 / 1e5)
    up = 9.81 * (2.0 * fall + stay - 0.6)
    assert part.x[width + part.objects[2]] == pytest.approx(up, rel=2e-3)
