"""Fig. 2: the workspace of a finger, as a surface and as a section in its flexion plane."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure, SubFigure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from finger_pin.mechanism.coerce import FingerLike, as_finger, one_finger
from finger_pin.typing import Array
from finger_pin.views.plots.panels import sheet, title
from finger_pin.views.plots.statics import AXES, axes_around
from finger_pin.views.plots.style import BLACK, BLUE, ORANGE, VERMILLION, Width, colour, styled, thin
from paper.workspace_surfaces import fingertip_surface, flexion_section

# The printed ticks are centimetres, whatever their labels say.
_CENTI = 1e2
_ISOLINES = 7


@styled
def plot_workspace(finger: FingerLike, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw Fig. 2: the workspace of the fingertip with passive tendons that do not stretch, equation (4).

    Left the surface in space, right the section in the flexion plane with the finger at three poses; cm, base frame. As
    in the print, joints that passive tendons drive stand at zero in the section.

    Args:
        finger: A finger, its description, its name, or the path of its file.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    finger = as_finger(finger)
    one_finger(finger.description)
    surface, section = fingertip_surface(finger), flexion_section(finger, coupled=False)
    figure, (left, right) = sheet([(5.5, 5.2), (5.5, 5.2)], width, titles)
    solid = _surface(left, _CENTI * surface, _CENTI * section.poses)
    plane = right.subplots()
    _section(plane, _CENTI * section.patches, _CENTI * section.poses, section.plane)
    imposed, straight = (", with (4) imposed", ", driven joints at 0") if finger.routing.passive else ("", "")
    title(solid, f"(a) where the fingertip can go{imposed}\n{_ranges(surface, range(3))}")
    title(plane, f"(b) section in the flexion plane{straight}\n{_ranges(section.patches, section.plane)}")
    return figure


def _surface(part: SubFigure, patches: Array, poses: Array) -> Axes3D:
    quads = _quads(patches)
    corners = np.concatenate([quads.reshape(-1, 3), poses[0]])
    solid = axes_around(part, corners, "cm")
    colours = _lit(quads)
    solid.add_collection3d(Poly3DCollection(quads, facecolors=colours, edgecolors=0.88 * colours, linewidths=0.3))
    solid.plot(*poses[0].T, color=colour(BLACK), marker="o", markersize=3.5, linewidth=thin(1.4))
    return solid


def _section(axes: Axes, patches: Array, poses: Array, plane: tuple[int, int]) -> None:
    flat = patches[..., plane]
    # Without smooth edges the cells leave no seams between them.
    cells = list(_quads(flat))
    axes.add_collection(PolyCollection(cells, facecolors="#D3E9F7", edgecolors="none", antialiaseds=False))
    if len(flat) == 1:
        # A single patch: lines along which one joint moves while the other stands.
        step = np.linspace(0, flat.shape[1] - 1, _ISOLINES).round().astype(int)
        lines = [*flat[0][step], *flat[0][:, step].swapaxes(0, 1)]
        axes.add_collection(LineCollection(lines, colors=colour(BLUE), linewidths=thin(0.6)))
    styles = zip(poses[..., plane], ("straight", "half flexed", "flexed"), (BLACK, ORANGE, VERMILLION), strict=True)
    for pose, label, look in styles:
        axes.plot(*pose.T, color=colour(look), label=label, marker="o", markersize=4, linewidth=thin(1.6))
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set_xlabel(f"{AXES[plane[0]]} (cm)")
    axes.set_ylabel(f"{AXES[plane[1]]} (cm)")
    axes.legend(loc="upper right")


def _ranges(patches: Array, axes: Iterable[int]) -> str:
    """Return the extent of fingertip positions, m, along the given axes, as text in cm."""
    texts = []
    for axis in axes:
        low, high = _CENTI * np.nanmin(patches[..., axis]), _CENTI * np.nanmax(patches[..., axis])
        texts.append(f"{AXES[axis]}: {low + 0.0:.1f} to {high + 0.0:.1f} cm".replace("-", "\N{MINUS SIGN}"))
    return ",   ".join(texts)


def _quads(patches: Array) -> Array:
    """Return the cells of grids, shape (patches, m, m, d), as polygons of shape (cells, 4, d), without gaps."""
    corners = [patches[:, :-1, :-1], patches[:, 1:, :-1], patches[:, 1:, 1:], patches[:, :-1, 1:]]
    quads = np.stack(corners, axis=-2).reshape(-1, 4, patches.shape[-1])
    return np.asarray(quads[np.isfinite(quads).all(axis=(1, 2))])


def _lit(quads: Array) -> Array:
    """Return a shade of blue for every quad, shape (cells, 3), lighter towards the light."""
    normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = np.array([0.9, -0.25, 0.75])
    share = 0.15 + 0.85 * np.abs(normal @ (light / np.linalg.norm(light)))
    dark, pale = np.array([0.0, 0.30, 0.55]), np.array([0.72, 0.88, 0.97])
    rgb = dark + share[:, None] * (pale - dark)
    return np.asarray(rgb)
