"""Equilibria of a finger under given tensions, and what leaves these and other questions of statics open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.validation import finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, as_inputs, description_of
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.groups import ACTUATORS, SOURCES_WITH_END, WINCHES
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.typing import Array

# Change of an angle for differences, rad.
_ANGLE_SHIFT = 1e-7
# The longest step of the descent, in the joints' and masses' scales: none leads over a ridge into another valley.
_LONGEST_STEP = 0.2
# Slope, part of the first, and number of steps at which the descent ends; a few Newton steps follow.
_SLOPE_TOLERANCE, _MAX_STEPS = 1e-7, 500
# Stiffness to the start, N m, without which the descent would wander where a finger may rest anywhere.
_TETHER = 1e-6
# Largest acceleration at rest, in scales of joints and masses per square second.
_REST_ACCELERATION = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(BriefRepr):
    """Stable posture of a finger at rest.

    Attributes:
        position: theta, shape (n,), rad.
        passive_position: p_5 of the passive tendons, shape (p,), m.
        torque: Of the tendons, shape (n,), N m; what weight, limiters, springs and the fingertip hold up.
        state: The packed state, to start a simulation or a loop from (``initial``, ``Simulator(..., state)``).
    """

    position: Array
    passive_position: Array
    torque: Array
    state: Array


def equilibrium(
    finger: FingerLike,
    inputs: Mapping[str, float] | Sequence[float] | Array,
    *,
    position: Sequence[float] | Array | None = None,
    fingertip_force: Sequence[float] | Array | None = None,
    friction: Array | None = None,
) -> Equilibrium:
    """Return the equilibrium under given inputs, frictionless by default.

    With friction there are many states at rest around it; this is the one in which no bristle is bent: tau = G, and
    the state's derivative is zero with friction and without. It lies where the potential energy falls to from a
    posture, in short steps of Newton's method, so that it is stable.

    Args:
        finger: One finger with ideal sources of tension or winches, or a tree, whose actuators may have a lag.
        inputs: Tensions f^a, N, or of winches what is wound in, m, then inputs of a tree's actuators, shape (u,), or by
            name.
        position: theta to begin at, shape (n,), rad; by default the angles of the ranges nearest to zero.
        fingertip_force: F, shape (3,), of several tips (t, 3), N, base frame; none by default.
        friction: What bristles hold in every posture, N and N m, shape (z,), the last numbers of the packed state.

    Raises:
        InputError: If a size is wrong, a tension is negative, the finger has servos, free objects, rows with states of
            their own or actuators that integrate, or it comes to no rest.
    """
    finger = as_finger(finger)
    for _, entry, allowed in unsettled("posture", finger):
        raise InputError(entry, allowed)
    command = as_inputs(finger, inputs)
    if np.any(command[: finger.routing.actuated][~finger.routing.winched] < 0.0):
        raise InputError("inputs", "a tension must not be negative", command.tolist())
    tips = finger.description.tree.tip_names
    shape = (len(tips), 3) if tips else (3,)
    force = np.zeros(shape) if fingertip_force is None else np.asarray(fingertip_force, dtype=float)
    if force.shape != shape:
        row_names = f", a row each for {', '.join(tips)}" if tips else ""
        raise InputError("fingertip_force", f"must have shape {shape}{row_names}", force.shape)
    tip_force = np.reshape(finite_vector("fingertip_force", force.ravel(), force.size), shape)
    joints = len(finger.routing.joints)
    limiter = finger.stroke_limiter
    start = (
        np.clip(0.0, limiter.lower, limiter.upper)
        if position is None
        else np.array(finite_vector("position", position, joints))
    )
    problem = _Statics.from_posture(finger, command, tip_force, start, friction)
    y = problem.start
    initial_acceleration = float(np.max(np.abs(problem.acceleration(y))))
    if initial_acceleration >= _REST_ACCELERATION:
        y = _descend(problem.energy, problem.slope, problem.acceleration, y)
    if not float(np.max(np.abs(problem.acceleration(y)))) < max(_REST_ACCELERATION, 1e-9 * initial_acceleration):
        raise InputError("inputs", "the finger comes to no rest under it", command.tolist())
    coordinates, x = problem.scale * y, problem.packed(y)
    torque = finger.evaluate(x, command, tip_force)["joint_torque"]
    return Equilibrium(coordinates[:joints], coordinates[joints:], np.asarray(torque), x)


@dataclass(frozen=True, eq=False)
class _Statics:
    """Energy and acceleration of a finger at rest under constant inputs, over places y in parts of their scales.

    Attributes:
        finger: The finger.
        command: Its inputs, shape (u,).
        tip_force: F, shape (3,), N.
        rest: The packed state at the start, with actuators that have settled.
        scale: Of joints and passive tendons, shape (k,), rad and m.
        on_paths: Which of the joints are moved along paths, shape (n,): they stay where they are.
    """

    finger: Finger
    command: Array
    tip_force: Array
    rest: Array
    scale: Array
    on_paths: NDArray[np.bool_]

    @classmethod
    def from_posture(
        cls, finger: Finger, command: Array, tip_force: Array, position: Array, friction: Array | None
    ) -> _Statics:
        """Return the problem that starts at a posture, shape (n,), with what bristles hold."""
        rest, passive = finger.rest_state(position), finger.routing.passive
        if friction is not None:
            finger.mechanism.split(rest)[2][:] = friction
        actuator_state = finger.layout.unpack(rest).actuator_state
        for table in finger.mechanism.rows:
            if table.group in ACTUATORS and table.states:
                # Lags have settled; the input's limits are those of an activation as well.
                settled = np.clip(command[table.channels], table["lowest"], table["highest"])
                if "least_state" in table.law.parameters:
                    settled = np.clip(settled, table["least_state"], table["most_state"])
                actuator_state[: table.count] = settled
                actuator_state = actuator_state[table.count :]
        scale = np.concatenate([np.ones(len(position)), np.full(passive, 1e-3)])
        return cls(finger, command, tip_force, rest, scale, finger.led_joints)

    @property
    def start(self) -> Array:
        """The places at the start, shape (k,)."""
        state = self.finger.layout.unpack(self.rest)
        return np.asarray(np.concatenate([state.position, state.passive_position]) / self.scale)

    def packed(self, y: Array) -> Array:
        """Return the packed state at rest in a posture."""
        x, joints, coordinates = self.rest.copy(), len(self.finger.routing.joints), self.scale * y
        state = self.finger.layout.unpack(x)
        state.position[~self.on_paths] = coordinates[:joints][~self.on_paths]
        state.passive_position[:] = coordinates[joints:]
        return x

    def energy(self, y: Array) -> float:
        """Return the stored energy less the work of inputs and force, J."""
        finger, joints, x = self.finger, len(self.finger.routing.joints), self.packed(y)
        theta, signals = finger.layout.unpack(x).position, finger.evaluate(x, self.command, self.tip_force)
        stored, _ = signals.mechanism.account()
        potential_energy = finger.motion(theta, np.zeros(joints)).potential_energy
        driven = signals.rows["driven_tendons"]
        work = ((1.0 - driven.rows["acting"]) * driven.row.command) @ finger.excursion(theta)
        work -= _held_by_friction(signals)
        work += float(np.sum(self.tip_force * finger.rigid_body.tip_position(theta))) + _actuator_work(signals)
        return float(sum(stored.values()) + potential_energy - work)

    def acceleration(self, y: Array) -> Array:
        """Return the acceleration from rest there, shape (k,)."""
        rates = self.finger.layout.unpack(self.finger.rhs(0.0, self.packed(y), self.command, self.tip_force))
        return np.asarray(np.concatenate([rates.velocity, rates.passive_velocity]) / self.scale)

    def slope(self, y: Array) -> Array:
        """Return the derivative of the energy, shape (k,), with the digits that light joints need."""
        body, scale = self.finger.rigid_body, self.scale
        inertia = scipy.linalg.block_diag(
            body.mass_matrix((scale * y)[: len(self.finger.routing.joints)]), np.diag(self.finger.tendons.mass)
        )
        return np.asarray(-scale * (inertia @ (scale * self.acceleration(y))))


_IDEAL = "must be one finger with ideal sources of tension, without free objects"
_SHEATH = "must be 0 for postures at rest: where a cord rests in its sheath depends on how it came there"
_NO_ENERGY = 'must be a force with axes = "other", the slope of an energy, which falls to a rest'
_ANGLE = "must be left out but for readings in motion: it tells no current at rest, where it depends on the angle"
_OUT, _PULL = "must be left out", "must be left out: its pull is not known"
_SOURCES = {SOURCES_WITH_END, WINCHES}
# What leaves questions of statics open: these, a table of the description and an entry there, whether one has it, and
# what is allowed. Without a table it is the finger that has it: the names of those that there are.
_UNSETTLED: tuple[tuple[str, str, str, Callable[[Any], Any], str], ...] = (
    ("posture", "tendons", "winch.pieces", lambda t: t.winch and t.winch.pieces, _SHEATH),
    ("posture", "", "several fingers", lambda f: f.description.hand and f.description.hand.fingers, _IDEAL),
    ("posture", "", "actuators", lambda f: f.description.actuators, _IDEAL),
    ("posture", "", "drives of its own", lambda f: {r.group for r in f.mechanism.rows if r.pulls} - _SOURCES, _IDEAL),
    ("posture", "", "free objects", lambda f: f.scene and f.scene.free, _IDEAL),
    ("posture", "", "rows with states", lambda f: [r.group for r in f.constructor_args.rows if r.states], _IDEAL),
    ("posture", "tree.actuators", "", lambda a: a.integrates or a.integral, "integrates: rests at no input of its own"),
    ("posture", "tree.actuators", "wrench", lambda a: not a.has_length, _NO_ENERGY),
    ("current goal tension", "actuators", "motor.cogging", lambda a: a.motor.cogging, _ANGLE),
    ("tension", "actuators", "drive", lambda a: a.drive == "position", 'must be "tension"'),
    ("goal", "actuators", "drive", lambda a: a.drive == "tension", 'must be "position"'),
    ("goal", "actuators", "tendons", lambda a: len(a.tendons) > 1, "must be one cord"),
    ("goal", "actuators", "tendon_pieces", lambda a: np.any(a.tendon_pieces), "must be 0"),
    ("goal", "actuators", "motor.friction.backlash", lambda a: a.motor.friction.backlash, "must be 0"),
    ("goal", "actuators", "position_loop.torque_off", lambda a: a.position_loop.torque_off is not None, _OUT),
    ("return", "tree.couplings", "", bool, _PULL),
    ("return", "couplings", "", bool, _PULL),
    ("return", "tree.loops", "", bool, _PULL),
    ("return", "tree.actuators", "", lambda a: a.muscle or a.offset or a.by_length, _PULL),
)


def unsettled(question: str, finger: FingerLike) -> Iterator[tuple[str, str, str]]:
    """Yield what of a finger leaves a question of statics open: its name in its table, the entry, what is allowed.

    Args:
        question: Where the finger rests (``posture``), where a motor rests that is given its ``goal`` or a ``tension``,
            the ``current`` of motors at rest, or whether springs ``return`` joints.
        finger: A finger, or its description, which will do for all but postures.
    """
    description = description_of(finger)
    for questions, table, entry, has, allowed in _UNSETTLED:
        if question in questions.split():
            for name, part in attrgetter(table)(description).items() if table else ():
                if has(part):
                    yield name, ".".join(filter(None, (description.entry(table, name), entry))), allowed
            if not table and (names := has(finger)):
                yield "", "finger", f"{allowed}; it has {entry} ({', '.join(sorted(names))})"


def _held_by_friction(signals: FingerSignals) -> float:
    """Return the work of tendons' lengths against what the bristles of their canals hold, J."""
    tables = (signals.rows[group] for group in ("driven_tendons", *signals.finger.wraps))
    return float(sum(rows["friction"] @ rows.row.length for rows in tables))


