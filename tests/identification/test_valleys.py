"""Searches where something rings: a likelihood with a minimum for every cycle, written out."""

from types import SimpleNamespace

import numpy as np

import finger_pin as fp
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.identification.parameters.parameters import Parameters
from finger_pin.identification.pipeline import FitPipeline
from finger_pin.identification.residuals.recordings import RecordedSignal
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.checkpoint import Checkpoint
from finger_pin.identification.search.gauss_newton import fit
from finger_pin.identification.search.objective import Objective

COULOMB, DRAG = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag"
TIME, TRUTH = np.arange(4.5, 8.0, 0.0025), np.array([0.12, 0.5])


class Ringing:
    """Rings at 2000 rad/s times the coefficient, and rises with both."""

    scenario, nuisance_parameters = fp.load_scenario("canal"), ()
    settings = RecordingSettings.model_construct(values={}, parameters={})
    recording = SimpleNamespace(name="pull", settings=settings, inputs={}, outputs={}, time=TIME)

    def compute(self, scenario, nuisance):
        friction = scenario.finger.tendon_friction
        ringing = np.sin(2000.0 * friction.coulomb * TIME)
        return [ringing + 40.0 * friction.coulomb * TIME**2 + friction.drag * (1.0 + TIME)]

    def slopes(self, at, values, sizes):
        ends = [
            [self.compute(*at(values + way * 1e-6 * sizes * (np.arange(2) == k)))[0] for way in (1, -1)] for k in (0, 1)
        ]
        return [
            np.stack([(one - other) / (2e-6 * size) for (one, other), size in zip(ends, sizes, strict=True)], axis=1)
        ]

    def with_tolerances(self, factor):
        return self


def test_a_search_that_ends_a_cycle_off_goes_on_to_the_right_one():
    model, count = Ringing(), len(TIME)
    exact = model.compute(fp.load_scenario("canal", {COULOMB: TRUTH[0], DRAG: TRUTH[1]}), {})[0]
    measured = exact + np.random.default_rng(1).normal(0.0, 6.0, count)
    plain = np.full(count, np.nan), np.arange(count)
    signal = RecordedSignal("pull", "tendon_tension.T1", "N", measured, np.arange(count), TIME, *plain, ordered=True)
    parameters = Parameters({COULOMB: (0.117, 0.123), DRAG: (0.0, 3.0)}, [model])
    objective = Objective(Residuals(model.scenario, parameters, [model], [signal]))
    # Half way from 4.5 s to 8 s it is a whole cycle late.
    start = parameters.to_search(TRUTH + np.array([2.0 * np.pi / 6.25 / 2000.0, 0.0]))
    trapped = fit(objective, start)
    assert parameters.values(trapped.z)[0] > TRUTH[0] + 3e-4
    work = FitPipeline(objective, Checkpoint(None, "", False), "linear", None)
    work.search([start])
    assert abs(parameters.values(work.best.z)[0] - TRUTH[0]) < 1e-4
    assert np.sum(work.best.residuals[0] ** 2) < np.sum(trapped.residuals[0] ** 2)
