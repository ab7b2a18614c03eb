"""Touches between two stages of a step: none is missed, whatever the tolerance and the method."""

import numpy as np
import pytest
from scipy.optimize import brentq

import finger_pin as fp
from finger_pin.core.steps.integration import DONE
from finger_pin.description.loading import read_scenario
from finger_pin.simulation.setup import Setup

SURFACE = {"stiffness": 1e5, "damping": 0.0}


def ball(*position, radius=0.005, mass=0.01, **more):
    return {"shape": "sphere", "radius": radius, "mass": mass, "position": position, "surface": SURFACE, **more}


def plate(thickness, *position):
    return {"shape": "box", "sides": (0.1, 0.1, thickness), "position": position, "surface": SURFACE}


def scene(duration, objects, moving=False, **settings):
    """Return a scenario of a finger at rest, or in the motion of Fig. 6, among objects."""
    entries = {"environment.objects": objects, "simulation.duration": duration, **settings}
    return (
        fp.load_scenario("reversals", entries)
        if moving
        else read_scenario({"name": "rest", "finger": "ub_stand_in"}, entries)
    )


def head_on(duration, *velocity, **settings):
    """Return a scenario without gravity in which a ball runs into a second one, which is as heavy and at rest."""
    balls = {"first": ball(0.3, 0.0, 0.0, velocity=velocity), "second": ball(0.35, 0.0, 0.0)}
    return scene(duration, balls, moving=True, **{"finger.gravity": (0.0, 0.0, 0.0), **settings})


def shelf(height, **settings):
    """Return a scenario in which a ball of 5 mm is dropped onto a shelf of 20 mm, beside a finger at rest."""
    return scene(1.0, {"shelf": plate(0.02, 0.3, 0.0, -0.015), "ball": ball(0.3, 0.0, height)}, **settings)


def coordinates_of_ball(part):
    """Three that slide and three that turn."""
    return np.arange(part.structure.charts[0] - 3, part.structure.charts[0] + 3)


def tolerances(tolerance):
    return {"simulation.rtol": tolerance, "simulation.atol_scale": tolerance}


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
def test_a_ball_dropped_on_a_shelf_bounces_back_to_where_it_came_from(tolerance):
    """The floor is a spring without loss: the ball meets it after sqrt(2 h / g), for pi sqrt(m / k), or little less."""
    result = fp.simulate(shelf(0.1, **tolerances(tolerance)))
    height = result.object_position.sel(object="ball", axis="z").values
    fall, stay = np.sqrt(2.0 * 0.1 / 9.81), np.pi * np.sqrt(0.01 / 1e5)
    period = 2.0 * fall + stay
    since = np.mod(result.time.values, period)
    expected = 0.1 - 0.5 * 9.81 * np.minimum(since, period - since) ** 2
    assert height.min() > -1e-3
    assert height == pytest.approx(expected, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("stiffness", "mass", "tolerance"), [(1e9, 1e-3, 1e-3), (1e4, 1e-12, 1e-6)])
def test_no_impact_is_swallowed_however_short(stiffness, mass, tolerance):
    """Without gravity meanwhile m v dv = -k d (1 + c v) dd, so that v / c - ln(1 + c v) / c^2 is as before."""
    c, radius, gravity = 2.0, 0.008, 9.81
    for height in 10.0 ** np.linspace(-3.0, -0.7, 24):
        fall = np.sqrt(2.0 * gravity * height)
        kept = fall / c - np.log1p(c * fall) / c**2
        back = brentq(lambda v, kept=kept: -v / c - np.log1p(-c * v) / c**2 - kept, 0.0, (1.0 - 1e-15) / c)
        hard = {"surface": {"stiffness": stiffness, "damping": c}}
        falling = ball(0.0, 0.3, radius + height, radius=radius, mass=mass)
        objects = {"shelf": plate(0.02, 0.0, 0.3, -0.01) | hard, "ball": falling | hard}
        # Until it is highest.
        duration = float((fall + back) / gravity)
        result = fp.simulate(scene(duration, objects, moving=True, **{"simulation.rtol": tolerance}))
        height_after = result.object_position[-1, 0, 2].item() - radius
        assert height_after == pytest.approx(back**2 / (2.0 * gravity), rel=1e-2)


