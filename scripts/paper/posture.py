"""Conclusion (a): does tendon friction depend on the posture so much that a controller has to consider it?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulate import simulate
from finger_pin.typing import Array
from paper.runs import Progress
from paper.transmission import (
    TransmissionEfficiency,
    TransmissionInMotion,
    transmission_efficiency,
    transmission_in_motion,
    workspace_postures,
)

#: Number of runs of the experiment.
TRANSMISSION_RUNS = 1


@dataclass(frozen=True, eq=False)
class Transmission:
    """The measurements of conclusion (a).

    Attributes:
        scenario: Whose finger, and whose motion.
        positions: Postures over the workspace, shape (m, n), rad.
        workspace: Efficiencies there, shapes (m, t).
        time: Of the motion, s, shape (k,).
        motion: Efficiencies along the scenario, shapes (k, t).
    """

    scenario: Scenario
    positions: Array
    workspace: TransmissionEfficiency
    time: Array
    motion: TransmissionInMotion

    @property
    def tendons(self) -> tuple[str, ...]:
        """Names of the tendons, actuated first."""
        return tuple(self.scenario.finger.tendons)

    @property
    def blind_error(self) -> Array:
        """Relative error of the delivered tension, at worst, if a controller knows one curvature only, shape (t,).

        The one whose compensation errs as much either way, exp(mu_e (phi_max - phi_min) / 2) - 1.
        """
        pulling = self.workspace.pulling
        return np.asarray(np.sqrt(np.max(pulling, axis=0) / np.min(pulling, axis=0)) - 1.0)

    @property
    def unsettled(self) -> Array:
        """Relative deviation of sliding tendons from steady sliding, rms along the motion, shape (t,); NaN if none."""
        motion = self.motion
        with np.errstate(divide="ignore", invalid="ignore"):
            gap = np.where(motion.sliding, motion.ratio / motion.settled - 1.0, np.nan)
        slid = np.any(np.isfinite(gap), axis=0)
        found = np.full(gap.shape[1], np.nan)
        found[slid] = np.sqrt(np.nanmean(gap[:, slid] ** 2, axis=0))
        return found


def transmission(scenario: Scenario, *, progress: Progress | None = None) -> Transmission:
    """Look at the transmission of every tendon over the workspace, and along a scenario's motion.

    Args:
        scenario: Whose finger, and whose motion.
        progress: Called with 1 when the simulation has been finished.

    Raises:
        IntegrationError: If the simulation could not be finished.
    """
    finger = Finger(scenario.finger)
    positions = workspace_postures(finger)
    result = simulate(scenario)
    if progress is not None:
        progress(1)
    return Transmission(
        scenario=scenario,
        positions=positions,
        workspace=transmission_efficiency(finger, positions),
        time=result["time"].values,
        motion=transmission_in_motion(finger, result),
    )
