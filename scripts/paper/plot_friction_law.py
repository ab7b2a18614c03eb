"""Fig. 3: the friction law (9) in steady sliding."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.laws.bristle import friction_coefficient, steady_force
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.panels import heading, sheet, title
from finger_pin.views.plots.style import Width, styled, thin

#: The printed figure's: normal force, N; M^c / M^d from 1.1 to 2; omega from 1e-4 to 1, here m/s, as its unit is not
#: printed; velocities up to 5 mm/s. M^d, and omega above and M^c / M^d below, are not printed.
NORMAL = 10.0
KINETIC = 0.10
RATIOS = (1.1, 1.4, 1.7, 2.0)
RATIO = 2.0
STRIBECK = (1e-4, 1e-3, 1e-2, 1.0)
STRIBECK_TOP = 1e-3
FASTEST = 5e-3


@styled
def plot_friction_law(*, width: Width = None, titles: bool = True) -> Figure:
    """Draw Fig. 3: F^s of (9) with F^s' = 0 against the velocity, for F^n = 10 N.

    Top: varying M^c / M^d. Bottom: varying the Stribeck velocity omega. The viscous part of (9c) is left out.

    Args:
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (part,) = sheet([(7.5, 6.4)], width, titles)
    top, bottom = part.subplots(2, 1, sharex=True, sharey=True)
    _curves(top, ((ratio * KINETIC, STRIBECK_TOP, f"{ratio:g}") for ratio in RATIOS))
    title(top, rf"varying $M^c$:  $M^d$ = {KINETIC:g},  $\omega$ = {1e3 * STRIBECK_TOP:g} mm/s")
    top.legend(title=r"$M^c\,/\,M^d$", loc="upper left", alignment="left")
    _curves(bottom, ((RATIO * KINETIC, stribeck, f"{stribeck:g} m/s") for stribeck in STRIBECK))
    title(bottom, rf"varying $\omega$:  $M^d$ = {KINETIC:g},  $M^c$ = {RATIO * KINETIC:g}")
    bottom.legend(title=r"$\omega$", loc="upper left", alignment="left")
    bottom.set_xlabel("velocity $v$ (mm/s)")
    heading(figure, rf"Friction law for $F^n$ = {NORMAL:g} N")
    return figure


def _curves(axes: Axes, variants: Iterable[tuple[float, float, str]]) -> None:
    # Denser towards zero, where the curves are steep; the step at zero is the line between the two branches.
    branch = FASTEST * np.geomspace(1e-6, 1.0, 400)
    velocity = np.concatenate([-branch[::-1], branch])
    for index, (static, stribeck, label) in enumerate(variants):
        coefficient = friction_coefficient(velocity, KINETIC, static, stribeck)
        force = steady_force(velocity, NORMAL, coefficient, 0.0)
        axes.plot(1e3 * velocity, force, label=label, linewidth=thin(1.3), **series(index))
    axes.set_xlim(-1e3 * FASTEST, 1e3 * FASTEST)
    axes.set_ylabel("friction force $F^s$ (N)")
