"""Running plots of a played finger, and bars of the friction in use."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from viser import uplot

from finger_pin.playground.session import Reading, Session
from finger_pin.playground.stage import Stage
from finger_pin.typing import Array
from finger_pin.views.viewer.solids import tension_colours

# Of the plots: their length, s, and the time between samples, s.
_PLOT_DURATION, _SAMPLE_PERIOD = 10.0, 0.05
_HEIGHT = 170
_COLOURS = ("#4dabf7", "#ffa94d", "#69db7c", "#ff8787", "#b197fc", "#ffd43b", "#66d9e8", "#f783ac")
_STICKING_COLOUR, _SLIPPING_COLOUR = "#4dabf7", "#ff8787"
# From this part of its level on a bristle is shown as slipping.
_SLIP_USE = 0.95


class Charts:
    """Bars of friction and plots of a session, of one finger of a hand at a time."""

    def __init__(self, gui: Any, session: Session, stage: Stage) -> None:
        """Add all charts."""
        self._session, self._stage, routing = session, stage, session.finger.routing
        self._joints, self._tendons = list(routing.joints), list(routing.tendons)
        self._scale = 0.0
        hand = session.scenario.hand
        fingers = [*hand.fingers] if hand is not None and len(hand.fingers) > 1 else []
        self._finger = gui.add_dropdown("Finger", fingers) if fingers else None
        self._legend = gui.add_html("")
        self._friction = gui.add_html("")
        self._times: deque[float] = deque(maxlen=round(_PLOT_DURATION / _SAMPLE_PERIOD))
        self._samples: deque[tuple[Array, Array, Array]] = deque(maxlen=self._times.maxlen)
        self._contacts = list(session.finger.scene.contacts.names) if session.finger.scene is not None else []
        titles = ("joint angle, °", "tendon tension, N", "contact force, N")
        names = (self._joints, self._tendons, self._contacts)
        self._plots = [(signal, self._add_plot(gui, signal, titles[signal])) for signal in range(3) if names[signal]]
        if self._finger is not None:
            self._finger.on_update(lambda _: self._update_plots())

    def _add_plot(self, gui: Any, signal: int, title: str) -> Any:
        # The time axis shows seconds, not dates.
        scales = {"x": uplot.Scale(time=False)}
        return gui.add_uplot(*self._data(signal), title=title, height=_HEIGHT, scales=scales)

    def _indices(self, names: Sequence[str]) -> list[int]:
        """Return the indices of the names of the shown finger."""
        if self._finger is None:
            return list(range(len(names)))
        return [index for index, name in enumerate(names) if name.partition(".")[0] == self._finger.value]

    def _data(self, signal: int) -> tuple[tuple[Array, ...], tuple[uplot.Series, ...]]:
        names = (self._joints, self._tendons, self._contacts)[signal]
        indices = self._indices(names) or [0]
        times = np.array(self._times) if self._times else np.zeros(1)
        values = np.array([sample[signal] for sample in self._samples]) if self._samples else np.zeros((1, len(names)))
        series = [
            uplot.Series(label=names[k].rpartition(".")[2], stroke=_COLOURS[position % len(_COLOURS)], width=2)
            for position, k in enumerate(indices)
        ]
        return (times, *(np.ascontiguousarray(values[:, k]) for k in indices)), (uplot.Series(label="s"), *series)

    def _update_plots(self) -> None:
        for signal, plot in self._plots:
            plot.data, plot.series = self._data(signal)

    def reset(self) -> None:
        """Delete the plotted samples."""
        self._times.clear()
        self._samples.clear()

    def show(self, now: Reading) -> None:
        """Add an instant to the plots, and show its friction."""
        if self._times and now.time < self._times[-1]:
            self.reset()
        if not self._times or now.time - self._times[-1] >= _SAMPLE_PERIOD:
            forces = np.zeros(0) if now.contacts is None else np.linalg.norm(now.contacts.force, axis=-1)
            self._times.append(now.time)
            self._samples.append((np.degrees(now.position), now.tension, forces))
            for signal, plot in self._plots:
                plot.data = self._data(signal)[0]
        self._friction.content = self._bars(now)
        if self._tendons and self._scale != self._stage.scale:
            self._scale = self._stage.scale
            self._legend.content = _legend(self._scale)

    def _bars(self, now: Reading) -> str:
        rows = []
        for title, names, use in (("tendons", self._tendons, now.tendon_use), ("joints", self._joints, now.joint_use)):
            if len(use):
                rows.append(f'<div style="opacity:.7;margin-top:6px">{title}</div>')
                rows += [_bar(names[index].rpartition(".")[2], float(use[index])) for index in self._indices(names)]
        header = "<b>Friction in use</b>: at 100 % it slips"
        return f'<div style="font-size:12px;padding:2px 12px 8px">{header}{"".join(rows)}</div>'


def _bar(name: str, use: float) -> str:
    percent, colour = 100.0 * min(use, 1.0), _SLIPPING_COLOUR if use > _SLIP_USE else _STICKING_COLOUR
    return (
        '<div style="display:flex;align-items:center;gap:8px;line-height:1.5">'
        f'<span style="width:76px;overflow:hidden">{html.escape(name)}</span>'
        '<span style="flex:1;height:8px;border-radius:4px;background:rgba(128,128,128,.25)">'
        f'<span style="display:block;width:{percent:.0f}%;height:8px;border-radius:4px;background:{colour}"></span>'
        "</span>"
        f'<span style="width:38px;text-align:right">{100.0 * use:.0f} %</span></div>'
    )


def _legend(scale: float) -> str:
    colours = tension_colours(np.linspace(0.0, scale, 6), scale)
    stops = ",".join(f"rgb({','.join(str(int(255 * component)) for component in colour)})" for colour in colours[1:])
    return (
        '<div style="font-size:12px;padding:4px 12px">tension of the tendons; grey: slack'
        f'<div style="height:8px;border-radius:4px;background:linear-gradient(to right,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>0</span><span>{scale:.4g} N</span></div></div>'
    )
