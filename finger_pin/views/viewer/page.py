"""The page as one HTML text: meshcat's viewer, the player, and its data. It loads nothing from elsewhere."""

from __future__ import annotations

import html
import importlib.util
import json
from functools import cache
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from finger_pin.exceptions import FingerPinError


def render(animation: dict[str, Any]) -> str:
    """Return the page for a header of `Scene` with its chunks."""
    # In a script element only "<" could end the data early.
    data = json.dumps(animation, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Template(_text("page.html")).substitute(
        title=html.escape(animation["title"]),
        style=_text("style.css"),
        meshcat=_meshcat(),
        data=data,
        script="\n".join(_text(name) for name in ("data.js", "scene.js", "controls.js")),
    )


def _text(name: str) -> str:
    return resources.files("finger_pin.views.viewer").joinpath("web", name).read_text(encoding="utf-8")


@cache
def _meshcat() -> str:
    # Found without importing meshcat, which would import IPython and take half a second.
    spec = importlib.util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FingerPinError("the viewer needs the package meshcat, which is not installed")
    return Path(spec.origin).parent.joinpath("viewer", "dist", "main.min.js").read_text(encoding="utf-8")
