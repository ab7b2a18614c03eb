"""The interface of a loop: a controller, its commands, its sensors, and the instant that they are asked at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, Self

from numpy.typing import ArrayLike

from finger_pin.core.tables.inputs import InputTable
from finger_pin.description.caching import cached_property
from finger_pin.description.routing import Routing
from finger_pin.mechanism.evaluation import Outputs
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import Motion, State
from finger_pin.references.reference import LoopReference, ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class ControlSignals:
    """The commands of a controller.

    Attributes:
        torque: tau^d, shape (..., n), N m.
        tension: f_hat, shape (..., t), N: commands of the actuated tendons, of winches the length that they wind in, m,
            then the planned passive tensions.
        torque_deficit: Part of tau^d beyond the tension limits, shape (..., n), N m; None without limits.
        inputs: Of the actuators of a tree, shape (..., k); None without any.
    """

    torque: Array
    tension: Array
    torque_deficit: Array | None = None
    inputs: Array | None = None


class Controller(Protocol):
    """A user's controller: from references and measured motion to tendon tensions, one time at a time."""

    def command(
        self, time: float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals | ArrayLike | Mapping[str, float]:
        """Return the commands at a time, s, for angles and speeds of shape (n,).

        Tensions alone will do, N, and the inputs of a tree's actuators behind them; or numbers by name.
        """


class Dynamics(Protocol):
    """An evaluator of a finger: `Finger`, or the compiled core."""

    def evaluate(
        self,
        x: Array,
        command: Array,
        fingertip_force: Array | None = None,
        base: Array | None = None,
        outputs: Outputs = "all",
    ) -> FingerSignals:
        """Return the signals at packed states under given tensions, on a base that moves or rests."""

    def powers(
        self, x: Array, command: Array, fingertip_force: Array | None = None, base: Array | None = None
    ) -> tuple[Array, Array]:
        """Return powers of the rows, and J^T F."""

    def motion(self, position: Array, velocity: Array, base: Array | None = None) -> Motion:
        """Return fingertip and energies of the rigid body."""


class Loop(Protocol):
    """Finger under control, in the view of its sensors."""

    @property
    def finger(self) -> Finger:
        """The finger."""

    @property
    def dynamics(self) -> Dynamics:
        """Evaluator of the finger."""

    def force(self, time: float) -> Array:
        """Return the force at the tips, N, base frame."""

    def base(self, time: float) -> Array | None:
        """Return the motion of palm and objects; None at rest."""


@dataclass(frozen=True, eq=False)
class Instant:
    """A finger at a sample, under the tensions that act until then.

    Attributes:
        loop: The finger under control.
        time: s.
        x: The packed state, shape (size,).
        tension: Of the actuated tendons, zero before the first sample, shape (a,), N.
    """

    loop: Loop
    time: float
    x: Array
    tension: Array

    @cached_property
    def state(self) -> State:
        """The state by name."""
        return self.loop.finger.layout.unpack(self.x)

    @cached_property
    def signals(self) -> FingerSignals:
        """All signals of the finger; of motors in position drive without their voltages."""
        loop = self.loop
        return loop.dynamics.evaluate(self.x, self.tension, loop.force(self.time), loop.base(self.time))


class SampledSensor(ABC):
    """A sensor of a sampled controller: its readings are recorded, and passed to a controller with `sense`.

    A controller of one's own names its own in ``sensors``. One object belongs to one simulation: it may remember.

    Attributes:
        name: In a result it follows ``measured_``.
        units: Of what it reads.
        dimension: Of its values, ``joint`` and ``tendon`` among others; empty for one number.
        labels: Names along a dimension of its own.
    """

    name: ClassVar[str]
    units: ClassVar[str] = "1"
    dimension: ClassVar[str] = ""
    labels: tuple[str, ...] = ()

    @abstractmethod
    def read(self, now: Instant) -> ArrayLike:
        """Return its values: one number, or shape (k,)."""


class LoopController(ABC):
    """A controller in a loop: its commands, its sensors, its knots, its compiled form.

    A new kind of controller needs `command`, and overrides what it can answer better: by default it is Python, and may
    remember what it was asked.

    Attributes:
        needs_sensors: Whether it takes readings of sensors, by `sense`; then it has to be sampled.
        sensors: Its own sensors, besides encoders and tension sensors.
        delays: After which its inputs act, shape (u,), s; None if they act at once, or their delays are in them.
        problem: Message of an error inside, or empty; the motion ends there.
        problem_time: When, s.
    """

    needs_sensors = False
    sensors: Sequence[SampledSensor] = ()
    delays: Array | None = None
    problem = ""
    problem_time = float("-inf")

    @abstractmethod
    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n)."""

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:  # noqa: B027 - most do not listen
        """Take the sensors' readings, by their names, ``tendon_tension`` among them, and the time since the last, s."""

    def measured(self, name: str, times: Array) -> Array:
        """Return the last readings of a sensor at times (m,), shape (m,) or (m, k); of a sampled controller."""
        raise LookupError(name)

    def as_control(self, reference: LoopReference, finger: Finger) -> InputTable | None:
        """Return its arrays for the compiled core, with a reference; None if it is Python."""
        return None

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time that it follows; steps end at their knots."""
        return ()

    def stateless(self) -> LoopController | None:
        """Return the stateless controller for evaluating the start; None if there is none."""
        return None

    @classmethod
    def from_fingers(cls, controllers: Sequence[Self], routing: Routing) -> LoopController | None:
        """Return one controller of this kind for all fingers of a hand; None if they have to stand side by side."""
        return None
