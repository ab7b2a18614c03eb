"""Whole motions against MuJoCo, which converges to ours at the first order of its time step."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.description.loading import load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exchange.mjcf import to_mjcf
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import SignalReference
from finger_pin.simulation.simulate import simulate
from finger_pin.typing import Array
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import GREY, new_figure, styled
from validation.check import Check, Picture, Section, compare, skipped

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
# The pad meets the plate of `press` at 1.4 m/s, bounces four times, and pushes; what contact loses is taken away too.
PRESSING: dict[str, Any] = {
    "finger": "ub_stand_in",
    "controller.damping": 0.0,
    "environment.objects.plate.surface": {"friction": 0.0, "damping": 0.0},
    "reference.joints.proximal": {"kind": "points", "times": [0.0, 0.04], "values": [0.15, 0.42]},
    "reference.joints.medial": {"kind": "points", "times": [0.0, 0.04], "values": [0.38, 0.455]},
}
SCENES: dict[str, dict[str, Any]] = {"reversals": {}, "stick_slip": {}, "press": PRESSING}
DURATION = 0.15
STEPS = (1e-5, 5e-6, 2.5e-6)


@dataclass(frozen=True, eq=False)
class Convergence:
    """MuJoCo's motions against ours.

    Attributes:
        scenario: Name of the scenario.
        ours: Our result.
        steps: MuJoCo's time steps, s.
        differences: Largest difference of any joint from ours, by step size and sample time, rad.
    """

    scenario: Scenario
    ours: xr.Dataset
    steps: tuple[float, ...]
    differences: Array

    @property
    def errors(self) -> Array:
        """Largest difference at every step size, rad."""
        return np.asarray(self.differences.max(axis=1))

    @property
    def free(self) -> Array:
        """Likewise before anything touches, rad."""
        touched = self.ours["contact_normal_force"].values.any(axis=1)
        return np.asarray(self.differences[:, : touched.argmax()].max(axis=1))

    @property
    def orders(self) -> Array:
        """Order of convergence between neighbouring step sizes."""
        return np.asarray(np.diff(np.log(self.errors)) / np.diff(np.log(self.steps)))


def with_plates(text: str, scenario: Scenario) -> Any:
    """Return MuJoCo's model of an MJCF without shapes, with the finger's pad on the scenario's half-spaces: f_n = k d.

    MuJoCo's undamped contact exerts (s d / i - a) / (A + w (1 - i) / i): s stiffness, i impedance, a the acceleration
    that there would be without it, A the inverse mass it acts on, w MuJoCo's estimate of A. With i near 1 the
    pad would leave with the acceleration s d, whatever pushes it. At the least i, with w far above A and
    s = k w (1 - i), the force is k d, to 1e-8 of itself and of what would cancel a.
    """
    import mujoco

    impedance, weight = 1e-4, 1e6
    spec = mujoco.MjSpec.from_string(text)
    name, joint = list(scenario.finger.joints.items())[-1]
    link = joint.link
    assert link is not None
    nothing = {"contype": 0, "conaffinity": 0}
    place, size = [link.length - 0.5 * link.width, 0.0, link.offset], [0.5 * link.width, 0.0, 0.0]
    spec.body(f"{name}_link").add_geom(name="pad", type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=place, size=size, **nothing)
    for plate, each in (scenario.environment.objects or {}).items():
        assert each.surface is not None
        frame = {"pos": each.position, "quat": np.roll(each.quaternion, 1)}
        spec.worldbody.add_geom(name=plate, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], **frame, **nothing)
        spring = {"solref": [-each.surface.stiffness * weight * (1.0 - impedance), 0.0]}
        spring["solimp"] = [impedance, impedance, 1.0, 0.5, 1.0]
        spec.add_pair(geomname1="pad", geomname2=plate, condim=1, **spring)
    model = spec.compile()
    model.body_invweight0[model.body(f"{name}_link").id, 0] = weight
    return model


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
    """Simulate the part of a scenario that MuJoCo can express, here and there."""
    settings = {"duration": DURATION, "rtol": 1e-9, "atol_scale": 1e-10, "sample_rate": 1000.0}
    settings = {f"simulation.{key}": value for key, value in settings.items()}
    scenario = load_scenario(name, {**EXPRESSIBLE, **(overrides or {}), **settings})
    result = simulate(scenario)
    ours = result["joint_position"].values
    text = to_mjcf(scenario.finger, posture=tuple(ours[0]), shapes=False)
    model = with_plates(text, scenario)
    differences = np.array([abs(follow(scenario, model, step) - ours).max(axis=1) for step in STEPS])
    return Convergence(scenario, result, STEPS, differences)


def measure() -> Section:
    """Compare the motions of three shipped scenarios without dry friction, one of which touches a plate."""
    source = "MuJoCo"
    if importlib.util.find_spec("mujoco") is None:
        return Section.of([skipped("motions without dry friction", source, "mujoco is not installed")])
    import mujoco

    source = f"MuJoCo {mujoco.__version__}"
    checks: list[Check] = []
    found = {name: converge(name, overrides) for name, overrides in SCENES.items()}
    for name, each in found.items():
        what = f"{name} without dry friction, {DURATION:g} s: difference at {1e6 * STEPS[-1]:g} us"
        checks.append(compare(what, source, each.errors[-1], 5e-5, "rad"))
        for step, order in zip(STEPS[1:], each.orders, strict=True):
            what = f"{name}: order in MuJoCo's step, down to {1e6 * step:g} us"
            checks.append(compare(what, "first-order integrator", order, 0.07, "1", expected=1.0))
    what = f"press before it first touches: difference at {1e6 * STEPS[-1]:g} us"
    checks.append(compare(what, source, found["press"].free[-1], 5e-6, "rad"))
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
