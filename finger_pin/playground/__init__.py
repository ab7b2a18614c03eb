"""A scenario played in the browser in real time, on viser: pull tendons, drag the tip, change friction as it moves.

`session.py` is all of it without a page; `stage.py` draws the viewer's scene with viser, `panel.py` and `charts.py` are
the controls, `player.py` is the loop.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.description.loading import ScenarioLike
from finger_pin.exceptions import FingerPinError
from finger_pin.version import installing

if TYPE_CHECKING:
    from finger_pin.playground.player import Playground

__all__ = ["play"]


def play(
    scenario: ScenarioLike = "fig6",
    *,
    keys: Sequence[str] = (),
    rtol: float = 1e-3,
    host: str = "127.0.0.1",
    port: int = 0,
    folder: str | os.PathLike[str] = "results/play",
    open_browser: bool | None = None,
    block: bool | None = None,
) -> Playground:
    """Play a scenario in the browser: it moves in real time while sliders pull its tendons and the mouse its tips.

    Args:
        scenario: The scenario, its name, or the path of a file.
        keys: Further parameters that sliders change, such as ``finger.tendon_friction.viscous``.
        rtol: Relative tolerance, and the absolute one over the scale of each kind of state. The method is Rodas4.
        host: Interface on which the page is served; by default this machine alone reaches it.
        port: Of the page; by default a free one.
        folder: Where records go.
        open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
        block: Whether to play until Ctrl-C; by default where Python is not interactive and a browser opens.

    Returns:
        The playground, with its address; already closed if the call has blocked.

    Raises:
        InputError: Naming the entry that cannot be played.
        FingerPinError: If viser is not installed.
    """
    if find_spec("viser") is None:
        raise FingerPinError(f"the playground needs viser: {installing('play')}")
    from finger_pin.playground.player import serve
    from finger_pin.playground.session import Session

    return serve(Session(scenario, keys=keys, rtol=rtol), host, port, Path(folder), open_browser, block)
