"""Figures as files: all those of a result, or one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.files import replacing
from finger_pin.simulation.frames import read_scene
from finger_pin.views.plots.contact_forces import plot_contact
from finger_pin.views.plots.energy_account import plot_convergence, plot_energy
from finger_pin.views.plots.fig6 import plot_fig6
from finger_pin.views.plots.hands import plot_hand_motion
from finger_pin.views.plots.losses import plot_bends, plot_losses
from finger_pin.views.plots.servo import plot_servo
from finger_pin.views.plots.style import Width, settings

FORMATS = ("png", "pdf", "svg")
#: What is drawn of every result of a finger, and of a hand.
FIGURES = {"fig6": plot_fig6, "losses": plot_losses, "energy": plot_energy}
TREE_FIGURES = {"motion": plot_hand_motion, "energy": plot_energy}
#: What is drawn of results with a variable: by name the function, and the variable.
_FIGURES_OF_VARIABLES: dict[str, tuple[Callable[..., Figure], str]] = {
    "convergence": (plot_convergence, "convergence_difference"),
    "contact": (plot_contact, "contact_force"),
    "servo": (plot_servo, "motor_current"),
    "bends": (plot_bends, "wrap_tension"),
}


def figures_by_name(result: xr.Dataset) -> dict[str, Callable[..., Figure]]:
    """Return the figures that are drawn of a result, by name."""
    figures: dict[str, Callable[..., Figure]] = dict(FIGURES if read_scene(result.attrs).finger.links else TREE_FIGURES)
    return figures | {name: draw for name, (draw, key) in _FIGURES_OF_VARIABLES.items() if key in result}


def draw_all(
    result: xr.Dataset,
    folder: str | Path,
    names: Iterable[str] | None = None,
    *,
    format: str | None = None,
    width: Width = None,
    titles: bool = True,
) -> list[Path]:
    """Draw the figures of a result into a folder, made if need be, and return the paths of the files.

    Args:
        result: Dataset of `simulate`.
        folder: Folder of the file; one of the same name is replaced whole or not at all.
        names: Which of `figures_by_name`; all by default.
        format: `png`, `pdf` or `svg`; default that of matplotlib's setting ``savefig.format``, PNG unless changed.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figures = figures_by_name(result)
    functions = list(figures if names is None else names)
    for name in functions:
        if name not in figures:
            raise InputError("names", f"the figures of this result are {', '.join(figures)}", name)
    paths = ((name, figures[name](result, width=width, titles=titles)) for name in functions)
    return [save_figure(figure, Path(folder) / name, format) for name, figure in paths]


def save_figure(figure: Figure, path: str | Path, format: str | None = None) -> Path:
    """Write a figure, whole or not at all, and return its path.

    Args:
        figure: The figure.
        path: Of the file, whose ending is its format; without one it gets the format's.
        format: `png`, `pdf` or `svg`; default that of matplotlib's setting ``savefig.format``, PNG unless changed.
    """
    target = Path(path)
    if not target.suffix:
        target = target.with_name(f"{target.name}.{format or settings['savefig.format']}")
    suffix = target.suffix.removeprefix(".").lower()
    if suffix not in FORMATS:
        raise InputError("format", f"must be {', '.join(FORMATS)}", suffix)
    target.parent.mkdir(parents=True, exist_ok=True)
    engine = figure.get_layout_engine()
    with replacing(target) as temporary:
        try:
            if engine is not None and suffix == "png":
                # matplotlib draws a figure twice that it lays out itself.
                engine.execute(figure)
                figure.set_layout_engine(None)
            # Low compression takes a fifth of the time, and line drawings are small.
            options: Any = {"pil_kwargs": {"compress_level": 2}} if suffix == "png" else {}
            figure.savefig(temporary, format=suffix, **options)
        finally:
            if engine is not None:
                figure.set_layout_engine(engine)
    return target
