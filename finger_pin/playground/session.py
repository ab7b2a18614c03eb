"""A played scenario without its page: simulator, inputs, springs at the tips, record, pace."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from finger_pin.control import ClosedLoop
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.evaluation import ContactPoints
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.playground.sliders import FINGER, Inputs, Slider, parameters
from finger_pin.simulation.netcdf import save
from finger_pin.simulation.simulator import Simulator
from finger_pin.typing import Array

# Of what is not recorded this much is kept, s.
_LOG_DURATION = 60.0


@dataclass(frozen=True, eq=False)
class Reading:
    """The signals of an instant that a page shows.

    Attributes:
        time: s.
        position: theta, shape (n,), rad.
        strands: Tension of every strand and then of every cord, as `Scene.strands`, shape (s,), N.
        tension: Of every tendon, of a passive one its distal half, shape (t,), N.
        tendon_use: Bristle force of every tendon over the friction of steady sliding, shape (t,): 1 slips.
        joint_use: The same of every joint, shape (n,), or (0,) where their law has no bristles.
        force: F at the tips, shape (f, 3), N.
        objects: Poses of the free objects, x, y, z and quaternion x, y, z, w, shape (k, 7).
        contacts: Contacts in space; None without objects.
    """

    time: float
    position: Array
    strands: Array
    tension: Array
    tendon_use: Array
    joint_use: Array
    force: Array
    objects: Array
    contacts: ContactPoints | None


class Session:
    """A scenario that is played, step by step.

    Attributes:
        scenario: The scenario, with the present parameters.
        simulator: Steps it.
        inputs: Inputs that move it.
        parameters: Sliders of its parameters.
        handles: Place to which the spring of every tip pulls it, shape (3,), m, base frame; None for none.
        stiffness: Stiffness of the springs, N/m.
        recording: Whether the motion is recorded.
    """

    def __init__(self, scenario: ScenarioLike, *, keys: Sequence[str] = (), rtol: float = 1e-3) -> None:
        """Start a scenario.

        Args:
            scenario: The scenario, its name, or the path of a file.
            keys: Further keys to change while it is played.
            rtol: Relative tolerance, and the absolute one over the scale of each kind of state.
        """
        self.scenario = load_scenario(scenario)
        loop = ClosedLoop.from_scenario(self.scenario)
        self.inputs = Inputs(self.scenario, loop)
        self.parameters = parameters(self.scenario, loop.controller, keys)
        self._slider_values = [each.start for each in self.parameters]
        self._family = ParametrisedScenario(self.scenario, [key for each in self.parameters for key in each.keys])
        start = loop.initial_state()
        posture = loop.finger.layout.unpack(start).position
        self.simulator = Simulator(loop.finger, posture, method="Rodas4", rtol=rtol, atol_scale=rtol)
        self.handles: list[Array | None] = [None] * len(loop.finger.rigid_body.tips)
        self.stiffness, self.recording = 20.0, False
        self._loop, self._pieces = loop, list[Simulator]()
        self.reset()

    @property
    def finger(self) -> Finger:
        """The finger that moves."""
        return self.simulator.finger

    def reset(self) -> None:
        """Go back to the start of the scenario, with the present parameters; a record goes on in a new piece."""
        self._end_piece()
        self.simulator.reset(self._loop.initial_state())
        self._log_start = 0.0
        self.inputs.reset()
        self.handles = [None] * len(self.handles)

    def postures(self, times: Array) -> Array:
        """Return the desired postures of the scenario at times (m,), s, shape (m, n), rad."""
        return self._loop.reference.at(times).position

    @property
    def tips(self) -> Array:
        """The fingertips, shape (f, 3), m, base frame."""
        tips: Array = self.finger.rigid_body.tip_position(self.simulator.state.position)
        return tips.reshape(-1, 3)

    def force(self) -> Array:
        """Return F at the tips, shape (f, 3), N: the scenario's, and that of the springs."""
        force = np.array(self._loop.force(self.simulator.time)).reshape(-1, 3)
        if any(handle is not None for handle in self.handles):
            for index, (handle, tip) in enumerate(zip(self.handles, self.tips, strict=True)):
                if handle is not None:
                    force[index] += self.stiffness * (handle - tip)
        return force

    def step(self) -> None:
        """Advance by one period of the inputs.

        Raises:
            IntegrationError: If the integrator cannot go on.
        """
        simulator = self.simulator
        if not self.recording and simulator.time - self._log_start > _LOG_DURATION:
            self._restart_log()
        command, force = self.inputs.command(simulator.time, simulator.x), self.force()
        simulator.step(command, self.inputs.period, force[0] if len(force) == 1 else force)

    def move(self, kind: str, index: int, value: float) -> None:
        """Move a slider of the inputs."""
        self.inputs.set_value(kind, index, value, self.simulator.state.position)

    def choose(self, kind: str) -> tuple[Slider, ...]:
        """Let another kind of input move the finger; return its sliders."""
        self.inputs.choose(kind, self.simulator.state.position)
        return self.inputs.sliders[kind]

    def change(self, index: int, value: float) -> None:
        """Change a parameter, and go on from the same state; a record goes on in a new piece."""
        values = [*self._slider_values[:index], value, *self._slider_values[index + 1 :]]
        entries: dict[str, object] = {}
        for parameter, slider_value in zip(self.parameters, values, strict=True):
            entries |= parameter.entries(slider_value)
        scenario = self._family.with_values([*entries.values()])
        loop = ClosedLoop.from_scenario(scenario)
        if self.parameters[index].keys[0].partition(".")[0] in FINGER:
            previous = self.simulator.clone()
            self.simulator.set_parameters({key: entries[key] for key in entries if key.partition(".")[0] in FINGER})
            self._end_piece(previous)
            self._log_start = self.simulator.time
        self.inputs.set_scenario(scenario, loop)
        self.scenario, self._loop, self._slider_values = scenario, loop, values

    def _restart_log(self) -> None:
        """Start a new log at the present state."""
        self.simulator.x = self.simulator.x
        self._log_start = self.simulator.time

    def _end_piece(self, piece: Simulator | None = None) -> None:
        if self.recording and self.simulator.time > self._log_start:
            self._pieces.append(piece or self.simulator.clone())

    def record(self) -> None:
        """Record from now on."""
        self._pieces = []
        self._restart_log()
        self.recording = True

    def stop(self) -> list[Simulator]:
        """Stop the record; return the simulators of its pieces: one, and one more for every change of the finger."""
        self._end_piece()
        self.recording = False
        pieces, self._pieces = self._pieces, []
        self._restart_log()
        if not pieces:
            raise InputError("record", "is empty: play first")
        return pieces

    def signals(self) -> FingerSignals:
        """Return all signals of the finger now."""
        return self.simulator.signals()

    def reading(self) -> Reading:
        """Return the signals of this instant that a page shows."""
        finger, signals = self.finger, self.signals()
        state = signals.state
        scene, joints = finger.scene, signals.rows["joint_friction"]
        bristles = bool(finger.layout.names_of("joint_stiction"))
        return Reading(
            time=self.simulator.time,
            position=state.position,
            strands=np.concatenate(
                [signals.strands, signals["cord_tension"]] if finger.cord_names else [signals.strands]
            ),
            tension=signals["tendon_tension"],
            tendon_use=_tendon_use(signals),
            joint_use=np.abs(joints.row.state) / joints["level"] if bristles else np.zeros(0),
            force=np.reshape(signals.fingertip_force, (-1, 3)),
            objects=state.object_pose.reshape(-1, 7),
            contacts=None if scene is None else signals.mechanism.touching,
        )


