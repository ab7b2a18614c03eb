"""Laws: the force of a row of the mechanism as a function of its motion, its state and its load.

The force acts along the row's arm: positive drives its length up. All functions of a law are pure functions of numbers
or arrays; NumPy runs them as they are, and the compiler runs the same text.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from finger_pin.typing import Array, Number, Numbers, Parameters


class Row(NamedTuple):
    """The arguments of a law: numbers, or arrays that broadcast.

    Attributes:
        length: l, along the path; excursion from a reference posture.
        speed: l'.
        state: z, the row's own state; 0 without one.
        load: N, what earlier rows press it with.
        command: u, its input, from the controller or an earlier row.
        curvature: phi, the angle by which its path turns, rad.
        side: On which side of its law's kink the row is held, 1 or -1; 0 to follow the motion. An integrator holds
            rows during a step, so that what it integrates is smooth, and ends steps where a row leaves its side.
        reading: A weighted sum of the states of other rows, such as a temperature; 0 without any.
    """

    length: Number
    speed: Number
    state: Number
    load: Number
    command: Number
    curvature: Number
    side: Number = 0.0
    reading: Number = 0.0


def on_positive_side(kink: Number, side: Number) -> Number:
    """Return 1 for a row on the positive side of its kink, or held there; else 0."""
    return 1.0 * (kink * (side == 0.0) + side > 0.0)


def magnitude(value: Number, side: Number) -> Number:
    """Return |x|, or x or -x for a row held on a side."""
    return np.abs(value) * (side == 0.0) + side * value


def direction(value: Number, side: Number) -> Number:
    """Return the derivative of `magnitude`: the sign of x, or the side of a held row."""
    return np.sign(value) * (side == 0.0) + side


# Steps to a settled state, and what it may miss, part of it.
_SETTLING_STEPS, _SETTLED = 50, 1e-14


@dataclass(frozen=True)
class Law:
    """A law of force: its function, slopes, energy and signals.

    Attributes:
        name: For messages.
        parameters: Names of the numbers that each row has; ``p`` holds them in this order.
        value: (row, p) -> (force, z', *signals).
        slopes: (row, p, signals) -> two tuples: derivatives of the force by l, l', z, z', N, u, phi, and of z' by l,
            l', z, N, u, phi. That by z' is for a force that depends on the rate of the row's own state. Where the law
            heeds ``Row.reading``, the derivative by that is the last of each.
        account: (row, p, force, z', signals) -> (stored energy, *supplied powers, *lost powers), J and W. Force times
            speed is what is supplied less what is lost less the change of what is stored.
        signals: Names of the further numbers that ``value`` returns.
        supplies: Names of the powers that come in.
        losses: Names of the powers that are lost.
        scale: Typical magnitude of the state, for absolute tolerances; None for a law without a state, whose z' is 0.
        kink: Name of the signal by whose sign the force bends so sharply that steps must not cross it unseen, or
            ``speed`` where the rate of the state bends with the sign of that; empty for none. On either side of it,
            value and slopes are smooth and heed ``Row.side``. With ``speed`` the state is bounded as in (9a): sliding
            on one way, z' falls with z, from its rate at z = 0 to zero at the most that z can be. Steps after which a
            state is beyond twice that and has grown are tried again, shorter.
        reads_states: Whether the law heeds ``Row.reading``.
        work: (row, p, signals) -> the integral over l, at rest, of the force that a source supplies, J; None for a law
            whose force is stored or lost.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[..., Any]
    slopes: Callable[..., Any]
    account: Callable[..., Any]
    signals: tuple[str, ...] = ()
    supplies: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    scale: float | None = None
    kink: str = ""
    reads_states: bool = False
    work: Callable[..., Any] | None = None
    arms: ClassVar[int] = 1
    states: ClassVar[int] = 1

    def arguments(self, row: Row) -> Row:
        """Return the arguments of the law for rows, shape (..., k) each: the rows themselves."""
        return row

    def act(self, row: Row, p: Parameters) -> tuple[Array, Array, tuple[Array, ...]]:
        """Return the rows' forces, the rates of their states, and their signals."""
        force, rate, *signals = self.value(row, p)
        return force, rate, tuple(signals)

    def energy_terms(self, row: Row, p: Parameters, force: Array, rate: Array, signals: Numbers) -> Numbers:
        """Return stored energy, J, and powers, W, from the results of `act`."""
        return self.account(row, p, force, rate, signals)

    def settled(self, row: Row, p: Parameters) -> Row:
        """Return rows of a law with a level, as (9), that have slid at their speeds until z' = 0: |z| is the level.

        The level may depend on z, as that of (14) does, piece by piece in proportion: by the secant method.
        """
        level, sign = self.signals.index("level"), np.sign(row.speed)
        state = np.zeros(np.broadcast_shapes(*map(np.shape, row)))
        short, change = np.zeros_like(state), np.zeros_like(state)
        for _ in range(_SETTLING_STEPS):
            was, short = short, sign * self.act(row._replace(state=state), p)[2][level] - state
            if np.all(np.abs(short) <= _SETTLED * np.abs(state)):
                break
            slope = np.divide(short - was, change, out=-np.ones_like(state), where=change != 0.0)
            change = -short / np.where(slope < 0.0, slope, -1.0)
            state = state + change
        return row._replace(state=state)


class Touch(NamedTuple):
    """The arguments of the law of a contact of two bodies: numbers, or arrays that broadcast.

    Attributes:
        gap: Signed distance of the surfaces, m; negative where they penetrate.
        speed: Its rate, m/s.
        slip_1: Speed along the first tangent of the body that is pushed up the normal, against the other, m/s.
        slip_2: Along the second.
        slip_3: How fast it spins about the normal, rad/s; 0 where contacts have no torsional friction.
        state_1: The law's first state.
        state_2: The second.
        state_3: The third, likewise.
        side: On which side of its law's kink the contact is held, as in `Row`.
    """

    gap: Number
    speed: Number
    slip_1: Number
    slip_2: Number
    slip_3: Number
    state_1: Number
    state_2: Number
    state_3: Number
    side: Number = 0.0


@dataclass(frozen=True)
class ContactLaw:
    """The law of a contact, whose row has an arm along the normal and one for every slip, each of these with a state.

    Forces act along the arms: the first drives the gap open, the others drive the slips up. Two slips are those along
    the tangents; the third, where there are four arms, is the spin about the normal, and its force a moment. What
    functions return of a slip that a contact does not have is dropped.

    Attributes:
        name: For messages.
        parameters: Names of the numbers that each contact has; ``p`` holds them in this order.
        value: (touch, p) -> (f_n, f_1, f_2, f_3, z_1', z_2', z_3', *signals).
        slopes: (touch, p, signals) -> seven tuples: derivatives of these by gap, speed, three slips, three states.
        account: (touch, p, (f_n, f_1, f_2, f_3), (z_1', z_2', z_3'), signals) -> (stored energy, *lost powers), J and
            W. The power of the forces is what is neither lost nor stored.
        signals: Names of the further numbers that ``value`` returns.
        losses: Names of the powers that are lost.
        scale: Typical magnitude of the states, for absolute tolerances.
        kink: As in `Law`.
        arms: Number of arms, 3 or 4.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[..., Any]
    slopes: Callable[..., Any]
    account: Callable[..., Any]
    signals: tuple[str, ...]
    losses: tuple[str, ...]
    scale: float
    kink: str = ""
    arms: int = 3
    supplies: ClassVar[tuple[str, ...]] = ()
    reads_states: ClassVar[bool] = False
    work: ClassVar[None] = None

    @property
    def states(self) -> int:
        """The number of states of a contact."""
        return self.arms - 1

    def arguments(self, row: Any) -> Touch:
        """Return the arguments for k contacts from a `Row`: of arms, shape (..., a k), and states, (..., (a - 1) k)."""
        gap, speed = row.length[..., :: self.arms], row.speed[..., :: self.arms]
        return Touch(gap, speed, *_split(row.speed, self.arms, 4)[1:], *_split(row.state, self.states, 3))

    def act(self, touch: Touch, p: Parameters) -> tuple[Array, Array, tuple[Array, ...]]:
        """Return the contacts' forces, shape (..., a k), the rates of their states, (..., (a - 1) k), and signals."""
        values = self.value(touch, p)
        return (_interleave(values[: self.arms]), _interleave(values[4 : 4 + self.states]), tuple(values[7:]))

    def energy_terms(self, touch: Touch, p: Parameters, force: Array, rate: Array, signals: Numbers) -> Numbers:
        """Return stored energy, J, and powers, W, from the results of `act`."""
        return self.account(touch, p, _split(force, self.arms, 4), _split(rate, self.states, 3), signals)


def _split(values: Array, count: int, size: int) -> list[Array]:
    """Return the numbers of each arm or state of contacts, zero for those that they do not have."""
    parts = [values[..., each::count] for each in range(count)]
    return parts + [np.zeros_like(parts[0])] * (size - count)


def _interleave(parts: Sequence[Number]) -> Array:
    stacked = np.stack(np.broadcast_arrays(*parts), axis=-1)
    return stacked.reshape(*stacked.shape[:-2], -1)
