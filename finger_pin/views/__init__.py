"""What a result looks like: figures, pages that play it, films, a summary in words."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from finger_pin.views.viewer import LiveView, draw, view, view_forces, write_animation, write_video

__all__ = ["LiveView", "draw", "view", "view_forces", "write_animation", "write_video"]


def __getattr__(name: str) -> Any:
    """Import a view on first use."""
    if name in __all__:
        return getattr(import_module("finger_pin.views.viewer"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
