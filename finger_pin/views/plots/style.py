"""The look of every figure: defaults beneath the user's own settings, and colours that all people can tell apart."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar

import matplotlib
import matplotlib.figure
from matplotlib.backends.backend_agg import FigureCanvasAgg

from finger_pin.exceptions import InputError

#: The look of figures, which the style sheet beside this file describes.
STYLE: Any = matplotlib.rc_params_from_file(Path(__file__).with_name("finger_pin.mplstyle"), use_default_template=False)

#: For joints and other series, in this order.
COLOURS: tuple[str, ...] = tuple(STYLE["axes.prop_cycle"].by_key()["color"])
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK = COLOURS
#: Too faint for a line on white; for areas.
YELLOW = "#F0E442"
GREY: str = STYLE["axes.edgecolor"]
#: Where there are more series than colours, the next round has these dashes.
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)))

#: Width of a figure: inches, or one or two columns of a journal. Default: that of the page of a screen.
Width = float | Literal["column", "page"] | None
#: One and two columns, in: IEEE Author Center, "Resolution and Size" (3.5 and 7.16 in).
WIDTHS = {"column": 3.5, "page": 7.16}
# Points: of a figure of its own size, and of one for a journal.
_TEXT_SIZE, _JOURNAL_TEXT_SIZE = 10.5, 8.5

#: The settings in force, and those of matplotlib itself.
settings: Any = matplotlib.rcParams
_DEFAULTS: Any = matplotlib.rcParamsDefault

_SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def styled(draw: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Return a function that draws in this style, beneath the user's own settings of matplotlib.

    It refuses a Dataset that lacks a variable, as one of another kind or with some variables only does.
    """

    @wraps(draw)
    def draw_with_style(*arguments: Arguments.args, **options: Arguments.kwargs) -> Result:
        style = {**STYLE, "font.size": _TEXT_SIZE if options.get("width") is None else _JOURNAL_TEXT_SIZE}
        with matplotlib.rc_context({key: value for key, value in style.items() if settings[key] == _DEFAULTS[key]}):
            try:
                return draw(*arguments, **options)
            except KeyError as error:
                # xarray names the missing variable only in its message.
                _, match, suffix = str(error.args[0]).partition("No variable named '")
                if not match:
                    raise
                name = suffix.partition("'")[0]
                raise InputError(f"result.{name}", f"is missing, and {draw.__name__} draws it") from None

    return draw_with_style


class Figure(matplotlib.figure.Figure):
    """A figure that belongs to no window, and that a notebook shows nevertheless.

    Attributes:
        titled: Whether its panels have titles.
    """

    titled = True

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def new_figure(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained", titles: bool = True
) -> Figure:
    """Return an empty figure that belongs to no window, in inches."""
    figure = Figure(figsize=(width, height), layout=layout)
    figure.titled = titles
    FigureCanvasAgg(figure)
    return figure


def inches(width: Width) -> float | None:
    """Return a width in inches, of the caller or of ``figure.figsize``, or None."""
    if width is None:
        figsize = settings["figure.figsize"]
        return None if list(figsize) == list(_DEFAULTS["figure.figsize"]) else float(figsize[0])
    length = WIDTHS.get(width, 0.0) if isinstance(width, str) else float(width)
    if not 1.0 <= length <= 100.0:
        raise InputError("width", "must be from 1 to 100 inches, or 'column' or 'page'", width)
    return length


def colour(name: str) -> str:
    """Return the active style's colour at the place that a colour has in the cycle of this package's style."""
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
