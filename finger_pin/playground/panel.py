"""Controls beside the scene: inputs of the finger, parameters, plots."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import nullcontext
from functools import partial
from itertools import groupby
from typing import Any, Protocol

import numpy as np
import viser

from finger_pin.exceptions import InputError
from finger_pin.playground.charts import Charts
from finger_pin.playground.session import Reading, Session
from finger_pin.playground.sliders import SCENARIO, Slider
from finger_pin.playground.stage import Stage
from finger_pin.typing import Array

_SPEEDS = {"real time": 1.0, "half": 0.5, "a quarter": 0.25, "a tenth": 0.1, "a hundredth": 0.01}
PLAY, PAUSE, STEP, RESET = "Play", "Pause", "Step", "Reset"
_RECORD, _STOP = "Record", "Stop and save"
# Springs at the tips, N/m.
_LEAST_STIFFNESS, _MOST_STIFFNESS = 1.0, 100.0
# Where such a spring may end, m from the base.
_MAX_DISTANCE = 10.0
_DEGREE = np.pi / 180.0
# Sliders that move nothing follow at every fifth report, so that one can type beside them.
_REPORT_STRIDE = 5
# More sliders than these are shown when they are asked for.
_MANY_SLIDERS = 16


class Player(Protocol):
    """Player that the controls command."""

    session: Session
    playing: bool

    def schedule(self, job: Callable[[], None]) -> None:
        """Run a job between two steps, and show its error if it is refused."""

    def press(self, button: str) -> None:
        """Pause, play, step or reset."""

    def set_speed(self, speed: float) -> None:
        """Change the speed of time."""

    def record(self, on: bool) -> None:
        """Start a record, or stop and save it."""


class Panel:
    """The controls of a player."""

    def __init__(self, server: viser.ViserServer, player: Player, stage: Stage) -> None:
        """Add all controls."""
        self._gui, self._player, self._stage = server.gui, player, stage
        session = player.session
        self._gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, control_width="medium")
        self._gui.set_panel_label(session.scenario.name)
        self._report_count = 0
        self._status = self._gui.add_markdown("")
        self._add_buttons()
        tabs = self._gui.add_tab_group()
        with tabs.add_tab("Move"):
            self._add_inputs()
            self._add_springs()
        with tabs.add_tab("Change"):
            self._add_parameters()
        with tabs.add_tab("Watch"):
            self.charts = Charts(self._gui, session, stage)

    def _add_buttons(self) -> None:
        player, gui = self._player, self._gui
        self._play = gui.add_button_group("Time", (PAUSE, STEP, RESET))
        self._play.on_click(lambda event: player.schedule(lambda: player.press(event.target.value)))
        speed = gui.add_dropdown("Speed", tuple(_SPEEDS))
        speed.on_update(lambda _: player.schedule(lambda: player.set_speed(_SPEEDS[speed.value])))
        self._record = gui.add_button(_RECORD, hint="Keep what is played, as a result in results/play")
        self._record.on_click(lambda _: player.schedule(lambda: player.record(not player.session.recording)))

    def _add_inputs(self) -> None:
        player, inputs = self._player, self._player.session.inputs
        self._kind: Any = self._gui.add_dropdown("Moved by", inputs.kinds)
        self._folders: dict[str, Any] = {}
        self._sliders: dict[str, list[Any]] = {}
        for kind in inputs.kinds:
            if kind != SCENARIO:
                self._folders[kind] = self._gui.add_folder(
                    kind[0].upper() + kind[1:], expand_by_default=len(inputs.sliders[kind]) <= _MANY_SLIDERS
                )
                with self._folders[kind]:
                    self._sliders[kind] = [*self._add_kind(kind, inputs.sliders[kind])]

        @self._kind.on_update
        async def _(event: Any) -> None:
            # Changes by this program have no client.
            if event.client is not None:
                player.schedule(lambda: self._choose(self._kind.value))

    def _add_kind(self, kind: str, sliders: Sequence[Slider]) -> Iterator[Any]:
        """Yield the controls of a kind, those of every finger of a hand in a folder of their own."""
        numbered = list(enumerate(sliders))
        for finger, group in groupby(numbered, lambda item: item[1].name.rpartition(".")[0]):
            is_first = sliders[0].name.startswith(finger)
            with self._gui.add_folder(finger, expand_by_default=is_first) if finger else nullcontext():
                yield from [self._add_input(kind, index, slider) for index, slider in group]

    def _add_input(self, kind: str, index: int, slider: Slider) -> Any:
        unit, factor, low, high = displayed_range(slider)
        step = 10.0 ** np.floor(np.log10((high - low) / 200.0))
        name = slider.name.rpartition(".")[2]
        label = f"{name}, {unit}" if unit else name
        start = min(max(0.0, low), high)
        handle = self._gui.add_slider(label, min=low, max=high, step=step, initial_value=start)

        @handle.on_update
        async def _(event: Any) -> None:
            # Read in the server's thread, before this program can set another value.
            if event.client is not None:
                value = float(np.clip(handle.value / factor, slider.low, slider.high))
                self._player.schedule(lambda: self._on_moved(kind, index, value))

        return handle

    def _on_moved(self, kind: str, index: int, value: float) -> None:
        kind_changed = kind != self._player.session.inputs.kind
        self._player.session.move(kind, index, value)
        if kind_changed:
            self._kind.value = kind
            self.update_sliders(except_for=index)

    def _choose(self, kind: str) -> None:
        self._player.session.choose(kind)
        self.update_sliders()

    def update_sliders(self, except_for: int = -1) -> None:
        """Set the sliders of the present kind to its values."""
        inputs = self._player.session.inputs
        self._kind.value = inputs.kind
        if inputs.kind != SCENARIO:
            self._set_sliders(inputs.kind, inputs.values[inputs.kind], except_for)

    def _set_sliders(self, kind: str, values: Array, except_for: int = -1) -> None:
        sliders = self._player.session.inputs.sliders[kind]
        for index, (handle, slider) in enumerate(zip(self._sliders[kind], sliders, strict=True)):
            if index != except_for:
                _, factor, low, high = displayed_range(slider)
                value = round(float(np.clip(values[index] * factor, low, high)), 2 if high - low > 2.0 else 4)
                if value != handle.value:
                    handle.value = value

    def _add_springs(self) -> None:
        session, stage = self._player.session, self._stage
        hand = session.scenario.hand
        tip_names = session.finger.description.tree.tip_names or tuple(hand.fingers if hand else ())
        names = tip_names if len(stage.crosses) > 1 else ("fingertip",)
        self._spring_boxes: list[Any] = []
        with self._gui.add_folder("Drag by a spring"):
            for index, cross in enumerate(stage.crosses):
                box = self._gui.add_checkbox(names[index], False, hint="Shows a cross to drag; off lets go")
                self._spring_boxes.append(box)
                box.on_update(partial(self._on_ticked, index))
                cross.on_update(self._on_drag(index))
            stiffness = self._gui.add_slider(
                "Stiffness, N/m", min=_LEAST_STIFFNESS, max=_MOST_STIFFNESS, step=1.0, initial_value=session.stiffness
            )
            stiffness.on_update(
                lambda _: self._player.schedule(lambda: setattr(session, "stiffness", _number(stiffness)))
            )

    def _on_ticked(self, index: int, event: Any) -> None:
        visible = bool(event.target.value)
        self._player.schedule(lambda: self._show_cross(index, visible))

    def _show_cross(self, index: int, visible: bool) -> None:
        session, cross = self._player.session, self._stage.crosses[index]
        session.handles[index] = None
        cross.position, cross.visible = session.tips[index], visible

    def _on_drag(self, index: int) -> Callable[[Any], Coroutine[Any, Any, None]]:
        async def on_update(event: Any) -> None:
            point = np.array(event.target.position, dtype=float)
            self._player.schedule(lambda: self._pull(index, point))

        return on_update

    def _pull(self, index: int, point: Array) -> None:
        if not (np.abs(point) <= _MAX_DISTANCE).all():
            raise InputError("spring", f"must end within {_MAX_DISTANCE:g} m of the base", point.tolist())
        if self._stage.crosses[index].visible:
            self._player.session.handles[index] = point

    def _add_parameters(self) -> None:
        for index, parameter in enumerate(self._player.session.parameters):
            step = 10.0 ** np.floor(np.log10(parameter.high / 100.0))
            handle = self._gui.add_slider(
                parameter.label,
                min=0.0,
                max=parameter.high,
                step=step,
                initial_value=parameter.start,
                hint=", ".join(parameter.keys),
            )
            handle.on_update(partial(self._change, index))

    def _change(self, index: int, event: Any) -> None:
        handle = event.target
        self._player.schedule(lambda: self._player.session.change(index, _number(handle)))

    def hide_crosses(self) -> None:
        """Hide all crosses."""
        for box, cross in zip(self._spring_boxes, self._stage.crosses, strict=True):
            box.value = cross.visible = False

    def report(self, time: float, rate: float, slow: bool, message: str) -> None:
        """Show the time, its rate, and a message."""
        playing, recording = self._player.playing, self._player.session.recording
        pace = f"{rate:.2g} × real time" if playing else "paused"
        if playing and slow:
            pace = f"**slow: {pace}**, this machine cannot follow"
        parts = [f"{time:.2f} s, {pace}", *(["**recording**"] if recording else []), *([message] if message else [])]
        text = "  \n".join(parts)
        if self._status.content != text:
            self._status.content = text
        options = (PAUSE if playing else PLAY, STEP, RESET)
        if self._play.options != options:
            self._play.options = options
        label = _STOP if recording else _RECORD
        if self._record.label != label:
            self._record.label = label

    def show(self, reading: Reading) -> None:
        """Show the signals of an instant, on the sliders of other inputs as well."""
        self.charts.show(reading)
        inputs, self._report_count = self._player.session.inputs, self._report_count + 1
        if self._report_count % _REPORT_STRIDE:
            return
        for kind in self._sliders:
            if kind != inputs.kind:
                self._set_sliders(kind, inputs.slider_values(kind, reading.position))


def _number(handle: Any) -> float:
    """Return the value of a slider; a message may have set it beyond its ends."""
    value = float(handle.value)
    if not handle.min <= value <= handle.max:
        raise InputError(handle.label, f"must be from {handle.min:g} to {handle.max:g}", value)
    return value


def displayed_range(slider: Slider) -> tuple[str, float, float, float]:
    """Return the unit in which a slider is shown, its factor, and the range in it: degrees, millimetres."""
    unit, factor = {"rad": ("°", 1.0 / _DEGREE), "m": ("mm", 1e3)}.get(slider.unit, (slider.unit, 1.0))
    return unit, factor, round(slider.low * factor, 3), round(slider.high * factor, 3)
