"""Searches where something rings: a likelihood with a minimum for every cycle, written out."""

from types import SimpleNamespace

import numpy as np

import finger_pin as fp
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.identification.checkpoint import Checkpoint
from finger_pin.identification.estimate import fit
from finger_pin.identification.pipeline import FitPipeline
from finger_pin.identification.problem import Problem
from finger_pin.identification.recordings import RecordedSignal

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

    def scale_tolerances(self, factor):
        pass


def test_a_search_that_ends_a_cycle_off_goes_on_to_the_right_one():
    model, count = Ringing(), len(TIME)
    exact = model.compute(fp.load_scenario("canal", {COULOMB: TRUTH[0], DRAG: TRUTH[1]}), {})[0]
    measured = exact + np.random.default_rng(1).normal(0.0, 6.0, count)
    plain = np.full(count, np.nan), np.arange(count)
    signal = RecordedSignal("pull", "tendon_tension.T1", "N", measured, np.arange(count), TIME, *plain, ordered=True)
    low, high = np.array([[0.117, 0.0], [0.123, 3.0]])
    problem = Problem(model.scenario, (COULOMB, DRAG), low, high, [model], [signal], {})
    # Half way from 4.5 s to 8 s it is a whole cycle late.
    start = problem.to_search(TRUTH + np.array([2.0 * np.pi / 6.25 / 2000.0, 0.0]))
    trapped = fit(problem, start)
    assert problem.values(trapped.z)[0] > TRUTH[0] + 3e-4
    work = FitPipeline(problem, Checkpoint(None, "", False), "linear", None)
    work.search([start])
    assert abs(problem.values(work.best.z)[0] - TRUTH[0]) < 1e-4
    assert np.sum(work.best.residuals[0] ** 2) < np.sum(trapped.residuals[0] ** 2)
