"""Self-locking: the joint friction at which the tensions that overcome it are what makes it insuperable.

The loop. A joint that moves needs a torque against its friction, M_j R_j. The controller (21), (22) supplies it by
tensions, which it raises until every tendon pulls. The tensions load the joints, (17), and the load makes the friction.
Slowly moving, with tensions so large that f0, f_5^d, weight and fingertip force no longer count, all of this is
linear but for the maximum in (22) and for slack passive tendons; it is positively homogeneous:

    f_hat = P tau + k max_i(-P_i tau / k_i),     P = pinv(H_c^T), k = f^k                    (21), (22)
    f^a_i -> f_i = f^a_i (1 - sigma_i mu_i) / (1 + sigma_i mu_i),   mu_i = mu_i^d(theta)      (14), (16)
    f5_3, f5_4 = (1 +- sigma_5 mu_5) m,          m the mean tension of a passive tendon      (13), (14)
    H_c2^T f = M s R,   R = loads f                                                          (17), (18)

with sigma the directions of the tendons, s those of the joints, and M_j = kappa w_j. The ratio in the second line is
exp(-sigma mu_e phi), the capstan law. Within a cell, in which one tendon i attains the maximum of (22) and each passive
tendon is either taut or slack, f = V tau, so that the balance is an eigenvalue problem,

    H_c2^T V tau = kappa diag(w s) loads V tau,

and an eigenvector counts if it lies in its cell. The critical scale is the least positive kappa over all cells. Below
it the loop has a solution whatever the offset (f0, weight, fingertip force): a continuous, positively homogeneous map
without a zero but the origin keeps its degree, and without friction this one is the identity in tau. At kappa_crit the
solution runs off to infinity along the eigenvector. f0, weight and fingertip force do not shift the critical scale;
they set how large tensions are on this side of it. The posture enters through the curvature of the tendons only.

With the passive tension as planned the same has a plain meaning: the tensions f >= 0 that balance friction,
(H_c2^T D - kappa diag(w s) loads D) f = 0, fill the kernel of a matrix, at kappa = 0 with a positive vector, force
closure. Critical is where an entry of it reaches zero: friction undoes force closure. With one tendon more than
joints no other distribution of tensions locks later.

What a passive tendon carries, m, is settled in one of two ways. *Planned*: what the controller plans, m = f_hat_5.
*Elastic*: what its stretch makes it, m = max(0, -K_t H_c theta), in a finger that lags behind a reference which
satisfies (20) by theta^d - theta = tau / K_P, so that m = max(0, K_t H_c tau / K_P).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from finger_pin.blocks.reference import PassiveCoupling
from finger_pin.blocks.tendons import Tendons, capstan_coefficient
from finger_pin.exceptions import InputError
from finger_pin.finger import Finger
from finger_pin.parameters import FingerDescription
from finger_pin.routing import Array
from finger_pin.scenario import Scenario
from finger_pin.validation import expand

_REAL = 1e-9
_INSIDE = 1e-9
_SETTLED = 1e-10
_RUNAWAY = 1e6
_ITERATIONS = 5000


@dataclass(frozen=True, eq=False)
class CriticalFriction:
    """The least joint friction at which a finger locks, over the directions that were asked about.

    Attributes:
        coefficient: M_crit, m: friction coefficient times pin radius, alike at all joints that move; infinite where
            no friction locks the finger.
        joints: Names of the joints that move.
        directions: Direction of every joint in the worst case, -1, 0 (at rest) or 1, shape (n,).
        torque: Demand tau^d that runs away, shape (n,), N m, largest entry 1; zero where nothing locks.
        tension: Command f_hat that runs away with it, shape (t,), N.
    """

    coefficient: float
    joints: tuple[str, ...]
    directions: Array
    torque: Array
    tension: Array


@dataclass(frozen=True, eq=False)
class SelfLockingMap:
    """Critical coefficients over two joint angles.

    Attributes:
        joints: Names of the two joints.
        first: Angles of the first one, shape (a,), rad.
        second: Angles of the second one, shape (b,), rad.
        coefficient: M_crit, shape (a, b), m. It varies only where the friction of a passive tendon does, so for
            passive tendons whose canals no joint bends it is the same everywhere.
        tension: Largest tension that the controller commands while the finger moves slowly, under its own friction
            and weight, in the direction that needs most, shape (a, b), N; infinite where it locks.
        tip: Fingertip position, shape (a, b, 3), m, base frame.
        actual: The finger's largest stiction coefficient M^c, m.
    """

    joints: tuple[str, str]
    first: Array
    second: Array
    coefficient: Array
    tension: Array
    tip: Array
    actual: float


@dataclass(frozen=True, eq=False)
class SelfLockingMargin:
    """How far a scenario stays from self-locking.

    Attributes:
        margin: Factor by which every M^c could be raised until the finger locks somewhere on its reference; infinite
            where nothing moves or nothing locks.
        time: Where the margin is least, s.
        position: theta^d there, shape (n,), rad.
        directions: Directions of the joints there, shape (n,).
    """

    margin: float
    time: float
    position: Array
    directions: Array


@dataclass(frozen=True, eq=False)
class _Loop:
    """The loop of a finger in matrices; cells first, then what a cell's f = V tau needs.

    Attributes:
        command: f_hat = command[i] @ tau where tendon i attains the maximum of (22), shape (t, t, n).
        levels: -P_i / k_i, shape (t, n); the maximum of (22) is that of levels @ tau.
        passive: Mean tension of the passive tendons over tau when taut, shape (t, p, n).
        tendons: The tendon layer.
    """

    command: Array
    levels: Array
    passive: Array
    tendons: Tendons

    @classmethod
    def of(cls, tendons: Tendons, gain: Array | None) -> _Loop:
        routing = tendons.routing
        closure = routing.force_closure()
        if not closure.holds:
            raise InputError("finger.tendons", f"{closure}; self-locking is a matter of fingers that can be taut")
        inverse = np.linalg.pinv(routing.coupling.T)
        levels = -inverse / closure.tension[:, None]
        command = inverse + closure.tension[None, :, None] * levels[:, None, :]
        if gain is None:
            passive = command[:, routing.actuated :]
        else:
            elastic = 0.5 * tendons.half_stiffness[:, None] * routing.coupling[routing.actuated :] / gain
            passive = np.broadcast_to(elastic, (len(levels), *elastic.shape))
        return cls(command, levels, passive, tendons)

    def critical(self, position: Array, weights: Array, sliding: Array) -> tuple[Array, Array, Array]:
        """Return kappa_crit and its eigenvectors for m cases at once.

        Args:
            position: theta, shape (m, n), rad.
            weights: s w, signed friction coefficients of the joints, shape (m, n), m; 0 for a joint at rest.
            sliding: sigma, shape (m, t), -1, 0 or 1; 0 leaves out the tendon's friction.

        Returns:
            kappa, shape (m,); tau, shape (m, n); and f_hat, shape (m, t).
        """
        routing, size, actuated = self.tendons.routing, len(position), self.tendons.routing.actuated
        scale = self._shares(position, sliding)
        worst, torque = np.full(size, np.inf), np.zeros((size, routing.coupling.shape[1]))
        command = np.zeros((size, len(self.levels)))
        for taut in product((True, False), repeat=routing.passive):
            halves = np.repeat(self.passive * np.array(taut, dtype=float)[:, None], 2, axis=1)
            strands = np.concatenate([self.command[:, :actuated], halves], axis=1)
            delivered = scale[:, None, :, None] * strands
            balance = routing.strand_coupling.T @ delivered
            friction_torque = weights[:, None, :, None] * (routing.loads @ delivered)
            regular = np.abs(np.linalg.det(balance)) > 1e-12 * np.linalg.norm(balance, axis=(2, 3)) ** len(torque[0])
            balance = np.where(regular[..., None, None], balance, np.eye(len(torque[0])))
            values, vectors = np.linalg.eig(np.linalg.solve(balance, friction_torque))
            real = regular[..., None] & (values.real > 0.0) & (np.abs(values.imag) <= _REAL * np.abs(values))
            for sign in (1.0, -1.0):
                # Rows: case, cell, eigenvector; then the joint.
                rays = sign * np.swapaxes(vectors.real, 2, 3)
                levels = rays @ self.levels.T
                attained = np.diagonal(levels, axis1=1, axis2=3).swapaxes(1, 2)
                span = np.max(np.abs(levels), axis=-1)
                inside = real & (attained >= levels.max(axis=-1) - _INSIDE * span)
                for index, is_taut in enumerate(taut):
                    mean = np.einsum("cj,mcej->mce", self.passive[:, index], rays)
                    slack = _INSIDE * np.max(np.abs(self.passive[:, index]))
                    inside &= (mean >= -slack) if is_taut else (mean <= slack)
                found = np.where(inside, 1.0 / np.where(real, values.real, 1.0), np.inf).reshape(size, -1)
                best = np.argmin(found, axis=1)
                case = np.arange(size)
                better = found[case, best] < worst
                worst[better] = found[case, best][better]
                cell = best // rays.shape[2]
                ray = rays.reshape(size, -1, rays.shape[3])[case, best]
                ray = ray / np.max(np.abs(ray), axis=1, keepdims=True)
                torque[better] = ray[better]
                command[better] = np.einsum("mtj,mj->mt", self.command[cell], ray)[better]
        return worst, torque, command

    def command_to_move(self, position: Array, weights: Array, sliding: Array, minimum: Array, weight: Array) -> Array:
        """Return f_hat, shape (m, t), N, in slow motion with passive tendons as planned; infinite where it locks.

        The balance H_c2^T f = M s R + G in the demand tau differs from tau itself by friction alone, so tau is
        corrected by its residual until that vanishes, which it does as fast as powers of the loop's gain.

        Args:
            position: theta, shape (m, n), rad.
            weights: s M, signed friction coefficients of the joints, shape (m, n), m.
            sliding: sigma, shape (m, t).
            minimum: f0, shape (t,), N.
            weight: G, shape (m, n), N m.
        """
        routing, scale = self.tendons.routing, self._shares(position, sliding)
        inverse, internal = np.linalg.pinv(routing.coupling.T), routing.force_closure().tension
        torque, command = np.array(weight), np.full((len(position), len(internal)), np.inf)
        going = np.arange(len(position))
        for _ in range(_ITERATIONS):
            minimal = torque[going] @ inverse.T
            level = np.max((minimum - minimal) / internal, axis=1, keepdims=True)
            tension = minimal + level * internal
            halves = np.repeat(tension[:, routing.actuated :], 2, axis=1)
            strands = scale[going] * np.concatenate([tension[:, : routing.actuated], halves], axis=1)
            residual = strands @ routing.strand_coupling - weights[going] * (strands @ routing.loads.T)
            residual -= weight[going]
            span = np.max(np.abs(tension), axis=1)
            arm = np.max(np.abs(routing.strand_coupling))
            done = np.max(np.abs(residual), axis=1) <= _SETTLED * arm * span
            command[going[done]] = tension[done]
            keep = ~done & (span < _RUNAWAY * (1.0 + np.max(minimum)))
            torque[going] -= residual
            going = going[keep]
            if not going.size:
                break
        return command

    def _shares(self, position: Array, sliding: Array) -> Array:
        """Return the tension of every strand over the command or the mean tension of its tendon, shape (m, s)."""
        routing, actuated = self.tendons.routing, self.tendons.routing.actuated
        curvature = np.abs(position) @ routing.curvature_matrix.T + routing.curvature_offset
        friction = sliding * capstan_coefficient(self.tendons.surface, curvature)
        share = (1.0 - friction[:, :actuated]) / (1.0 + friction[:, :actuated])
        pairs = np.stack([1.0 + friction[:, actuated:], 1.0 - friction[:, actuated:]], axis=-1)
        return np.concatenate([share, pairs.reshape(len(position), -1)], axis=1)


def critical_friction(
    finger: Finger | FingerDescription,
    position: Sequence[float] | Array | None = None,
    *,
    joints: Sequence[str] | None = None,
    velocity: Sequence[float] | Array | None = None,
    gain: float | tuple[float, ...] | None = None,
) -> CriticalFriction:
    """Return the joint friction at which a finger locks.

    Args:
        finger: A finger, or the description of one, with force closure.
        position: theta, shape (n,), rad; it matters to the friction of the tendons, which is left out without it.
        joints: The joints that move; all by default. The others count as free of friction.
        velocity: theta', shape (n,), whose signs and ratios say which way joints and tendons move; joints not in
            ``joints`` count as at rest. By default the worst of all directions in which all ``joints`` move.
        gain: K_P, N m/rad. With it passive tendons are elastic, and the finger lags behind its reference by
            tau / K_P; by default they carry what the controller plans.

    Raises:
        InputError: If an argument has the wrong size, a joint does not exist, or there is no force closure.
    """
    tendons = _tendons(finger)
    routing = tendons.routing
    moving = _moving(routing.joints, joints)
    size = len(moving)
    if velocity is None and position is None:
        signs = np.array(
            [sign for sign in product((-1.0, 0.0, 1.0), repeat=size) if ((np.array(sign) != 0) == moving).all()]
        )
        sliding = np.zeros((len(signs), len(routing.tendons)))
    elif velocity is None:
        signs, sliding = _directions(tendons, moving)
    else:
        given = np.where(moving, _vector("velocity", velocity, size), 0.0)
        signs, sliding = np.sign(given)[None], np.sign(_sliding(tendons, given))[None]
    if position is None:
        theta, sliding = np.zeros(size), np.zeros_like(sliding)
    else:
        theta = _vector("position", position, size)
    stiffness = None if gain is None else _vector("gain", expand(gain, size), size)
    cases = np.broadcast_to(theta, (len(signs), size))
    kappa, torque, command = _Loop.of(tendons, stiffness).critical(cases, signs, sliding)
    worst = int(np.argmin(kappa))
    return CriticalFriction(
        coefficient=float(kappa[worst]),
        joints=tuple(name for name, moves in zip(routing.joints, moving, strict=True) if moves),
        directions=signs[worst],
        torque=torque[worst],
        tension=command[worst],
    )


def self_locking_map(
    finger: Finger,
    joints: tuple[str, str] | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    minimum_tension: float | tuple[float, ...] = 1.0,
    samples: int = 21,
) -> SelfLockingMap:
    """Return the critical coefficient over the ranges of two joints, all joints moving in their worst directions.

    Joints that passive tendons drive follow the others as inextensible tendons demand, (4).

    Args:
        finger: A finger with force closure.
        joints: Names of the two joints; by default the last two that no passive tendon drives.
        fixed: Angles of the others, rad; the angle of their range nearest to zero by default.
        minimum_tension: f0, N, one number or one per tendon, for the tensions of the map.
        samples: Angles along either axis.

    Raises:
        InputError: If a joint does not exist or is driven by a passive tendon, or there is no force closure.
    """
    routing, limiter = finger.routing, finger.stroke_limiter
    coupling = PassiveCoupling.from_routing(routing, np.zeros(routing.passive), np.ones(routing.passive))
    free = [name for index, name in enumerate(routing.joints) if index not in coupling.followers]
    first, second = joints or (free[0], free[-1]) if len(free) < 3 else joints or (free[-2], free[-1])
    for name in (first, second, *(fixed or {})):
        if name not in free:
            raise InputError("joints", f"must be among {', '.join(free)}", name)
    base = np.clip(np.zeros(len(routing.joints)), limiter.lower, limiter.upper)
    for name, angle in (fixed or {}).items():
        base[routing.joints.index(name)] = angle
    columns = [routing.joints.index(name) for name in (first, second)]
    axes = [np.linspace(limiter.lower[j], limiter.upper[j], samples) for j in columns]
    postures = np.tile(base, (samples, samples, 1))
    postures[..., columns[0]], postures[..., columns[1]] = np.meshgrid(*axes, indexing="ij")
    postures = postures @ coupling.matrix.T
    flat = postures.reshape(-1, len(base))
    signs, sliding = _directions(finger.tendons, np.ones(len(base), dtype=bool))
    weight = np.array([finger.rigid_body.gravity_torque(theta) for theta in flat])
    minimum = expand(minimum_tension, len(routing.tendons))
    loop, static = _Loop.of(finger.tendons, None), finger.joint_friction.static
    coefficient, tension = np.full(len(flat), np.inf), np.zeros(len(flat))
    # The friction of actuated tendons scales columns of the balance in f, and leaves where f_i = 0 as it was.
    passive = np.where(np.arange(len(routing.tendons)) < routing.actuated, 0.0, sliding)
    locking = np.unique(np.hstack([signs, passive]), axis=0)
    curved = np.abs(flat) @ routing.curvature_matrix[routing.actuated :].T
    _, first_of, same = np.unique(curved.round(12), axis=0, return_index=True, return_inverse=True)
    for case in locking:
        sign = np.broadcast_to(case[: len(base)], flat.shape)
        slide = np.broadcast_to(case[len(base) :], (len(flat), len(routing.tendons)))
        kappa = loop.critical(flat[first_of], sign[first_of], slide[first_of])[0]
        coefficient = np.minimum(coefficient, kappa[same.reshape(-1)])
    for sign, slide in zip(signs, sliding, strict=True):
        cases = np.broadcast_to(slide, (len(flat), len(slide)))
        command = loop.command_to_move(flat, np.broadcast_to(sign * static, flat.shape), cases, minimum, weight)
        tension = np.maximum(tension, command[:, : routing.actuated].max(axis=1))
    tips = [finger.rigid_body.tip_position(theta) for theta in flat]
    return SelfLockingMap(
        joints=(first, second),
        first=axes[0],
        second=axes[1],
        coefficient=coefficient.reshape(samples, samples),
        tension=tension.reshape(samples, samples),
        tip=np.array(tips).reshape(samples, samples, 3),
        actual=float(np.max(static)),
    )


def self_locking_margin(scenario: Scenario, samples: int = 500) -> SelfLockingMargin:
    """Return how far a scenario stays from self-locking on its reference.

    The stiction coefficients M^c are scaled in proportion, joints and tendons move as the reference does, tendons rub
    with mu^d at its postures and passive tendons are elastic under the controller's gain. Every combination of
    directions that occurs is looked at where the tendons that go with it are bent least and where they are bent most.
    Against joints that keep sliding, whose friction is M^d, the margin is the larger by M^c / M^d.

    Args:
        scenario: The scenario.
        samples: Instants of the reference; directions that last for less than their distance may be missed.
    """
    tendons = Tendons.from_description(scenario.finger)
    routing = tendons.routing
    # Midpoints: a reference that starts or ends at rest moves there.
    times = scenario.simulation.duration * (np.arange(samples) + 0.5) / samples
    motion = scenario.build_reference(routing).at(times)
    size = len(routing.joints)
    # What stands still but for rounding does not move.
    speed = np.where(np.abs(motion.velocity) > 1e-12, motion.velocity, 0.0)
    directions = np.sign(np.hstack([speed, _sliding(tendons, speed)]))
    bend = (np.abs(motion.position) @ routing.curvature_matrix.T).sum(axis=1)
    # Ordered by directions, then by bend: the first and the last of every combination.
    order = np.lexsort((bend, *directions.T))
    steps = np.flatnonzero(np.any(np.diff(directions[order], axis=0) != 0.0, axis=1))
    chosen = order[np.unique(np.concatenate([[0], steps, steps + 1, [samples - 1]]))]
    signs, sliding = directions[chosen, :size], directions[chosen, size:]
    weights = signs * expand(scenario.finger.joint_friction.stiction, size)
    loop = _Loop.of(tendons, expand(scenario.controller.gain, size))
    kappa = loop.critical(motion.position[chosen], weights, sliding)[0]
    worst = int(np.argmin(kappa))
    where = chosen[worst]
    return SelfLockingMargin(float(kappa[worst]), float(times[where]), motion.position[where], signs[worst])


def _tendons(finger: Finger | FingerDescription) -> Tendons:
    return finger.tendons if isinstance(finger, Finger) else Tendons.from_description(finger)


def _moving(names: tuple[str, ...], joints: Sequence[str] | None) -> NDArray[np.bool_]:
    for name in joints or ():
        if name not in names:
            raise InputError("joints", f"must be among {', '.join(names)}", name)
    return np.array([joints is None or name in joints for name in names])


def _vector(name: str, value: Sequence[float] | Array, size: int) -> Array:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (size,) or not np.isfinite(vector).all():
        raise InputError(name, f"must be {size} finite numbers", vector.tolist())
    return vector


def _sliding(tendons: Tendons, velocity: Array) -> Array:
    """Return the velocities of all tendons, shape (..., t), that go with theta', shape (..., n)."""
    return np.concatenate([velocity @ tendons.routing.actuated_coupling.T, tendons.rest_position(velocity)], axis=-1)


