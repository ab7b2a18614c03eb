"""A result as a film: the finger as the page shows it, projected and drawn by matplotlib, without a browser."""

from __future__ import annotations

import contextlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.spatial
import xarray as xr
from matplotlib import rc_context, rcParams
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.files import replacing
from finger_pin.mechanism.geometry import LinkPoses
from finger_pin.typing import Array
from finger_pin.views.plots.style import new_figure, styled
from finger_pin.views.viewer.animation import Playback
from finger_pin.views.viewer.solids import (
    CAMERA_DIRECTION,
    FORCE_COLOUR,
    Solid,
    link_names,
    link_solids,
    strand_colours,
    tension_colours,
    tension_scale,
)

_BACKGROUND, _INK, _DIM_INK, _TRACE_COLOUR = "#1B2330", "#E8ECF2", "#9AA6B6", "#FF86B4"
#: Pixels of a film's width, and of that of a GIF, which is large for its size.
_WIDTH, _GIF_WIDTH = 1200, 720
_FIGURE_SIZE = (10.0, 6.0)
_NO_POINTS = np.zeros((0, 3))
#: Frames out of which the view is found.
_VIEW_FRAMES = 25


@styled
def write_video(
    result: xr.Dataset, path: str | os.PathLike[str], *, speed: float = 1.0, rate: float | None = None
) -> Path:
    """Write a result as a film: GIF, or MP4 with ffmpeg or imageio-ffmpeg.

    The file appears whole or not at all; an earlier one is replaced.

    Args:
        result: Dataset that `simulate` returned or saved.
        path: Of the film, ending in ``.mp4`` or ``.gif``.
        speed: Simulated seconds per second of film.
        rate: Frames per second of film; by default 30, of a GIF 20.

    Returns:
        The path of the film.

    Raises:
        InputError: If the result lacks something that is shown, or path, speed or rate are wrong.
        FingerPinError: If ffmpeg is needed and not found.
    """
    target = Path(path)
    is_gif = target.suffix == ".gif"
    if target.suffix not in (".mp4", ".gif"):
        raise InputError("path", "must end in .mp4 or .gif", str(path))
    rate = (20.0 if is_gif else 30.0) if rate is None else rate
    for name, value in (("speed", speed), ("rate", rate)):
        if not 0.0 < value < np.inf:
            raise InputError(name, "must be a number above 0", value)
    ffmpeg = find_ffmpeg()
    if not is_gif and not ffmpeg:
        requirement = "the program ffmpeg, which is not found (the package imageio-ffmpeg has it, too)"
        raise FingerPinError(f"an MP4 needs {requirement}; a GIF does without")
    writer: AbstractMovieWriter = (FFMpegWriter if ffmpeg else PillowWriter)(fps=rate)  # type: ignore[arg-type]
    motion = Playback.from_result(result, rate / speed)
    figure = new_figure(*_FIGURE_SIZE, layout=None)
    film = _Film(figure, motion)
    resolution = (_GIF_WIDTH if is_gif else _WIDTH) / _FIGURE_SIZE[0]
    context = rc_context({"animation.ffmpeg_path": ffmpeg})
    with context, replacing(target) as temporary, writer.saving(figure, temporary, resolution):
        step, last = speed / rate, motion.time[-1]
        for time in np.arange(motion.time[0], last + 0.5 * step, step):
            film.show(int(np.argmin(np.abs(motion.time - time))))
            writer.grab_frame(facecolor=_BACKGROUND)
    return target


@styled
def draw_picture(result: xr.Dataset, stage: Array, goal: Array | None = None) -> NDArray[np.uint8]:
    """Return a picture of the last sample of a result, shape (height, width, 3).

    Args:
        result: Dataset of `simulate`, or a part of it with the signals shown.
        stage: Points that are in view whatever the posture, shape (k, 3), m, base frame.
        goal: Point that is marked, shape (3,), m, base frame.
    """
    figure = new_figure(*_FIGURE_SIZE, layout=None)
    figure.set_dpi(_GIF_WIDTH / _FIGURE_SIZE[0])
    figure.set_facecolor(_BACKGROUND)
    motion = Playback.from_result(result)
    film = _Film(figure, motion, stage)
    film.show(len(motion.time) - 1)
    if goal is not None:
        film.mark(goal)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.array(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]


