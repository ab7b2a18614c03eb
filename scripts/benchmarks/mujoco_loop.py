"""The part of the model that MuJoCo can express: time at equal error, here and in MuJoCo.

MuJoCo has no dynamic friction, so friction other than viscous is off on both sides. Its model is the exported MJCF,
once with the lumped mass of the passive tendon and once with one spring in its place. Each of MuJoCo's integrators
takes the largest time step that keeps the error within the limit; the paper's controller is asked at every step. The
right-hand side here keeps its friction states, although they do nothing.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from validation.mujoco_motion import EXPRESSIBLE, with_plates

import finger_pin as fp
from benchmarks.runs import Job, Point, compiled, point, rms, truth
from benchmarks.store import Store, say
from benchmarks.timing import clocked
from finger_pin.control.proportional import ProportionalController
from finger_pin.exchange.mjcf import to_mjcf
from finger_pin.references.reference import SignalReference
from finger_pin.typing import Array

_PERIOD = 1e-3
# Whether one spring replaces the lumped mass, and the integrator; with the mass "implicitfast" does as "Euler" does.
_VARIANTS = ((False, "Euler"), (False, "discrete"), (True, "Euler"), (True, "implicitfast"), (True, "discrete"))
_TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6, 1e-7)
_ROUNDS = 3
# Runs that take longer than this are timed once, s.
_LONG = 3.0
# An unstable run ends at this error, rad.
_LOST = 0.1


def measure(store: Store) -> dict[str, Any] | None:
    """Return the comparison; None where MuJoCo is not installed."""
    if importlib.util.find_spec("mujoco") is None:
        return None
    steps = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5, 1e-5, 5e-6)
    asked = Comparison("reversals", {}, 0.5 if store.quick else 8.0, 1e-3, ("worst", "rms"), steps)
    return store.part("mujoco", lambda: study(asked))


class Comparison(NamedTuple):
    """A comparison to be made: a scenario, a limit on the error, time steps of MuJoCo.

    Attributes:
        scenario: Its name.
        overrides: Changes of it, besides the entries that MuJoCo cannot express.
        duration: s.
        limit: On the error, rad.
        measures: Some of `MEASURES`: what the limit is put on.
        steps: MuJoCo's time steps, the largest first, s.
    """

    scenario: str
    overrides: dict[str, Any]
    duration: float
    limit: float
    measures: tuple[str, ...]
    steps: tuple[float, ...]


class Loop:
    """The paper's controller around a MuJoCo model, as lean as Python allows.

    Attributes:
        model: The MuJoCo model.
        controls: Tensions of the last run, shape (steps, a), N.
    """

    def __init__(self, scenario: fp.Scenario, model: Any, step: float) -> None:
        """Prepare a run with a time step that divides the sampling period, or is a multiple of it, s."""
        routing = fp.Finger(scenario.finger).routing
        self.model, self.step = model, step
        self._joints, self._actuated = len(routing.joints), routing.actuated
        controller = ProportionalController.from_scenario(scenario, routing)
        self._feedback = controller.inverse * controller.gain
        self._minimum, self._internal = controller.minimum, controller.internal
        times = step * np.arange(round(scenario.simulation.duration / step))
        self._feedforward = SignalReference.from_scenario(scenario, routing).at(times).position @ self._feedback.T
        self._every = max(1, round(_PERIOD / step))
        self._stride = max(1, round(step / _PERIOD))
        self.controls = np.zeros((len(times), self._actuated))

    def run(self, exact: Array | None = None) -> Array:
        """Return joint positions, rad, at the samples; end early where they are lost.

        Args:
            exact: Exact positions at the samples, shape (m, n), rad.
        """
        import mujoco

        model, data, advance = self.model, mujoco.MjData(self.model), mujoco.mj_step
        mujoco.mj_resetDataKeyframe(model, data, 0)
        theta, control = data.qpos[: self._joints], data.ctrl
        feedback, minimum, internal, actuated = self._feedback, self._minimum, self._internal, self._actuated
        every, controls, path = self._every, self.controls, [theta.copy()]
        for index, forward in enumerate(self._feedforward):
            tension = forward - feedback @ theta
            tension += ((minimum - tension) / internal).max() * internal
            control[:] = controls[index] = tension[:actuated]
            advance(model, data)
            if not (index + 1) % every:
                path.append(theta.copy())
                if exact is not None and not abs(theta - exact[len(path) - 1]).max() <= _LOST:
                    break
        return np.array(path)

    def rollout(self) -> Array:
        """Return joint positions, rad, at the samples, from MuJoCo's own loop under the last run's tensions."""
        import mujoco
        from mujoco import rollout

        data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, 0)
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, data, start, kind)
        states, _ = rollout.rollout(self.model, data, start, self.controls[None])
        # The state begins with the time.
        return np.vstack([start[None], states[0]])[:: self._every, 1 : 1 + self._joints]

    def samples(self, exact: Array) -> Array:
        """Return the rows of positions at 1 kHz that a run has samples of."""
        return exact[:: self._stride]


def study(asked: Comparison) -> dict[str, Any]:
    """Return the times."""
    import mujoco

    mujoco.set_mju_user_warning(lambda message: None)
    settings = {"simulation.duration": asked.duration, "simulation.sample_rate": 1.0 / _PERIOD}
    scenario = fp.load_scenario(asked.scenario, EXPRESSIBLE | asked.overrides | settings)
    exact, agreement = truth(scenario)
    ours = {measure: _fastest(scenario, exact, measure, asked.limit) for measure in asked.measures}
    jobs = {measure: job for measure, (_, job) in ours.items()}
    rows = [
        row
        for massless, integrator in _VARIANTS
        for row in _candidates(asked, scenario, massless, integrator, exact, jobs)
    ]
    return {
        "scenario": asked.scenario,
        "duration": asked.duration,
        "limit": asked.limit,
        "agreement": agreement,
        "version": mujoco.__version__,
        "ours": {measure: asdict(best) for measure, (best, _) in ours.items()},
        "rows": rows,
    }


def _worst(difference: Array) -> float:
    return float(abs(difference).max())


#: What the limit is put on: the largest error of any joint at any sample, or the root mean square of all.
MEASURES = {"worst": _worst, "rms": rms}


def _fastest(scenario: fp.Scenario, exact: Array, measure: str, limit: float) -> tuple[Point, Job]:
    """Return our fastest run within the limit, and a job that repeats it."""
    best: tuple[Point, Job] | None = None
    for method in ("Rodas5P", "Rodas4"):
        for rtol in _TOLERANCES:
            job = compiled(scenario, method, rtol)
            if MEASURES[measure](job()[0] - exact) > limit:
                continue
            found = min((point(method, rtol, job, exact) for _ in range(3)), key=lambda each: each.integration)
            if best is None or found.integration < best[0].integration:
                best = found, job
            # Tighter tolerances only take longer.
            break
    assert best is not None
    return best


def _model(scenario: fp.Scenario, massless: bool, integrator: str, posture: Array, step: float) -> Any:
    """Return a MuJoCo model without sensors and contacts; None for an integrator that it lacks."""
    import mujoco

    text = to_mjcf(
        scenario.finger, posture=posture, timestep=step, integrator=integrator, massless=massless, shapes=False
    )
    try:
        model = with_plates(text, scenario)
    except ValueError:
        return None
    if not scenario.environment.objects:
        unused = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        model.opt.disableflags |= int(unused)
    return model


def _candidates(
    asked: Comparison, scenario: fp.Scenario, massless: bool, integrator: str, exact: Array, ours: dict[str, Job]
) -> Iterator[dict[str, Any]]:
    """Yield an integrator's times at its largest time step within the limit, by measure, with ours between its runs."""
    name = f"{integrator}, {'one spring' if massless else 'lumped mass'}"
    left = {measure: MEASURES[measure] for measure in asked.measures}
    for step in asked.steps:
        model = _model(scenario, massless, integrator, exact[0], step)
        if model is None or not left:
            return
        loop = Loop(scenario, model, step)
        wanted = loop.samples(exact)
        first, path = clocked(lambda loop=loop, wanted=wanted: loop.run(wanted))
        if len(path) < len(wanted):
            continue
        met = [each for each, measure in left.items() if measure(path - wanted) <= asked.limit]
        for each in met:
            measure, job = left.pop(each), ours[each]
            times = {"loop": first, "rollout": np.inf, "ours": np.inf}
            for turn in range(1 if first > _LONG else _ROUNDS):
                times["ours"] = min(times["ours"], *(clocked(job)[0] for _ in range(3)))
                elapsed, rolled = clocked(loop.rollout)
                times["rollout"] = min(times["rollout"], elapsed)
                if turn:
                    times["loop"] = min(times["loop"], clocked(loop.run)[0])
            say(f"  {name}: {each} error within the limit at {1e6 * step:g} us, loop {times['loop']:.2f} s")
            yield {
                "measure": each,
                "integrator": integrator,
                "massless": massless,
                "step": step,
                "error": measure(path - wanted),
                "rollout_error": measure(rolled - wanted),
                **times,
                "loop_over_ours": times["loop"] / times["ours"],
                "rollout_over_ours": times["rollout"] / times["ours"],
            }
