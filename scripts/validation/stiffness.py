"""A passive tendon of infinite stiffness is the gear of equation (4): r45 theta4 = r35 theta3."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.description.loading import load_scenario
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.simulate import simulate
from finger_pin.typing import Array
from finger_pin.views.plots.style import BLUE, GREY, VERMILLION, new_figure, styled
from validation.check import Check, Comparison, Picture, Section, compare

TITLE = "Infinite stiffness of the passive tendon"
STIFFNESSES = (5e5, 5e6, 5e7)
_DURATION = 1.0


@dataclass(frozen=True, eq=False)
class Stiffening:
    """The same motion with stiffer and stiffer passive tendons.

    Attributes:
        stiffness: K_t, shape (k,), N/m.
        gap: Largest |theta4 - theta3 r35 / r45| at each, shape (k,), rad.
        motion: theta of every run, shape (k, m, n), rad.
        stretch: The gap as the tensions of the halves explain it, (f5_3 + f5_4) / 2 K_t r45, against the gap itself.
    """

    stiffness: Array
    gap: Array
    motion: Array
    stretch: tuple[Comparison, ...]

    @property
    def orders(self) -> Array:
        """Order of the gap in 1 / K_t between neighbouring stiffnesses."""
        return np.asarray(-np.diff(np.log(self.gap)) / np.diff(np.log(self.stiffness)))

    @property
    def motion_order(self) -> float:
        """Order in 1 / K_t at which the motion of all joints settles, from three stiffnesses at equal ratios."""
        first, second = (float(np.abs(np.diff(self.motion, axis=0)[i]).max()) for i in (0, 1))
        return float(np.log(first / second) / np.log(self.stiffness[1] / self.stiffness[0]))


def run(stiffness: float) -> xr.Dataset:
    """Simulate the first second of `fig6` with a passive tendon of a stiffness, N/m."""
    settings = {"simulation.duration": _DURATION, "simulation.rtol": 1e-8, "simulation.atol_scale": 1e-9}
    return simulate(load_scenario("reversals", {"finger.passive_tendon.stiffness": stiffness, **settings}))


def stiffen() -> Stiffening:
    """Simulate with every stiffness."""
    routing = Finger(load_scenario("reversals").finger).routing
    r35, r45 = -routing.coupling[4, 2], routing.coupling[4, 3]
    gaps, motions, stretches = [], [], []
    for stiffness in STIFFNESSES:
        result = run(stiffness)
        theta = result.joint_position.values
        gap = theta[:, 2] * r35 / r45 - theta[:, 3]
        halves = result.passive_tension_proximal.values + result.tendon_tension.sel(tendon="T5").values
        gaps.append(np.abs(gap).max())
        motions.append(theta)
        stretches.append(Comparison(gap, halves / (2.0 * stiffness * r45)))
    return Stiffening(np.array(STIFFNESSES), np.array(gaps), np.array(motions), tuple(stretches))


def measure() -> Section:
    """Compare with the gear."""
    checks: list[Check] = []
    found = stiffen()
    what = f"distance from the gear at {found.stiffness[-1]:g} N/m"
    checks.append(compare(what, "equation (4)", found.gap[-1], 3e-5, "rad"))
    for stiffness, order in zip(found.stiffness[1:], found.orders, strict=True):
        what = f"order in 1 / K_t at which it vanishes, up to {stiffness:g} N/m"
        checks.append(compare(what, "stretch of a spring", order, 0.02, "1", expected=1.0))
    what = "order in 1 / K_t at which the motion of all joints settles"
    checks.append(compare(what, "stretch of a spring", found.motion_order, 0.05, "1", expected=1.0))
    what = "distance from the gear less the stretch that the tensions make, over it"
    gap = max(each.largest / float(np.abs(each.expected).max()) for each in found.stretch)
    checks.append(compare(what, "equations (5), (12)", gap, 1e-9, "1"))
    return Section.of(checks, Picture(plot(found), "The stiffer the passive tendon, the nearer the gear of (4)."))


@styled
def plot(found: Stiffening) -> Figure:
    """Draw the distance from the gear against the stiffness."""
    figure = new_figure(6.0, 3.2, "constrained")
    axes = figure.subplots()
    axes.loglog(found.stiffness, found.gap, "o-", color=BLUE, label="distance from (4)")
    moved = np.abs(np.diff(found.motion, axis=0)).max(axis=(1, 2))
    axes.loglog(found.stiffness[:-1], moved, "s-", color=VERMILLION, label="change of the motion to the next")
    slope = 0.4 * found.gap[0] * found.stiffness[0] / found.stiffness
    axes.loglog(found.stiffness, slope, color=GREY, linestyle=":", label="order 1")
    axes.set(xlabel="stiffness $K_t$ (N/m)", ylabel="angle (rad)")
    axes.legend()
    return figure
