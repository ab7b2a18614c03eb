"""The finger in a browser: meshcat with tendons along their paths, coloured by tension.

The page is meshcat's own viewer with a player beside it. It is the same page as a file (`write_animation`) and served
while a result is viewed (`view`). Meshcat's server is not used: it
listens on every network interface, while this one is bound to the loopback address. `draw` puts the
finger into meshcat's own window.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from finger_pin.views.viewer.animation import write_animation
from finger_pin.views.viewer.drawing import draw
from finger_pin.views.viewer.page_server import PageHandle, view, view_forces

if TYPE_CHECKING:
    from finger_pin.views.viewer.video import draw_picture, write_video

__all__ = ["PageHandle", "draw", "draw_picture", "view", "view_forces", "write_animation", "write_video"]


def __getattr__(name: str) -> Any:
    """Import names that need matplotlib on first use."""
    if name in ("draw_picture", "write_video"):
        return getattr(import_module("finger_pin.views.viewer.video"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
