"""The order of the Rosenbrock methods, on a finger with all its friction and no kink."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from finger_pin.control.closed_loop import ClosedLoop, compiled_control
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps import integration
from finger_pin.description.loading import load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.typing import Array
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import new_figure, styled
from validation.check import Check, Picture, Section, compare

TITLE = "Order of the integrators"
ORDER = {"Rodas5P": 5, "Rodas4": 4}
#: Length of the smooth motion, s, and how often it is divided.
END, COUNTS = 5e-3, (5, 10, 20, 40)


@dataclass(frozen=True, eq=False)
class Smooth:
    """A closed loop, a state to start from, and its exact motion.

    Attributes:
        loop: The loop.
        start: Packed state, shape (size,).
        exact: Maps times in [0, END] to packed states.
    """

    loop: ClosedLoop
    start: Array
    exact: Any

    def stepper(self, method: str, step: float) -> Stepper:
        """Return an integrator whose tolerances reject nothing, so that its steps can be imposed."""
        finger = self.loop.finger
        control = compiled_control(self.loop)
        assert control is not None
        atol, force = 1e6 * finger.layout.scales(), self.loop.fingertip_force
        stepper = Stepper(finger.mechanism, control, self.start, TABLEAUS[method](), 1e6, atol, force)
        stepper.parts[0].memory.step_size[0] = step
        return stepper

    def largest(self, error: Array) -> float:
        """Return the largest error of a kind of state, each over the distance that it moves."""
        moved = self.exact(END) - self.start
        layout = self.loop.finger.layout
        kinds = zip(*(vars(layout.unpack(each)).values() for each in (error, moved)), strict=True)
        return max(float(np.abs(off).max() / np.linalg.norm(far)) for off, far in kinds if far.size)


def smooth_motion() -> Smooth:
    """Return a motion with all friction in which nothing changes sign, slackens or reaches a limit.

    Links a thousand times as heavy and a heavy, soft passive tendon leave nothing stiff at the steps taken here.
    """
    table = load_scenario("reversals").model_dump()
    for joint in table["finger"]["joints"].values():
        for name in ("mass", "transverse_inertia", "axial_inertia"):
            joint["link"][name] *= 1e3
        # Inertias are given: a wider section changes nothing but the density, which is that of a metal then.
        joint["link"]["width"] *= 8.0
    table["finger"]["gravity"] = (0.0, 0.0, -0.5)
    table["finger"]["passive_tendon"] = {"stiffness": 500.0, "mass": 1.0}
    table["controller"]["passive_tension"] = 0.05
    table["finger"]["tendon_friction"]["stiffness"] = 5e3
    table["environment"]["fingertip_force"] = [2.0, -3.0, 2.0]
    loop = ClosedLoop.from_scenario(Scenario.model_validate(table))
    x = loop.finger.rest_state(np.array([0.06, 0.3, 0.5, 0.15]))
    state = loop.finger.layout.unpack(x)
    state.velocity[:] = [1.0, 2.0, 3.0, 5.0]
    state.passive_velocity[:] = 0.5 * (3.5e-3 * 3.0 + 5e-3 * 5.0)
    exact = solve_ivp(loop.rhs, (0.0, END), x, method="DOP853", rtol=1e-13, atol=1e-15, dense_output=True)
    return Smooth(loop, x, exact.sol)


def step_errors(smooth: Smooth, method: str) -> Array:
    """Return the errors after 5, 10, 20 and 40 equal steps."""
    errors = []
    for count in COUNTS:
        stepper = smooth.stepper(method, step=END)
        for k in range(count):
            if stepper.advance(END * (k + 1) / count) != integration.DONE:
                raise RuntimeError("an imposed step failed")
        if stepper.parts[0].memory.accepted_steps[0] != count:
            raise RuntimeError("an imposed step was divided")
        errors.append(smooth.largest(stepper.x - smooth.exact(END)))
    return np.array(errors)


def mean_order(errors: Array) -> float:
    """Return the order of convergence between the longest and the shortest steps."""
    return float(np.log(errors[0] / errors[-1]) / np.log(COUNTS[-1] / COUNTS[0]))


def measure() -> Section:
    """Measure the order of both methods."""
    checks: list[Check] = []
    smooth = smooth_motion()
    errors = {method: step_errors(smooth, method) for method in ORDER}
    for method, order in ORDER.items():
        found, what = mean_order(errors[method]), f"{method}: order on a smooth motion with all friction"
        checks.append(compare(what, "order conditions of the method", found, 0.5, "1", expected=float(order)))
        limit = {"Rodas4": 2e-8, "Rodas5P": 1e-9}[method]
        what = f"{method}: error after {COUNTS[-1]} steps, over the distance moved"
        checks.append(compare(what, "DOP853 at 1e-13", errors[method][-1], limit, "1"))
    return Section.of(
        checks, Picture(plot(errors), "Error against the length of the steps; dotted, the slopes of the orders.")
    )


@styled
def plot(errors: dict[str, Array]) -> Figure:
    """Draw the error against the step."""
    figure = new_figure(6.0, 3.2, "constrained")
    axes = figure.subplots()
    steps = 1e6 * END / np.array(COUNTS)
    for index, (method, each) in enumerate(errors.items()):
        line = series(index)
        axes.loglog(steps, each, marker="o", markersize=4, label=f"{method}, order {ORDER[method]}", **line)
        slope = 0.4 * each[-1] * (steps / steps[-1]) ** ORDER[method]
        axes.loglog(steps, slope, color=line["color"], linestyle=":", linewidth=1.0)
    axes.set_xticks(steps, [f"{step:g}" for step in steps])
    axes.minorticks_off()
    axes.set(xlabel="step (µs)", ylabel="relative error")
    axes.legend()
    return figure
