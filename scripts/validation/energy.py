"""The energy account of every scenario that ships: energies supplied, stored and lost add up."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.description.loading import load_scenario
from finger_pin.description.tables import list_scenarios
from finger_pin.simulation.simulate import simulate
from finger_pin.views.plots.lines import series, trace
from finger_pin.views.plots.style import new_figure, styled
from validation.check import Check, Picture, Section, compare

TITLE = "Energy account"
TOLERANCES = (1e-4, 1e-6, 1e-8)
#: The residual at the default tolerances over the work supplied, and at a hundredth of them.
LIMIT, TIGHT_LIMIT = 2e-6, 2e-8
#: The same where bodies hit each other: the account of a step in which a contact closes is less exact, and looked at
#: again only where it leaves 1e-5 of all that is exchanged open, which is two to three times what is supplied. That of
#: `press` scatters from 1.3e-8 to 2.6e-8 where the gain changes by 1e-9 to 1e-5 of it. That of `servo_bench` is open
#: from its first millisecond on, in which its gears begin to slide: by 1e-7 at a tolerance of 1e-8, by 2e-8 at 1e-9.
IMPACT_LIMITS = {"pinch": (3e-5, 1e-6), "press": (LIMIT, 5e-8), "servo_bench": (LIMIT, 2e-7)}
#: Where objects fall, over all energy that is exchanged: the balls of `pour` bring 180 times what the finger supplies.
#: They bounce off each other, so that the last bit of a number, or another machine, makes another motion, and the
#: residual scatters: gains that differ by 1e-12 to 1e-7 leave 1.5e-6 to 7.5e-6 of it open, at 1e-8 2e-7 to 8e-7. Over
#: what the finger supplies the latter are 4e-5 to 1.4e-4.
FALLING_LIMITS = {"pour": (3e-5, 3e-6)}


def run(name: str, tolerance: float) -> xr.Dataset:
    """Simulate a shipped scenario at one tolerance for all."""
    return simulate(load_scenario(name, {"simulation.rtol": tolerance, "simulation.atol_scale": tolerance}))


def supplied(result: xr.Dataset) -> float:
    """Return the greatest work of actuators, motors' electronics, and guides of palm and objects, J."""
    names = [f"energy_exchanged_{each}" for each in ("actuators", "electrical", "palm", "objects")]
    return sum(float(abs(result[name]).max()) for name in names if name in result)


def exchanged(result: xr.Dataset) -> float:
    """Return the sum of the greatest works, supplied and lost, J."""
    works = [each for name, each in result.items() if str(name).startswith("energy_exchanged_")]
    return sum(float(abs(each).max()) for each in works)


def open_share(result: xr.Dataset, name: str) -> float:
    """Return the largest residual over the work supplied, where objects fall over all that is exchanged."""
    return float(abs(result.energy_residual).max()) / (exchanged if name in FALLING_LIMITS else supplied)(result)


def measure() -> Section:
    """Keep the account of every shipped scenario at three tolerances."""
    checks: list[Check] = []
    runs = {name: {each: run(name, each) for each in TOLERANCES} for name in list_scenarios()}
    for name, results in runs.items():
        limits = (IMPACT_LIMITS | FALLING_LIMITS).get(name, (LIMIT, TIGHT_LIMIT))
        over = "all energy exchanged" if name in FALLING_LIMITS else "the work supplied"
        for tolerance, limit in zip((1e-6, 1e-8), limits, strict=True):
            default = " (the default)" if tolerance == 1e-6 else ""
            what = f"{name}: residual over {over}, tolerance {tolerance:g}{default}"
            checks.append(compare(what, "conservation of energy", open_share(results[tolerance], name), limit, "1"))
    return Section.of(
        checks, Picture(plot(runs), "What the account leaves open, over the work supplied; the tighter, the less.")
    )


@styled
def plot(runs: dict[str, dict[float, xr.Dataset]]) -> Figure:
    """Draw the residual over time at every tolerance, a panel per scenario."""
    columns = min(len(runs), 2)
    rows = -(-len(runs) // columns)
    figure = new_figure(9.5, 3.2 * rows + 0.2, "constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for unused in panels[len(runs) :]:
        unused.set_visible(False)
    for axes, (name, results) in zip(panels, runs.items(), strict=False):
        for index, (tolerance, result) in enumerate(results.items()):
            share = np.maximum(np.abs(result.energy_residual.values) / supplied(result), 1e-13)
            trace(axes, result.time.values, share, label=f"tolerance {tolerance:.0e}", linewidth=1.0, **_line(index))
        axes.set(yscale="log", xlabel="time (s)", title=name)
    for axes in panels[::columns]:
        axes.set_ylabel("residual over work supplied")
    panels[len(runs) - 1].legend(loc="lower right")
    return figure


def _line(index: int) -> dict[str, object]:
    return {"color": series(index)["color"]}
