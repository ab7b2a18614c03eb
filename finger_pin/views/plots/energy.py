"""The energy account: where energy is stored, what is supplied and lost, and what is left unexplained."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.views.account import account
from finger_pin.views.plots.lines import shade, trace
from finger_pin.views.plots.panels import labelled, legend, logarithmic, sheet, stack, title
from finger_pin.views.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    Width,
    colour,
    power_of_ten,
    styled,
    thin,
)

if TYPE_CHECKING:
    from finger_pin.description.routing import Array

_STORED = {
    "kinetic": "kinetic",
    "gravity": "gravity",
    "passive_tendon": "passive tendons",
    "limiter": "limiters",
    "joint_springs": "joints' springs",
    "tendon_spring": "tendons' springs",
    "tendon_limit": "tendons' limits",
    "coupling": "couplings",
    "tendon_bristles": "tendon bristles",
    "joint_bristles": "joint bristles",
    "contacts": "contacts",
    "objects_kinetic": "objects, kinetic",
    "objects_gravity": "objects, gravity",
    "rotors": "rotors",
    "elastic_tendons": "tendons on spools",
    "gearboxes": "gear bristles",
}
_LOST = {
    "tendon_coulomb": ("tendons sliding", VERMILLION),
    "tendon_viscous": ("tendons viscous", ORANGE),
    "tendon_micro_damping": ("tendons' micro-damping", YELLOW),
    "joint_coulomb": ("joints sliding", BLUE),
    "joint_viscous": ("joints viscous", SKY),
    "joint_micro_damping": ("joints' micro-damping", BLACK),
    "limiter": ("stroke limiters", GREEN),
    "joint_springs": ("joints' springs", "saddlebrown"),
    "slack": ("tensions cut at zero", PURPLE),
    "contacts_impact": ("contacts, impact", "darkcyan"),
    "contacts_sliding": ("contacts sliding", "deeppink"),
    "contacts_micro_damping": ("contacts' bristles", "tan"),
    "motor_heat": ("heat in windings", "firebrick"),
    "gearbox_coulomb": ("gears sliding", "slategrey"),
    "gearbox_viscous": ("gears viscous", "lightsteelblue"),
    "elastic_damping": ("tendons stretching", "olive"),
    "tendon_spring_damping": ("tendons' dampers", "yellowgreen"),
    "tendon_limit_limiter": ("tendons' limits", "darkolivegreen"),
    "tendon_dry_friction_coulomb": ("tendons sliding dry", "sienna"),
    "coupling_damping": ("couplings", "mediumpurple"),
}
#: Of what has no colour of its own: rows that a user has added.
_OTHER = "rosybrown"
_MILLI = 1e3


@styled
def plot_energy(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the energy account from a result.

    (a) Every stored energy that is not zero throughout, mJ. (b) What has been supplied, mJ, and on top of each other
    what has been lost; with the change of the stored energy this must reach what was supplied. (c) The part of the
    supplied energy that the account cannot explain.

    Args:
        result: Dataset of `simulate`, of any finger.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    time = result["time"].values
    energies = account(result)
    order = sorted(energies.stored, key=[*_STORED, *energies.stored].index)
    stored = {name: energies.stored[name].values for name in order}
    shown = {name: values for name, values in stored.items() if np.any(values) or name == "kinetic"}
    supplied = np.sum([each.values for each in energies.supplied.values()], axis=0)
    figure, (left, right) = sheet([(5.1, max(6.6, 1.35 * len(shown))), (5.9, 6.6)], width, titles)
    strips = stack(left, [labelled(_STORED.get(name, name), "mJ") for name in shown])
    title(strips[0], "(a) stored energy")
    for axes, values in zip(strips, shown.values(), strict=True):
        trace(axes, time, _MILLI * values, color=BLUE, linewidth=thin())
    labels = ["energy (mJ)", "|residual| / supplied"]
    above, below = stack(right, labels, heights=[2.2, 1.0])
    lost = {name: each.values for name, each in energies.lost.items()}
    _balance(above, time, supplied, lost, np.asarray(sum(stored.values())))
    handles = above.get_legend_handles_labels()[0]
    legend(right, [handles[-1], *handles[-2::-1]])
    _residual(below, result, supplied)
    return figure


def _balance(axes: Axes, time: Array, supplied: Array, lost: dict[str, Array], stored: Array) -> None:
    level = np.zeros(len(time))
    for name in sorted(lost, key=[*_LOST, *lost].index):
        label, look = _LOST.get(name, (name.replace("_", " "), _OTHER))
        if np.any(lost[name]):
            above = level + _MILLI * lost[name]
            shade(axes, time, level, above, color=look, alpha=0.8, label=label)
            level = above
    change = _MILLI * (stored - stored[0])
    shade(axes, time, level, level + np.maximum(change, 0.0), color=GREY, alpha=0.35, label="put into store")
    if np.min(change) < 0.0:
        taken = {"facecolor": "none", "edgecolor": colour(BLACK), "hatch": "////", "alpha": 0.5}
        shade(axes, time, level + np.minimum(change, 0.0), level, label="taken from store", **taken)
    trace(axes, time, _MILLI * supplied, label="supplied", color=BLACK, linewidth=thin(1.15))
    if axes.dataLim.y0 >= 0.0:
        axes.set_ylim(bottom=0.0)
    title(axes, "(b) what was supplied, and where it went")


def _residual(axes: Axes, result: xr.Dataset, supplied: Array) -> None:
    time, residual = result["time"].values, result["energy_residual"].values
    scale = float(np.max(np.abs(supplied)))
    share = np.abs(residual) / (scale or 1.0)
    worst = float(np.max(share))
    if worst > 0.0:
        # Zeros have no place on a logarithmic axis: they go below its end.
        logarithmic(axes)
        axes.set_ylim(1e-4 * worst, 10.0 * worst)
        share = np.maximum(share, 1e-6 * worst)
    trace(axes, time, share, color=BLUE, linewidth=thin(0.65))
    title(axes, f"(c) unexplained: at most {_scientific(worst)} {'of the supplied energy' if scale else 'J'}")
    if not scale:
        axes.set_ylabel("|residual| (J)")


def _scientific(value: float) -> str:
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa} \N{MULTIPLICATION SIGN} {power_of_ten(int(exponent))}" if value else "0"