def _tendon_use(signals: FingerSignals) -> Array:
    """Return the bristle force of every tendon over its friction limit; of several bends the largest."""
    tables = [signals.rows[name] for name in ("driven_tendons", "passive_tendons")]
    use = np.concatenate([np.abs(rows.row.state) / rows["level"] for rows in tables])
    for name, weights in signals.finger.wraps.items():
        wraps = signals.rows[name]
        bend_use = np.abs(wraps.row.state) / wraps["level"]
        use = np.maximum(use, np.max((weights != 0.0) * bend_use, axis=1, initial=0.0))
    return use


def save_pieces(pieces: Sequence[Simulator], folder: Path, name: str) -> list[Path]:
    """Write the record of a session as netCDF, a file for each piece, under names that are free; return their paths.

    Raises:
        OSError: If they cannot be written.
    """
    results: list[xr.Dataset] = [piece.result() for piece in pieces]
    folder.mkdir(parents=True, exist_ok=True)
    number = 1
    while list(folder.glob(f"{name}-{number}*.nc")):
        number += 1
    single = len(results) == 1
    paths = [folder / f"{name}-{number}{'' if single else f'-{part}'}.nc" for part in range(1, len(results) + 1)]
    for result, path in zip(results, paths, strict=True):
        save(result, path)
    return paths


#: Frames per second that are aimed at.
FRAME_RATE = 60.0
# Most wall time of a frame's steps, and of what is still owed from before, s.
_MAX_STEP_TIME, _MAX_BACKLOG = 1.0 / 30.0, 0.1
# Time over which the rate is averaged, s; below this part of the wish, time is called slow.
_AVERAGING_TIME, _SLOW_RATE = 0.7, 0.9


class Pacer:
    """Clock that keeps simulated time in pace with wall time, as far as the machine can.

    Attributes:
        speed: Desired simulated seconds per second.
        rate: Actual simulated seconds per second.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """Start now, by a clock in s."""
        self._clock, self.speed = clock, 1.0
        self.restart()

    def restart(self) -> None:
        """Restart the clock, such as after a pause."""
        self.rate, self._backlog, self._frame_start = self.speed, 0.0, self._clock()

    def start_frame(self) -> float:
        """Start a frame; return the simulated time that is due, s."""
        now = self._clock()
        self._frame_time, self._frame_start = now - self._frame_start, now
        # A larger backlog is dropped: time runs slower.
        self._backlog = min(self._backlog + self.speed * self._frame_time, self.speed * _MAX_BACKLOG)
        return self._backlog

    @property
    def is_late(self) -> bool:
        """True once the steps of this frame have taken as long as they may."""
        return self._clock() - self._frame_start > _MAX_STEP_TIME

    def finish_frame(self, simulated: float) -> None:
        """End a frame, with the simulated time in it, s."""
        self._backlog -= simulated
        if self._frame_time > 0.0:
            share = min(self._frame_time / _AVERAGING_TIME, 1.0)
            self.rate += share * (simulated / self._frame_time - self.rate)

    @property
    def is_slow(self) -> bool:
        """True where the machine cannot follow."""
        return self.rate < _SLOW_RATE * self.speed

    def idle_time(self) -> float:
        """Return the time to wait for the next frame, s."""
        return max(0.0, self._frame_start + 1.0 / FRAME_RATE - self._clock())
