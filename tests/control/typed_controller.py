"""A user's controller with the annotations that `mypy --strict` asks for; `.ci/run` has it checked."""

import numpy as np
from numpy.typing import NDArray

import finger_pin as fp
from finger_pin.references.reference import ReferenceSignals


class Pull:
    """Tensions from the angle that the medial joint lacks."""

    def command(
        self, time: float, reference: ReferenceSignals, position: NDArray[np.float64], velocity: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.array([1.0, 1.0, 4.0 + 20.0 * (reference.position - position)[2], 3.0])


def pulled(duration: float) -> list[float]:
    """Return the commands of the third tendon, N."""
    scenario = fp.load_scenario("reversals", {"simulation.duration": duration})
    result = fp.simulate(scenario, controller=Pull(), control_period=1e-3)
    return [float(each) for each in result.tendon_command.sel(tendon="T3").values]