def test_a_step_that_meets_a_plate_ends_just_behind_the_touch_without_another_try():
    """A ball falls freely until sqrt(2 h / g), with the speed g t; the finger beside it rests."""
    height, gravity = 0.05, 9.81
    falling = scene(0.2, {"shelf": plate(0.02, 0.0, 0.3, -0.01), "ball": ball(0.0, 0.3, 0.005 + height)})
    part = next(each for each in Setup.from_scenario(falling).stepper().parts if len(each.structure.charts))
    room, touch, before, rejected = part.room(1), np.sqrt(2.0 * height / gravity), 0.0, 0.0
    while part.time <= touch:
        before, rejected = part.time, part.memory.rejected_steps[0]
        part.advance(1.0, room)
    width, fall = len(part.structure.prescribed), coordinates_of_ball(part)[2]
    assert part.memory.rejected_steps[0] == rejected
    assert 0.0 < part.time - touch < 1e-3 * (part.time - before)
    np.testing.assert_allclose(part.x[width + fall], -gravity * part.time, rtol=1e-6)
    np.testing.assert_allclose(part.x[fall] - 0.005 - height, -0.5 * gravity * part.time**2, rtol=1e-6)


def test_two_equal_balls_that_meet_head_on_exchange_their_velocities():
    velocity = fp.simulate(head_on(2.0, 0.05, 0.0, 0.0)).object_velocity.sel(axis="x").isel(time=-1)
    assert velocity.values == pytest.approx([0.0, 0.05], abs=1e-6)


def test_a_ball_stays_above_a_finger_that_is_held_under_it():
    falling = ball(0.02, 0.0, 0.3, velocity=(0.0, 0.0, -0.1), radius=0.003, mass=1e-3)
    velocity = fp.simulate(scene(0.6, {"ball": falling})).object_velocity.sel(object="ball", axis="z")
    assert float(velocity.max()) > 0.0


# At the loose tolerance it rolls 8 mm elsewhere, eight radians of its turn.
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_small_ball_stays_on_a_thin_plate_beside_a_finger_in_full_motion(tolerance):
    objects = {"plate": plate(1e-3, 0.3, 0.0, -0.0005), "ball": ball(0.3, 0.0, 0.02, radius=1e-3, mass=1e-4)}
    result = fp.simulate(scene(2.0, objects, moving=True, **tolerances(tolerance)))
    assert 0.0 < float(result.object_position.sel(object="ball", axis="z").min()) < 0.0011


def test_a_stepped_finger_refuses_to_start_deep_inside_an_object_as_a_run_does():
    scenario = shelf(-0.005)
    finger = fp.Finger(scenario.finger, objects=scenario.environment.objects)
    for begin in (lambda: fp.simulate(scenario), lambda: fp.Simulator(finger)):
        with pytest.raises(fp.InputError, match=r"shelf.* starts 5 mm deep in each other"):
            begin()


def test_a_body_that_flies_freely_has_an_account_that_closes():
    """It exchanges no energy: what is left open is a share of what it has."""
    assert "account" not in fp.simulate(head_on(0.2, 0.0, 0.0, 1.0, **{"controller.gain": 0.1})).attrs


def test_what_sleeps_and_is_met_and_left_within_one_step_is_met():
    """A ball falls 1 m onto a thin plate, with a step that would end far behind it, and is thrown back as fast."""
    thin = scene(1.0, {"plate": plate(0.005, 30.0, 0.0, -1.0075), "ball": ball(30.0, 0.0, 0.0)})
    (part,) = (each for each in Setup.from_scenario(thin).stepper().parts if len(each.structure.charts))
    width, own = len(part.structure.prescribed), coordinates_of_ball(part)
    assert part.advance(0.3)[0] == DONE and np.all(part.work.paths.culled[: part.structure.contact_rows])
    # Only the ball is integrated as exactly as ever, so that nothing else makes this step short.
    exact = np.concatenate([own, width + own])
    part.atol[np.setdiff1d(np.arange(len(part.atol)), exact)] = 1.0
    part.memory.step_size[0] = 0.3
    assert part.advance(0.6)[0] == DONE
    fall, stay = np.sqrt(2.0 * 1.0 / 9.81), np.pi * np.sqrt(0.01 / 1e5)
    up = 9.81 * (2.0 * fall + stay - 0.6)
    assert part.x[width + own[2]] == pytest.approx(up, rel=2e-3)
