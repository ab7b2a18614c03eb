"""The error of a run where it outgrows a linearised flow."""

import numpy as np
from impacts import difference as apart
from validation.impact_scenarios import at_tolerance, impact_scenario

import finger_pin as fp
from finger_pin.core.stepping.twin import Moment, difference
from finger_pin.simulation.setup import Setup


def test_what_slips_and_sticks_again_holds_an_error_that_the_linearised_flow_multiplies():
    """By the flow alone it would be a thousand times the true one."""
    scenario = impact_scenario("press", 15)
    truth = fp.simulate(at_tolerance(scenario, 1e-3 * scenario.simulation.rtol))
    error = apart(fp.simulate(scenario), truth)
    estimate = Setup.of(scenario).integrate().estimated_error
    assert error / 3.0 < estimate < 100.0 * error


def test_states_that_are_off_by_small_angles_and_rates_differ_by_them():
    stepper = Setup.of(impact_scenario("drops", 0)).stepper(impact_scenario("drops", 0).simulation)
    part = next(each for each in stepper.parts if len(each.objects))
    part.advance(1e-3)
    rng = np.random.default_rng(0)
    other, off = part.copy(), np.zeros_like(part.x)
    width = len(part.tables.parents) + len(part.tables.lumps)
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