def _actuator_work(signals: FingerSignals) -> float:
    """Return the work of actuators, winches and sources that are rows along their lengths, J."""
    return sum(
        float(np.sum(table.rows.law.work(table.row, table.rows.parameters, table.signals)))
        for table in signals.mechanism.rows.values()
        if table.rows.law.work is not None
    )


def _descend(
    energy: Callable[[Array], float],
    slope: Callable[[Array], Array],
    acceleration: Callable[[Array], Array],
    start: Array,
) -> Array:
    """Return the place at rest, shape (k,), to which an energy falls from a start.

    Args:
        energy: At a place.
        slope: Its derivative, shape (k,).
        acceleration: Zero where that is, with the digits that the slopes of heavy joints take from those of light ones.
        start: Shape (k,).
    """

    def jacobian(function: Callable[[Array], Array], y: Array) -> Array:
        # Angles on limiters are tiny: steps that are parts of them would be lost in rounding.
        shifts = _ANGLE_SHIFT * np.eye(len(y))
        return np.transpose([function(y + each) - function(y - each) for each in shifts]) / (2.0 * _ANGLE_SHIFT)

    def curvature(y: Array) -> Array:
        hessian = jacobian(slope, y)
        return 0.5 * (hessian + hessian.T) + _TETHER * np.eye(len(y))

    gradient_tolerance = _SLOPE_TOLERANCE * float(np.max(np.abs(slope(start))))
    radii = {"initial_trust_radius": 0.5 * _LONGEST_STEP, "max_trust_radius": _LONGEST_STEP}
    options = {**radii, "gtol": gradient_tolerance, "maxiter": _MAX_STEPS}
    descended = scipy.optimize.minimize(
        lambda y: energy(y) + 0.5 * _TETHER * float(np.sum((y - start) ** 2)),
        start,
        method="trust-exact",
        jac=lambda y: slope(y) + _TETHER * (y - start),
        hess=curvature,
        options=options,
    ).x
    # Damped, so that it stays where the finger may rest anywhere.
    polished = scipy.optimize.least_squares(
        acceleration, descended, lambda y: jacobian(acceleration, y), method="lm", xtol=1e-15
    ).x
    return min((descended, polished), key=lambda y: float(np.max(np.abs(acceleration(y)))))
