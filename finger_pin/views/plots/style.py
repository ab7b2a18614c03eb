"""The look of every figure: one style, and colours that colour-blind people can distinguish."""

from __future__ import annotations

import io
from typing import Any, Literal

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

#: Okabe and Ito, "Color Universal Design" (2008): distinct under every common colour blindness.
BLUE, VERMILLION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK = "#E69F00", "#56B4E9", "#000000"
#: Too faint for a line on white; for areas.
YELLOW = "#F0E442"

#: For joints and other series, in this order.
COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
#: Where there are more series than colours, the next round has these dashes.
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)))
GREY = "#666666"

# Typed loosely: which keys there are differs between versions of matplotlib.
STYLE: Any = {
    "figure.dpi": 130,
    "savefig.dpi": "figure",
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.edgecolor": GREY,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "lines.solid_joinstyle": "round",
    # What a legend covers shows through; its text can be read.
    "legend.facecolor": "white",
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "legend.fancybox": False,
    "legend.fontsize": 9.5,
    "legend.handlelength": 1.8,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": "black",
    "ytick.labelcolor": "black",
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 4),
    # Parsing mathematical text takes a third of the time of a drawing; plain text has superscripts too.
    "axes.formatter.use_mathtext": False,
    "mathtext.fontset": "dejavusans",
}

#: Applies the style while a function makes a figure; the caller's own settings come back afterwards.
styled = matplotlib.rc_context(STYLE)


_SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")


class Picture(Figure):
    """A figure that belongs to no window, and that a notebook shows nevertheless."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def power_of_ten(exponent: int) -> str:
    """Return a power of ten in plain text."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = None) -> Figure:
    """Return an empty figure that belongs to no window, in inches.

    Figures of results place their panels by `panels.stack`, which takes a fraction of the time of a layout engine.
    """
    figure = Picture(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure
