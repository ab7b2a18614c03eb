"""The error of a free body's motion, carried along with it, against the same motion at a far tighter tolerance."""

import numpy as np
import pytest
from test_contact_motion import scene

from finger_pin.core.inputs import held_control
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.description.objects import Object


@pytest.mark.parametrize(("tolerance", "time"), [(1e-4, 3.0), (1e-6, 5.0), (1e-6, 10.0)])
def test_the_estimate_tells_how_far_off_a_brick_is_that_tumbles_about_its_middle_axis(tolerance, time):
    """About that axis turns are unstable: what is off grows until the brick flips at another instant."""
    brick = Object(shape="box", sides=(0.02, 0.04, 0.08), mass=0.1, angular_velocity=(0.001, 5.0, 0.0))
    mechanism, start = scene((0.0, 0.0, 0.0), brick=brick)

    def turned(wanted):
        control = held_control(mechanism.channels, mechanism.coordinates)
        stepper = Stepper(mechanism, control, start, TABLEAUS["Rodas5P"](), wanted, np.full(mechanism.size, wanted))
        attitudes = []
        for k in range(1, 41):
            assert stepper.advance(time * k / 40) == 0
            attitudes.append(stepper.x[3:7])
        return np.array(attitudes), stepper.estimated_error

    (found, estimate), (exact, _) = turned(tolerance), turned(1e-11)
    angles = 2.0 * np.arccos(np.minimum(np.abs(np.sum(found * exact, axis=1)), 1.0))
    # Root mean square over the three turns and the three places, which are right.
    error = np.sqrt(np.mean(angles**2) / 6.0)
    assert error / 3.0 < estimate < 100.0 * error
