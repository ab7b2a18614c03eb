"""The error of a run where it outgrows a linearised flow."""

import numpy as np
import pytest
from validation.impact_scenarios import at_tolerance, impact_scenario

import finger_pin as fp
from finger_pin.core.stepping.companion_motion import Companion, Moment, difference
from finger_pin.simulation.setup import Setup


def test_the_error_of_what_slips_and_sticks_is_that_of_a_motion_that_starts_off_by_it():
    """A pad is dragged along a plate; the flow linearised along its motion makes four times as much of the error."""
    setup = Setup.of(fp.load_scenario("press"))
    stepper = setup.stepper()
    stepper.advance(2.5)
    part, off = stepper.parts[0], np.zeros_like(stepper.parts[0].x)
    off[part.joints] = 1e-4 * np.array([0.0, 1.0, -1.0, 0.5])
    x, attitude, begin = part.x.copy(), part.attitude.copy(), part.time
    part.drift[:] = off
    companion, room, linear = Companion(part), part.room(128), 0.0
    for _ in range(3):
        part.advance(3.0, room)
        linear = np.linalg.norm(part.drift[part.joints])
        companion.look()
    ends = []
    for start in (x, x + off):
        tight = setup.stepper(at_tolerance(setup.scenario, 1e-8).simulation).parts[0]
        tight.restart(start, attitude, begin)
        tight.advance(part.time)
        ends.append(tight.x[part.joints])
    true = np.linalg.norm(ends[1] - ends[0])
    assert linear > 2.0 * true
    assert np.linalg.norm(part.drift[part.joints]) == pytest.approx(true, rel=0.3)


def test_states_that_are_off_by_small_angles_and_rates_differ_by_them():
    stepper = Setup.of(impact_scenario("drops", 0)).stepper(impact_scenario("drops", 0).simulation)
    part = next(each for each in stepper.parts if len(each.objects))
    part.advance(1e-3)
    rng = np.random.default_rng(0)
    other, off = part.copy(), np.zeros_like(part.x)
    width = len(part.tables.guided)
    places = np.concatenate([part.objects, width + part.objects])
    off[places] = 1e-6 * rng.normal(size=len(places))
    x, attitude = part.x.copy(), part.attitude.copy()
    assert np.linalg.norm(x[width + part.objects[3:]]) > 1.0
    for each, start in ((part, x), (other, x + off)):
        each.restart(start, attitude, part.time)
    # A step so short that nothing moves: angles go into the quaternions.
    end = part.time + 1e-9
    for each in (part, other):
        each.advance(end)
    now = Moment(part.time, part.x, part.attitude, part.memory, part.drift)
    np.testing.assert_allclose(difference(part, now, other)[places], off[places], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("faster", "lost"), [(0.0, False), (5.0, False), (20.0, True)])
def test_an_error_of_more_than_a_tenth_of_a_metre_is_that_of_another_motion(faster, lost):
    """A ball in flight is off by 40 mm, and by a velocity, m/s, with which that grows by 12.8 ms of it."""
    scenario = impact_scenario("drops", 0)
    part = next(each for each in Setup.of(scenario).stepper(scenario.simulation).parts if len(each.objects))
    part.advance(1e-3)
    width, height = len(part.tables.guided), part.objects[2]
    part.drift[height], part.drift[width + height] = 0.04, faster
    companion = Companion(part)
    for _ in range(128):
        part.advance(part.time + 1e-4)
    companion.look()
    # The error counts as a mean square over three places and three turns.
    assert companion.lost == lost == (0.04 + faster * 128e-4 > 0.1 * np.sqrt(6.0))
    if not lost:
        assert part.drift[height] == pytest.approx(0.04 + faster * 128e-4, rel=1e-9)
        np.testing.assert_allclose(np.delete(part.drift[part.objects], 2), 0.0, atol=1e-9)
