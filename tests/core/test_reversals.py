"""Steps over which sliding turns round."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.steps.integration import DONE
from finger_pin.simulation.setup import Setup

TOLERANCE = 1e-5


def test_steps_that_end_at_reversals_move_in_between_as_exactly_as_at_their_ends():
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.4})

    def motion(tolerance):
        settings = {"rtol": tolerance, "atol_scale": tolerance}
        return Setup.from_scenario(scenario.updated(simulation=settings)).integrate()

    loose, tight = motion(TOLERANCE), motion(1e-10)
    ends = np.concatenate([[0.0], loose.steps[0].ends])
    within = ends[:-1] + np.outer([0.25, 0.5, 0.75], np.diff(ends))
    errors = [np.abs(loose.interpolate(at) - tight.interpolate(at))[:, :4] for at in (ends, within.ravel())]
    assert errors[1].max() < 2.0 * errors[0].max()


def test_no_step_over_a_reversal_of_friction_errs_by_more_than_three_tolerances():
    """Each is compared with a run from its start at tight tolerances; unseen, reversals make ten of them."""
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.4})
    setup = Setup.from_scenario(scenario)

    def part(tolerance):
        settings = scenario.simulation.updated(rtol=tolerance, atol_scale=tolerance)
        return setup.stepper(settings).parts[0]

    loose, tight = part(TOLERANCE), part(1e-10)
    room, start, errors = loose.room(1), loose.x.copy(), []
    while loose.time < scenario.simulation.duration:
        begin = loose.time
        loose.advance(scenario.simulation.duration, room)
        tight.restart(start, loose.attitude, begin)
        assert tight.advance(loose.time)[0] == DONE
        start = loose.x.copy()
        errors.append(np.sqrt(np.mean(((start - tight.x) / (loose.atol + TOLERANCE * np.abs(start))) ** 2)))
    assert len(errors) > 50 and max(errors) < 3.0


@pytest.mark.slow
def test_friction_above_what_it_can_bear_does_not_grow_at_loose_tolerances_either():
    """A tendon goes slack and rings: by (9a) |F^s|' <= sigma_0 |v| (1 - |F^s| / level)."""
    light = {f"finger.actuators.*.motor.friction.{name}": 0.0 for name in ("by_load", "stribeck_by_load")}
    # Gears without losses by load and little damping let it ring.
    servo = fp.load_scenario("servo", light | {"simulation.duration": 5.2, "controller.damping": 0.1})
    setup, times, growth = Setup.from_scenario(servo), np.linspace(0.0, 5.2, 1001), []

    def motion(tolerance):
        return setup.integrate(scenario=servo.updated(simulation={"rtol": tolerance, "atol_scale": tolerance}))

    tight = motion(1e-9)
    for tolerance in (0.7e-3, 0.9e-3, 1e-3, 1.1e-3, 1.3e-3):
        loose = motion(tolerance)
        ends = loose.breakpoints
        signals = setup.loop.evaluate(ends, loose.interpolate(ends)).finger
        bent, bearable = np.abs(signals.at_first_place("state")), signals.at_first_place("level")
        beyond = (bent > 2.0 * bearable)[:-1] & (bent > 2.0 * bearable)[1:]
        assert beyond.any()
        growth.append(np.sum(np.maximum(np.diff(bent, axis=0), 0.0), where=beyond))
        errors = (loose.interpolate(times) - tight.interpolate(times))[:, :4]
        assert np.sqrt(np.mean(errors**2)) < 3e-4
    # What it can bear may rise and fall within a step, where it grows as it should.
    assert np.median(growth) < 0.005
