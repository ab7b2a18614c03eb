"""Figures: the workspace and the friction law of the paper, what a result holds, what analyses and experiments say.

Every function returns a matplotlib ``Figure`` that belongs to no window: save it with ``figure.savefig(path)``.
Figures of a result are drawn from its Dataset alone.
"""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.files import replacing
from finger_pin.views.plots.comparing import compare
from finger_pin.views.plots.convergence import plot_convergence
from finger_pin.views.plots.energy import plot_energy
from finger_pin.views.plots.fig6 import plot_fig6
from finger_pin.views.plots.force_capability import plot_force_polytope, plot_radius_sensitivity
from finger_pin.views.plots.friction_influence import plot_friction_influence
from finger_pin.views.plots.friction_law import plot_friction_law
from finger_pin.views.plots.hand_motion import plot_hand_motion
from finger_pin.views.plots.losses import plot_losses
from finger_pin.views.plots.pareto import plot_pareto
from finger_pin.views.plots.passive_delivery import plot_passive_delivery
from finger_pin.views.plots.self_locking import plot_critical_friction, plot_runaway, plot_self_locking_map
from finger_pin.views.plots.servo import plot_servo
from finger_pin.views.plots.sweep import plot_sweep
from finger_pin.views.plots.transmission import plot_transmission
from finger_pin.views.plots.workspace import plot_workspace
from finger_pin.views.trees import is_tree

__all__ = [
    "compare",
    "draw_all",
    "plot_convergence",
    "plot_critical_friction",
    "plot_energy",
    "plot_fig6",
    "plot_force_polytope",
    "plot_friction_influence",
    "plot_friction_law",
    "plot_hand_motion",
    "plot_losses",
    "plot_pareto",
    "plot_passive_delivery",
    "plot_radius_sensitivity",
    "plot_runaway",
    "plot_self_locking_map",
    "plot_servo",
    "plot_sweep",
    "plot_transmission",
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
    figures = {"motion": plot_hand_motion, "energy": plot_energy} if is_tree(result) else dict(_FIGURES)
    if "convergence_difference" in result:
        figures["convergence"] = plot_convergence
    if "motor_current" in result:
        figures["servo"] = plot_servo
    return [save_figure(draw(result), Path(folder) / f"{name}.png") for name, draw in figures.items()]


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure as PNG, whole or not at all, and return its path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    with replacing(target) as temporary:
        # Little compression: it takes a fifth of the time, and a line drawing is small anyway.
        figure.savefig(temporary, format="png", pil_kwargs={"compress_level": 2})
    return target
