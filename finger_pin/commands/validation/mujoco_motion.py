"""Whole motions against MuJoCo, which converges to ours at the first order of its time step."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.commands.validation.check import Check, Picture, Section, compare, skipped
from finger_pin.control.reference import SignalReference
from finger_pin.description.loading import load_scenario
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.mjcf import to_mjcf
from finger_pin.simulation.simulate import simulate
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import GREY, new_figure, styled

TITLE = "Whole motions against MuJoCo"
# What MuJoCo cannot express is taken away. With mu_e = 0 a bristle F^s carries at most sigma_0 times the path that its
# contact slides, below 1e-9 N and 1e-9 N m here; a limiter of stiffness zero exerts nothing.
EXPRESSIBLE: dict[str, Any] = {
    "finger.tendon_friction.coulomb": 0.0,
    "finger.tendon_friction.stiffness": 1e-9,
    "finger.joint_friction.coulomb": 0.0,
    "finger.joint_friction.stiction": 0.0,
    "finger.joint_friction.stiffness": 1e-9,
    "finger.stroke_limiter.stiffness": 0.0,
}
DURATION = 0.15
STEPS = (1e-5, 5e-6, 2.5e-6)


@dataclass(frozen=True, eq=False)
class Convergence:
    """MuJoCo's motions against ours.

    Attributes:
        scenario: What was simulated.
        ours: Our result.
        steps: MuJoCo's time steps, s.
        errors: Largest difference of the joints from ours at every step size, rad.
    """

    scenario: Scenario
    ours: xr.Dataset
    steps: tuple[float, ...]
    errors: Array

    @property
    def orders(self) -> Array:
        """Order of convergence between neighbouring step sizes."""
        return np.asarray(np.diff(np.log(self.errors)) / np.diff(np.log(self.steps)))


def follow(scenario: Scenario, model: Any, step: float) -> Array:
    """Return MuJoCo's joint positions every millisecond under the paper's controller, written out, rad."""
    import mujoco

    routing = Finger(scenario.finger).routing
    inverse, internal = np.linalg.pinv(routing.coupling.T), routing.force_closure().tension
    gain = np.broadcast_to(scenario.controller.gain, len(routing.joints))
    minimum = np.broadcast_to(scenario.controller.minimum_tension, len(routing.tendons))
    times = step * np.arange(round(DURATION / step), dtype=np.float64)
    reference = SignalReference.from_scenario(scenario, routing).at(times).position
    model.opt.timestep = step
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    theta, control, actuated = data.qpos[: len(routing.joints)], data.ctrl, routing.actuated
    every, path = round(1e-3 / step), [theta.copy()]
    for index, desired in enumerate(reference, 1):
        tension = inverse @ (gain * (desired - theta))
        tension += np.max((minimum - tension) / internal) * internal
        control[:] = tension[:actuated]
        mujoco.mj_step(model, data)
        if index % every == 0:
            path.append(theta.copy())
    return np.array(path)


def converge(name: str, overrides: Mapping[str, Any] | None = None) -> Convergence:
    """Simulate what MuJoCo can express of a scenario, here and there."""
    import mujoco

    settings = {"duration": DURATION, "rtol": 1e-9, "atol_scale": 1e-10, "sample_rate": 1000.0}
    settings = {f"simulation.{key}": value for key, value in settings.items()}
    scenario = load_scenario(name, {**EXPRESSIBLE, **(overrides or {}), **settings})
    result = simulate(scenario)
    ours = result["joint_position"].values
    model = mujoco.MjModel.from_xml_string(to_mjcf(scenario.finger, posture=tuple(ours[0]), shapes=False))
    errors = np.array([abs(follow(scenario, model, step) - ours).max() for step in STEPS])
    return Convergence(scenario, result, STEPS, errors)


def measure() -> Section:
    """Compare the motions of both shipped scenarios without dry friction."""
    source = "MuJoCo"
    if importlib.util.find_spec("mujoco") is None:
        return Section.of([skipped("motions without dry friction", source, "mujoco is not installed")])
    import mujoco

    source = f"MuJoCo {mujoco.__version__}"
    checks: list[Check] = []
    found = {name: converge(name) for name in ("fig6", "stick_slip")}
    for name, each in found.items():
        what = f"{name} without dry friction, {DURATION:g} s: difference at {1e6 * STEPS[-1]:g} us"
        checks.append(compare(what, source, each.errors[-1], 5e-5, "rad"))
        for step, order in zip(STEPS[1:], each.orders, strict=True):
            what = f"{name}: order in MuJoCo's step, down to {1e6 * step:g} us"
            checks.append(compare(what, "first-order integrator", order, 0.07, "1", expected=1.0))
    return Section.of(checks, Picture(plot(found), "MuJoCo's motion approaches ours in proportion to its time step."))


@styled
def plot(found: Mapping[str, Convergence]) -> Figure:
    """Draw MuJoCo's difference from us against its step."""
    figure = new_figure(6.0, 3.2, "constrained")
    axes = figure.subplots()
    for index, (name, each) in enumerate(found.items()):
        axes.loglog(1e6 * np.array(each.steps), each.errors, marker="o", label=name, **series(index))
    first = next(iter(found.values()))
    slope = first.errors[0] * np.array(first.steps) / first.steps[0] * 0.5
    axes.loglog(1e6 * np.array(first.steps), slope, color=GREY, linestyle=":", label="order 1")
    axes.set(xlabel="MuJoCo's time step (µs)", ylabel="largest difference (rad)")
    axes.set_xticks([1e6 * step for step in STEPS], [f"{1e6 * step:g}" for step in STEPS])
    axes.minorticks_off()
    axes.legend()
    return figure