def find_ffmpeg() -> str:
    """Return the path of the program ffmpeg: matplotlib's, or that of the package imageio-ffmpeg; empty without any."""
    program = shutil.which(rcParams["animation.ffmpeg_path"])
    if program is None:
        with contextlib.suppress(ImportError, RuntimeError):
            import imageio_ffmpeg

            program = imageio_ffmpeg.get_ffmpeg_exe()
    return program or ""


@dataclass(frozen=True, eq=False)
class _Body:
    """A convex solid: points whose hull it is, in the frame of its link, shape (p, 3), m, and its colour."""

    link: int
    corners: Array
    colour: tuple[float, float, float, float]

    @classmethod
    def from_solid(cls, solid: Solid, links: list[str]) -> _Body:
        """Return the body of a solid, whose frame is one of the links."""
        corners = solid.geometry.points @ solid.rotation.T + solid.translation
        return cls(links.index(solid.frame), corners, (*solid.colour, solid.opacity))


class _Film:
    """A motion on a figure, a frame at a time."""

    def __init__(self, figure: Figure, motion: Playback, stage: Array = _NO_POINTS) -> None:
        """Set the stage: camera, legend, and bodies at rest; further points in view have shape (k, 3), m."""
        scene = motion.scene
        self.motion = motion
        self.poses = self.links = scene.geometry.poses(motion.position, motion.palm)
        links, objects = link_names(scene.geometry), motion.objects
        self.solids = [_Body.from_solid(each, links) for each in link_solids(scene.geometry, scene.tube_radius)]
        # Objects are added as links, but do not widen the view.
        finger_solids = self.solids
        if objects is not None and objects.by_name:
            links += [f"object_{name}" for name in objects.by_name]
            solids = [solid for name in objects.by_name for solid in objects.solids(name)]
            self.solids = [*self.solids, *(_Body.from_solid(solid, links) for solid in solids)]
            poses = np.stack([objects.object_poses(name) for name in objects.by_name], axis=1)
            rotations = Rotation.from_quat(poses[..., 3:].reshape(-1, 4)).as_matrix().reshape(*poses.shape[:2], 3, 3)
            self.poses = LinkPoses(
                np.concatenate([self.poses.rotation, rotations], axis=1),
                np.concatenate([self.poses.translation, poses[..., :3]], axis=1),
            )
        self.scale = tension_scale(motion.largest)
        direction = CAMERA_DIRECTION / np.linalg.norm(CAMERA_DIRECTION)
        right = np.cross([0.0, 0.0, 1.0], direction)
        right /= np.linalg.norm(right)
        # Rows: to the right, up, and towards the camera, in the base frame.
        self.camera = np.array([right, np.cross(direction, right), direction]) @ scene.view()
        self.tips = scene.tips(self.links) @ self.camera[:2].T
        self.axes = axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        view_frames = np.unique(np.linspace(0, len(motion.time) - 1, _VIEW_FRAMES).round().astype(int))
        points = np.concatenate(
            [
                self.tips.reshape(-1, 2),
                stage @ self.camera[:2].T,
                np.zeros((0, 2)) if objects is None else objects.points_in_view() @ self.camera[:2].T,
                *(self._outline(solid, frame) for frame in view_frames for solid in finger_solids),
                *(line for frame in view_frames for line in self._lines(frame)),
            ]
        )
        low, high = points.min(axis=0), points.max(axis=0)
        # Room for the legend at the left, and for the title above.
        unit = float(np.max((high - low) / (np.array([0.76, 0.8]) * _FIGURE_SIZE)))
        left, bottom = 0.5 * (low + high) - unit * np.array([0.58, 0.47]) * _FIGURE_SIZE
        axes.set(xlim=(left, left + unit * _FIGURE_SIZE[0]), ylim=(bottom, bottom + unit * _FIGURE_SIZE[1]))
        axes.text(0.025, 0.93, motion.title, color=_INK, transform=axes.transAxes, fontsize=13, parse_math=False)
        if scene.strands:
            self._legend(figure)
        self.clock = axes.text(0.975, 0.05, "", color=_INK, transform=axes.transAxes, ha="right", fontsize=13)
        self.bodies = PolyCollection([], linewidths=0.8)
        axes.add_collection(self.bodies)
        axes.plot(*np.moveaxis(self.tips, -1, 0), color=_TRACE_COLOUR, linewidth=1.0, alpha=0.3)
        self.traces = [axes.plot([], [], color=_TRACE_COLOUR, linewidth=2.0)[0] for _ in range(self.tips.shape[1])]
        width = 2.0 * 72.0 * scene.tube_radius / unit
        self.tubes = LineCollection([], linewidths=width, capstyle="round")
        axes.add_collection(self.tubes)
        self.arrows = LineCollection([], linewidths=width, colors=[tuple(FORCE_COLOUR[0])], zorder=3)
        axes.add_collection(self.arrows)

    def show(self, frame: int) -> None:
        """Move all bodies and tendons to their places in a frame."""
        motion, scene = self.motion, self.motion.scene
        # Distant solids are drawn first.
        depth = [float(self._corner_positions(solid, frame).mean(axis=0) @ self.camera[2]) for solid in self.solids]
        back_to_front = np.argsort(depth)
        self.bodies.set_verts([self._outline(self.solids[index], frame) for index in back_to_front])
        colours = [self.solids[index].colour for index in back_to_front]
        self.bodies.set_facecolor(colours)
        self.bodies.set_edgecolor([(0.8, 0.8, 0.8, 1.3 * opacity) for *_, opacity in colours])
        lines, tension = self._lines(frame), motion.tension[frame]
        strands = np.array([strand for tendon in scene.tendons for strand in tendon["strand"][:-1]], dtype=int)
        self.tubes.set_segments([pair for line in lines for pair in np.stack([line[:-1], line[1:]], axis=1)])
        self.tubes.set_color(strand_colours(tension, self.scale)[strands])
        for index, trace in enumerate(self.traces):
            trace.set_data(*self.tips[: frame + 1, index].T)
        if motion.objects is not None:
            self.arrows.set_segments(list(motion.objects.arrows()[frame] @ self.camera[:2].T))
        self.clock.set_text(f"{motion.time[frame]:.2f} s")

    def mark(self, goal: Array) -> None:
        """Mark a point of the last frame, shape (3,), m, base frame or that of a moving palm."""
        palm = self.motion.palm
        x, y = self.camera[:2] @ (goal if palm is None else palm.rotation[-1] @ goal + palm.translation[-1])
        self.axes.plot(x, y, "+", color=_TRACE_COLOUR, markersize=16.0, markeredgewidth=2.0, zorder=4)
        self.axes.annotate("goal", (x, y), (9.0, 6.0), textcoords="offset points", color=_INK, fontsize=11)

    def _lines(self, frame: int) -> list[Array]:
        """Return the paths of the strands."""
        motion, scene = self.motion, self.motion.scene
        poses = LinkPoses(self.links.rotation[frame], self.links.translation[frame])
        paths = scene.geometry.paths(motion.position[frame], scene.looseness(motion.tension[frame]), poses)
        return [path.points @ self.camera[:2].T for path in paths]

    def _corner_positions(self, solid: _Body, frame: int) -> Array:
        rotation, translation = self.poses.rotation[frame, solid.link], self.poses.translation[frame, solid.link]
        return np.asarray(solid.corners @ rotation.T + translation)

    def _outline(self, solid: _Body, frame: int) -> Array:
        points = self._corner_positions(solid, frame) @ self.camera[:2].T
        return np.asarray(points[scipy.spatial.ConvexHull(points).vertices])

    def _legend(self, figure: Figure) -> None:
        colours = ListedColormap(tension_colours(np.linspace(0.0, self.scale, 256), self.scale))
        bar_axes = figure.add_axes((0.03, 0.3, 0.014, 0.4))
        bar = figure.colorbar(ScalarMappable(Normalize(0.0, self.scale), colours), cax=bar_axes)
        bar.set_ticks([0.0, 0.5 * self.scale, self.scale])
        bar.ax.tick_params(colors=_DIM_INK, labelcolor=_INK)
        bar.set_label("tendon tension (N)", color=_INK)
        bar.outline.set_visible(False)
