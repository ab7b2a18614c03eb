"""Every integrator against the others: all converge to one motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.description.loading import load_scenario
from finger_pin.description.simulation_settings import METHODS
from finger_pin.simulation.simulate import simulate
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import new_figure, styled
from validation.check import Check, Picture, Section, compare

TITLE = "Integrators against each other"
#: Scenario and how much of it the slowest methods can afford, s.
WINDOWS = {"reversals": 0.1, "stick_slip": 0.02}
TOLERANCES = (1e-4, 1e-6, 1e-8)
#: Largest error of a method at the tightest tolerance, rad, and the least factor by which it shrinks on the way.
LIMIT, GAIN = 2e-8, 20.0
_RATE = 10_000.0


@dataclass(frozen=True)
class Approach:
    """The distance of a method from the truth at each tolerance, largest over joints and time, rad."""

    scenario: str
    method: str
    errors: tuple[float, ...]


def run(name: str, method: str, tolerance: float) -> xr.Dataset:
    """Simulate the window of a scenario at one tolerance for all."""
    settings = {
        "duration": WINDOWS[name],
        "method": method,
        "rtol": tolerance,
        "atol_scale": tolerance,
        "sample_rate": _RATE,
    }
    return simulate(load_scenario(name, {f"simulation.{key}": value for key, value in settings.items()}))


def approaches(name: str) -> Iterator[Approach]:
    """Yield every method's way to the truth, which is Rodas4 at its tightest; Rodas5P of its own comes to the same."""
    truth = run(name, "Rodas4", 1e-11).joint_position
    for method in METHODS:
        errors = (float(abs(run(name, method, each).joint_position - truth).max()) for each in TOLERANCES)
        yield Approach(name, method, tuple(errors))


def measure() -> Section:
    """Let all methods approach the truth in both shipped scenarios."""
    checks: list[Check] = []
    found = {name: list(approaches(name)) for name in WINDOWS}
    source = "Rodas4 at 1e-11"
    for name, window in WINDOWS.items():
        for each in found[name]:
            what = f"{name}, {window:g} s: {each.method} at {TOLERANCES[-1]:g}, largest difference"
            checks.append(compare(what, source, each.errors[-1], LIMIT, "rad"))
    return Section.of(
        checks,
        Picture(plot(found), "Whatever the method, the motion approaches one and the same as the tolerance shrinks."),
    )


@styled
def plot(found: dict[str, list[Approach]]) -> Figure:
    """Draw the error against the tolerance, a panel per scenario."""
    figure = new_figure(9.5, 3.4, "constrained")
    panels = figure.subplots(1, len(found), squeeze=False)[0]
    for axes, (name, methods) in zip(panels, found.items(), strict=True):
        for index, each in enumerate(methods):
            axes.loglog(TOLERANCES, each.errors, marker="o", markersize=4, label=each.method, **series(index))
        axes.set(xlabel="tolerance", title=f"{name}, {WINDOWS[name]:g} s")
        axes.invert_xaxis()
    panels[0].set_ylabel("largest difference (rad)")
    panels[0].legend()
    return figure
