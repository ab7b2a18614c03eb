"""Views of a result, or of a simulation in progress, in a browser on this machine."""

from __future__ import annotations

import html
import itertools
import json
import sys
import time
import webbrowser
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.analysis import ForcePolytope
from finger_pin.control.closed_loop import LoopSignals
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.notebook import in_notebook
from finger_pin.typing import Array
from finger_pin.views.viewer.animation import animation_page, posture_page
from finger_pin.views.viewer.page import render
from finger_pin.views.viewer.scene import Scene
from finger_pin.views.viewer.server import PageServer

#: Upper end of the legend before a live tension exceeds it, N.
LIVE_TENSION = 10.0
#: Height of the page in a notebook, pixels.
_CELL = 620


class Viewing:
    """A page that is being served; a context manager that ends it.

    Attributes:
        url: Its address, on the loopback interface.
    """

    def __init__(self, server: PageServer, page: str | None = None) -> None:
        """Take a running server, and its page if that is whole."""
        self._server, self._page = server, page
        self.url = server.url

    def wait(self) -> None:
        """Serve until the user interrupts (Ctrl-C)."""
        try:
            self._server.join()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """Stop serving; open pages keep their frames."""
        self._server.close()

    def __repr__(self) -> str:
        """Return the address."""
        return f"<{type(self).__name__} at {self.url}>"

    def _repr_html_(self) -> str:
        # Notebooks show the page itself: where they run on another machine, this one's address leads nowhere.
        if self._page is not None:
            page = html.escape(self._page)
            return f'<iframe srcdoc="{page}" width="100%" height="{_CELL}" style="border: none"></iframe>'
        return f'<iframe src="{self.url}" width="100%" height="{_CELL}" style="border: none"></iframe>'

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Stop serving."""
        self.close()


def view(
    result: xr.Dataset,
    *,
    forces: ForcePolytope | None = None,
    ghost: xr.Dataset | None = None,
    finger: Finger | None = None,
    open_browser: bool | None = None,
    block: bool | None = None,
) -> Viewing:
    """Show a result in meshcat: the finger moves, its tendons run along their paths in the colour of their tension.

    Args:
        result: Dataset that `simulate` returned or saved.
        forces: Polytope of `force_polytope`, drawn translucent at the fingertip of its posture.
        ghost: Another result, whose finger moves faintly beside this one at the same times.
        finger: The finger that moved, if it stands on a model of the user's own (`Finger.from_model`).
        open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
        block: Whether to serve until Ctrl-C; by default where Python is not interactive.

    Returns:
        The page in service, with its address; already closed if the call has blocked.

    Raises:
        InputError: If the result lacks something that is shown.
    """
    return _served(animation_page(result, forces, ghost, finger), open_browser, block)


def view_forces(
    finger: FingerLike,
    forces: ForcePolytope,
    *,
    tension: ArrayLike | None = None,
    open_browser: bool | None = None,
    block: bool | None = None,
) -> Viewing:
    """Show the forces that a fingertip can exert: a translucent body at the tip of the finger at rest.

    Args:
        finger: The finger, its description, its name, or the path of its file.
        forces: Polytope of `force_polytope`.
        tension: Of every strand, shape (s,), N, such as `RequiredTension.strands`; slack by default.
        open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
        block: Whether to serve until Ctrl-C; by default where Python is not interactive.

    Returns:
        The page in service, with its address; already closed if the call has blocked.

    Raises:
        InputError: If the finger is not made of links.
    """
    return _served(posture_page(finger, forces, tension), open_browser, block)


def _served(page: str, open_browser: bool | None, block: bool | None) -> Viewing:
    viewing = Viewing(PageServer(page), page)
    _open(viewing.url, open_browser)
    if block is None:
        block = not (sys.flags.interactive or "ps1" in vars(sys) or in_notebook())
    if block:
        print(f"The finger moves at {viewing.url} (Ctrl-C ends this)", flush=True)
        viewing.wait()
    return viewing


def _open(url: str, wanted: bool | None) -> None:
    if not in_notebook() if wanted is None else wanted:
        webbrowser.open(url, new=2)


class LiveView(Viewing):
    """A page that shows a simulation while it runs."""

    def __init__(
        self, finger: FingerLike, *, title: str = "", open_browser: bool | None = None, rate: float = 30.0
    ) -> None:
        """Serve the page and print its address; frames come with `update`.

        Args:
            finger: The finger, its description, its name, or the path of its file.
            title: Shown above the legend; the finger's title when left out.
            open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
            rate: Most frames per second of real time.
        """
        self._scene = Scene(finger)
        description = self._scene.geometry.description
        self._interval = 1.0 / rate
        self._due = -np.inf
        self._started = -np.inf
        self._pending: tuple[float, Array, Array, Array | None] | None = None
        limits = np.array([joint.range for joint in description.joints.values()]).clip(-np.pi, np.pi)
        # The camera must see all of the range: poses with the joints bent alike, and every combination of the first
        # joints' limits.
        alike = np.linspace(limits[:, 0], limits[:, 1], 9)
        combined = np.tile(limits[:, 0], (2 ** min(len(limits), 6), 1))
        combined[:, :6] = list(itertools.product(*limits[:6]))
        reach = np.concatenate([alike, combined])
        header = self._scene.header(title or description.title or description.name, reach, LIVE_TENSION, live=True)
        super().__init__(PageServer(render(header), live=True))
        print(f"The finger moves at {self.url}", flush=True)
        _open(self.url, open_browser)

    def update(
        self,
        t: float,
        joint_position: ArrayLike,
        tendon_tension: ArrayLike,
        passive_tension_proximal: ArrayLike | None = None,
    ) -> None:
        """Show a state, unless the last one has just been shown; cheap enough for every step of a simulation.

        Args:
            t: Simulated time, s, never decreasing.
            joint_position: theta, shape (n,), rad.
            tendon_tension: Shape (t,), actuated first, N; of a passive tendon its distal half.
            passive_tension_proximal: Of the passive tendons, shape (p,) or one number, N; as distal when left out.
        """
        now = time.monotonic()
        # Copies: a caller may reuse its arrays before the state is shown.
        proximal = None if passive_tension_proximal is None else np.array(passive_tension_proximal, dtype=float)
        self._pending = (t, np.array(joint_position, dtype=float), np.array(tendon_tension, dtype=float), proximal)
        if now >= self._due:
            self._due = now + self._interval
            self._show()

    def observe(self, t: float, signals: LoopSignals) -> None:
        """Show a simulation in progress, held back to real time: an observer for `simulate`.

        Args:
            t: Simulated time, s.
            signals: All signals then.
        """
        now = time.monotonic()
        # A simulation that has fallen behind does not catch up: it goes on from there in real time.
        self._started = max(self._started, now - t)
        time.sleep(self._started + t - now)
        strands = signals.finger.tendons.strands
        actuated = signals.finger.command.size
        tension = np.concatenate([strands[:actuated], strands[actuated + 1 :: 2]])
        self.update(t, signals.finger.state.position, tension, strands[actuated::2])

    def close(self) -> None:
        """Show the last state and stop serving; open pages keep their frames."""
        self._show()
        super().close()

    def _show(self) -> None:
        if self._pending is None:
            return
        t, joint_position, tension, proximal = self._pending
        self._pending = None
        description = self._scene.geometry.description
        actuated = len(description.actuated_names)
        if tension.shape != (len(description.tendons),):
            raise InputError("tendon_tension", f"must have {len(description.tendons)} entries", tension.shape)
        distal = tension[actuated:]
        near = distal if proximal is None else np.broadcast_to(proximal, distal.shape)
        strands = np.concatenate([tension[:actuated], np.stack([near, distal], axis=-1).ravel()])
        chunk = self._scene.chunk([t], joint_position[None], strands[None])
        self._server.publish(json.dumps(chunk))
