"""The look of every figure: defaults beneath the user's own settings, and colours that all people can tell apart."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from typing import Any, Literal, ParamSpec, TypeVar

import matplotlib
from cycler import cycler
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError

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

#: Width of a figure: inches, or one or two columns of a journal. Default: that of the page of a screen.
Width = float | Literal["column", "page"] | None
#: One and two columns, in: IEEE Author Center, "Resolution and Size" (3.5 and 7.16 in).
WIDTHS = {"column": 3.5, "page": 7.16}
# Points: of a figure of its own size, and of one for a journal.
_TEXT, _SMALL_TEXT = 10.5, 8.5

# Typed loosely: which keys there are differs between versions of matplotlib. Sizes are relative to ``font.size``.
STYLE: Any = {
    "figure.dpi": 130,
    "savefig.dpi": "figure",
    "font.family": "DejaVu Sans",
    "axes.titlesize": "medium",
    "figure.titlesize": "medium",
    "axes.titlelocation": "left",
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.4,
    "lines.solid_joinstyle": "round",
    # What a legend covers shows through; its text can be read.
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "legend.fancybox": False,
    "legend.fontsize": "small",
    "legend.handlelength": 1.8,
    "xtick.labelsize": "small",
    "ytick.labelsize": "small",
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 4),
    # Parsing mathematical text takes a third of the time of a drawing; plain text has superscripts too.
    "axes.formatter.use_mathtext": False,
    "mathtext.fontset": "dejavusans",
}

#: The settings in force, and those of matplotlib itself.
settings: Any = matplotlib.rcParams
_DEFAULTS: Any = matplotlib.rcParamsDefault

_SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Return a function that draws in this style, beneath the user's own settings of matplotlib."""

    @wraps(draw)
    def drawn(*arguments: P.args, **options: P.kwargs) -> R:
        style = STYLE | {"font.size": _TEXT if options.get("width") is None else _SMALL_TEXT}
        with matplotlib.rc_context({key: each for key, each in style.items() if settings[key] == _DEFAULTS[key]}):
            return draw(*arguments, **options)

    return drawn


class Picture(Figure):
    """A figure that belongs to no window, and that a notebook shows nevertheless.

    Attributes:
        titled: Whether its panels have titles.
        fitted: Functions that write the text that depends on its size: titles in lines, legends in columns.
    """

    titled = True
    fitted: tuple[Callable[[], None], ...] = ()

    def set_size_inches(self, w: Any, h: float | None = None, forward: bool = True) -> None:
        """Set the size as `Figure.set_size_inches` does, and fit titles and legends into it."""
        super().set_size_inches(w, h, forward=forward)
        for write in self.fitted:
            write()

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def fit(figure: Any, write: Callable[[], None]) -> None:
    """Write text that depends on a figure's size, now and whenever that changes."""
    write()
    if isinstance(figure, Picture):
        figure.fitted = (*figure.fitted, write)


def new_figure(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained", titles: bool = True
) -> Figure:
    """Return an empty figure that belongs to no window, in inches."""
    figure = Picture(figsize=(width, height), layout=layout)
    figure.titled = titles
    FigureCanvasAgg(figure)
    return figure


def inches(width: Width) -> float | None:
    """Return a width in inches, of the caller or of ``figure.figsize``, or None.

    Raises:
        InputError: If it is neither a length nor the name of one.
    """
    if width is None:
        own = settings["figure.figsize"]
        return None if list(own) == list(_DEFAULTS["figure.figsize"]) else float(own[0])
    found = WIDTHS.get(width, 0.0) if isinstance(width, str) else float(width)
    if not 1.0 <= found <= 100.0:
        raise InputError("width", "must be from 1 to 100 inches, or 'column' or 'page'", width)
    return found


def colour(name: str) -> str:
    """Return a colour of this style as it is in the style that is in force: the same place of its cycle."""
    if name == GREY:
        return str(settings["axes.edgecolor"])
    if name == BLACK:
        return str(settings["text.color"])
    if name not in COLOURS:
        return name
    cycle = cycle_colours()
    return cycle[COLOURS.index(name) % len(cycle)]


def cycle_colours() -> list[str]:
    """Return the colours of the style that is in force."""
    return list(settings["axes.prop_cycle"].by_key().get("color", COLOURS))


def thin(share: float = 0.8) -> float:
    """Return the width of a line, in points, that is a share of the usual one."""
    return share * float(settings["lines.linewidth"])


def limit_line() -> dict[str, Any]:
    """Return the look of a line that marks a limit."""
    return {"color": colour(GREY), "linestyle": (0, (5, 3)), "linewidth": thin()}


def power_of_ten(exponent: int) -> str:
    """Return a power of ten in plain text."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)