def _directions(tendons: Tendons, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return every way in which the given joints can move: signs of joints, shape (m, n), and tendons, shape (m, t)."""
    columns = _sliding(tendons, np.eye(len(moving))).T
    signs, sliding = [], []
    for chosen in product((1.0, -1.0), repeat=int(moving.sum())):
        sign = np.zeros(len(moving))
        sign[moving] = chosen
        turns = columns * sign
        options = [
            [side for side, any_such in ((1.0, (row > 0.0).any()), (-1.0, (row < 0.0).any())) if any_such] or [0.0]
            for row in turns
        ]
        unsure = np.array([len(option) > 1 for option in options])
        for slide in product(*options):
            # Speeds x >= 1 exist at which the tendons whose direction the joints leave open slide these ways.
            rows = -(np.array(slide)[:, None] * turns)[unsure]
            bounds = [(1.0, None) if moves else (0.0, 0.0) for moves in moving]
            if unsure.any():
                # Any positive slack will do, since the speeds may be scaled.
                lengths = np.abs(rows).sum(axis=1)
                found = scipy.optimize.linprog(np.ones(len(moving)), rows, -lengths * 1e-6, bounds=bounds)
                if found.status != 0:
                    continue
            signs.append(sign)
            sliding.append(slide)
    return np.array(signs), np.array(sliding)
