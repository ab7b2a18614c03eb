"""Figures: the workspace and the friction law of the paper, and what a result holds.

Every function returns a matplotlib ``Figure`` that belongs to no window: save it with ``figure.savefig(path)``.
Figures of a result are drawn from its Dataset alone.
"""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.files import replacing
from finger_pin.plots.energy import plot_energy
from finger_pin.plots.fig6 import plot_fig6
from finger_pin.plots.friction_law import plot_friction_law
from finger_pin.plots.losses import plot_losses
from finger_pin.plots.pareto import plot_pareto
from finger_pin.plots.sweep import plot_sweep
from finger_pin.plots.workspace import plot_workspace

__all__ = [
    "draw_all",
    "plot_energy",
    "plot_fig6",
    "plot_friction_law",
    "plot_losses",
    "plot_pareto",
    "plot_sweep",
    "plot_workspace",
    "save_figure",
]

_FIGURES = {"fig6": plot_fig6, "losses": plot_losses, "energy": plot_energy}


def draw_all(result: xr.Dataset, folder: str | Path) -> list[Path]:
    """Draw every figure of a result into a folder, made if need be, and return the paths of the PNG files.

    Args:
        result: Dataset of `simulate`.
        folder: Where to write; a file of the same name is replaced whole or not at all.
    """
    return [save_figure(draw(result), Path(folder) / f"{name}.png") for name, draw in _FIGURES.items()]


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG, whole or not at all, and return its path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as temporary:
        figure.savefig(temporary, format="png")
    return target
