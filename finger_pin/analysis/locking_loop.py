"""Self-locking: the joint friction that grows as fast as the tensions that are to overcome it.

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
they set how large tensions are on this side of it. So does a drag d of the tendons, which no load makes: it takes
sigma_i d / (1 + sigma_i mu_i) of f_i, and sigma_5 d of the difference of a passive tendon's halves; that of a joint
adds to the weight. The posture enters through the curvature of the tendons only.

With the passive tension as planned the same has a plain meaning: the tensions f >= 0 that balance friction,
(H_c2^T D - kappa diag(w s) loads D) f = 0, fill the kernel of a matrix, at kappa = 0 with a positive vector, force
closure. Critical is where an entry of it reaches zero: friction undoes force closure. With one tendon more than
joints no other distribution of tensions locks later.

What a passive tendon carries, m, is settled in one of two ways. *Planned*: what the controller plans, m = f_hat_5.
*Elastic*: what its stretch makes it, m = max(0, -K_t H_c theta), in a finger that lags behind a reference which
satisfies (20) by theta^d - theta = tau / K_P, so that m = max(0, K_t H_c tau / K_P).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# Imaginary part, over the magnitude, within which an eigenvalue is real.
_IMAGINARY_TOLERANCE = 1e-9
_LEAST_DETERMINANT = 1e-12
# Relative tolerance of the inequalities that bound a cell.
_CELL_TOLERANCE = 1e-9
_BALANCE_TOLERANCE = 1e-10
# Tension at which the loop has run away, N, times 1 + f0 / N.
_RUNAWAY_TENSION = 1e6
_MAX_ITERATIONS = 5000
_GROWTH_TURNS = 12


@dataclass(frozen=True, eq=False)
class FrictionLoop:
    """The matrices of a finger's friction loop, from torques to tensions and back.

    Attributes:
        command: f_hat = command[i] @ tau where tendon i attains the maximum of (22), shape (t, t, n).
        levels: -P_i / k_i, shape (t, n); the maximum of (22) is that of levels @ tau.
        passive: Mean tension of the passive tendons over tau when taut, shape (t, p, n).
        inverse: P, shape (t, n), 1/m.
        internal: k, shape (t,).
        tendons: The tendon layer.
        gears: Share of a command that gears leave while its tendon is drawn in, and while it is let out, shape (2, a).
    """

    command: Array
    levels: Array
    passive: Array
    inverse: Array
    internal: Array
    tendons: Tendons
    gears: Array

    @classmethod
    def from_tendons(cls, tendons: Tendons, gain: Array | None, gears: Array | None = None) -> FrictionLoop:
        """Build the loop.

        Args:
            tendons: The tendon layer of a finger with force closure.
            gain: K_P, shape (n,), N m/rad, for passive tendons that are elastic; None for passive tendons as planned.
            gears: As in `gear_shares`; ideal sources by default.
        """
        routing = tendons.routing
        closure = routing.force_closure()
        if not closure.holds:
            raise InputError("finger.tendons", f"{closure}; self-locking is defined for fingers with force closure")
        inverse = np.asarray(np.linalg.pinv(routing.coupling.T))
        levels = -inverse / closure.tension[:, None]
        command = inverse + closure.tension[None, :, None] * levels[:, None, :]
        if gain is None:
            passive = command[:, routing.actuated :]
        else:
            elastic = 0.5 * tendons.half_stiffness[:, None] * routing.coupling[routing.actuated :] / gain
            passive = np.broadcast_to(elastic, (len(levels), *elastic.shape))
        shares = np.ones((2, routing.actuated)) if gears is None else gears
        return cls(command, levels, passive, inverse, closure.tension, tendons, shares)

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
            # Tensions by case, cell, strand and torque, at every joint.
            balance = np.einsum("sj,msj,csk->mcjk", routing.strand_coupling, scale, strands)
            friction_torque = weights[:, None, :, None] * np.einsum("js,msj,csk->mcjk", routing.loads, scale, strands)
            # A canal so curved that nothing arrives, or everything stays, leaves no balance to look at.
            finite = np.isfinite(balance).all(axis=(2, 3)) & np.isfinite(friction_torque).all(axis=(2, 3))
            balance = np.where(finite[..., None, None], balance, np.eye(len(torque[0])))
            friction_torque = np.where(finite[..., None, None], friction_torque, 0.0)
            lengths = np.linalg.norm(balance, axis=3, keepdims=True)
            rows = np.where(lengths > 0.0, lengths, 1.0)
            balance, friction_torque = balance / rows, friction_torque / rows
            regular = finite & (np.abs(np.linalg.det(balance)) > _LEAST_DETERMINANT)
            balance = np.where(regular[..., None, None], balance, np.eye(len(torque[0])))
            turn = np.linalg.solve(balance, friction_torque)
            regular &= np.isfinite(turn).all(axis=(2, 3))
            values, vectors = np.linalg.eig(np.where(regular[..., None, None], turn, 0.0))
            real = np.abs(values.imag) <= _IMAGINARY_TOLERANCE * np.abs(values)
            real &= regular[..., None] & (values.real > 0.0)
            for sign in (1.0, -1.0):
                # Rows: case, cell, eigenvector; then the joint.
                rays = sign * np.swapaxes(vectors.real, 2, 3)
                levels = rays @ self.levels.T
                attained = np.diagonal(levels, axis1=1, axis2=3).swapaxes(1, 2)
                span = np.max(np.abs(levels), axis=-1)
                inside = real & (attained >= levels.max(axis=-1) - _CELL_TOLERANCE * span)
                for index, is_taut in enumerate(taut):
                    mean = np.einsum("cj,mcej->mce", self.passive[:, index], rays)
                    slack = _CELL_TOLERANCE * np.max(np.abs(self.passive[:, index]))
                    inside &= (mean >= -slack) if is_taut else (mean <= slack)
                coefficients = np.where(inside, 1.0 / np.where(real, values.real, 1.0), np.inf).reshape(size, -1)
                best_ray = np.argmin(coefficients, axis=1)
                case = np.arange(size)
                better = coefficients[case, best_ray] < worst
                worst[better] = coefficients[case, best_ray][better]
                cell = best_ray // rays.shape[2]
                ray = rays.reshape(size, -1, rays.shape[3])[case, best_ray]
                ray = ray / np.max(np.abs(ray), axis=1, keepdims=True)
                torque[better] = ray[better]
                command[better] = np.einsum("mtj,mj->mt", self.command[cell], ray)[better]
        return worst, torque, command

    def growth(self, position: Array, weights: Array, sliding: Array) -> Array:
        """Return the growth of a torque on its way around the loop, of m cases, shape (m,): a cheap ranking.

        A few turns of the loop without offsets and with passive tendons as planned, from the internal tensions. The
        closer a case is to self-locking the more it grows; 1 and above is no proof of locking, nor below 1 of none.

        Args:
            position: theta, shape (m, n), rad.
            weights: s M, signed friction coefficients of the joints, shape (m, n), m.
            sliding: sigma, shape (m, t).
        """
        routing, scale = self.tendons.routing, self._shares(position, sliding)
        inverse, internal = self.inverse, self.internal
        tension = np.broadcast_to(internal, (len(position), len(internal)))
        growth = np.zeros(len(position))
        torque = np.zeros_like(weights)
        for _ in range(_GROWTH_TURNS):
            pull, reaction = self._joint_torques(scale * routing.strand_tension(tension)[..., None])
            torque = torque + weights * reaction - pull
            size = np.maximum(np.max(np.abs(torque), axis=1, keepdims=True), np.finfo(float).tiny)
            growth, torque = size[:, 0], torque / size
            minimal = torque @ inverse.T
            tension = minimal + np.max(-minimal / internal, axis=1, keepdims=True) * internal
        return growth

    def command_to_move(self, position: Array, weights: Array, sliding: Array, minimum: Array, weight: Array) -> Array:
        """Return f_hat, shape (m, t), N, in slow motion with passive tendons as planned; infinite on self-locking.

        The balance H_c2^T f = M s R + G in the demand tau differs from tau itself by friction alone, so tau is
        corrected by its residual until that vanishes, which it does as fast as powers of the loop's gain.

        Args:
            position: theta, shape (m, n), rad.
            weights: s M, signed friction coefficients of the joints, shape (m, n), m.
            sliding: sigma, shape (m, t).
            minimum: f0, shape (t,), N.
            weight: G, shape (m, n), N m.
        """
        routing, scale, drag = self.tendons.routing, self._shares(position, sliding), self._drags(position, sliding)
        inverse, internal = self.inverse, self.internal
        torque, command = np.array(weight), np.full((len(position), len(internal)), np.inf)
        active = np.arange(len(position))
        for _ in range(_MAX_ITERATIONS):
            minimal = torque[active] @ inverse.T
            level = np.max((minimum - minimal) / internal, axis=1, keepdims=True)
            tension = minimal + level * internal
            strands = np.maximum(scale[active] * routing.strand_tension(tension)[..., None] - drag[active], 0.0)
            pull, reaction = self._joint_torques(strands)
            residual = pull - weights[active] * reaction - weight[active]
            largest_tension = np.max(np.abs(tension), axis=1)
            arm = np.max(np.abs(routing.strand_coupling))
            done = np.max(np.abs(residual), axis=1) <= _BALANCE_TOLERANCE * arm * largest_tension
            command[active[done]] = tension[done]
            continuing = ~done & (largest_tension < _RUNAWAY_TENSION * (1.0 + np.max(minimum)))
            torque[active] -= residual
            active = active[continuing]
            if not active.size:
                break
        return command

    def greatest_command(self, position: Array, weights: Array, sliding: Array, minimum: Array, weight: Array) -> Array:
        """Return the largest command of an actuated tendon, shape (m,), N, in k ways of sliding, with n + 1 tendons.

        The balance has one kernel: f = f_0 + l k, delivered by tendons and, of passive ones, the mean. f_hat is f over
        the shares that arrive, and l the least at which all of it is at f0 or above; without a positive kernel it
        locks. All ways must slide passive tendons alike, and each tendon rubs at one place.

        Args:
            position: theta, shape (m, n), rad.
            weights: s M, signed friction coefficients of the joints, shape (n,), m.
            sliding: sigma, shape (k, t).
            minimum: f0, shape (t,), N.
            weight: G, shape (m, n), N m.
        """
        routing, actuated = self.tendons.routing, self.tendons.routing.actuated
        count, size = len(self.internal), len(position)
        cases, passive_sliding = (size, count), np.where(np.arange(count) < actuated, 0.0, sliding[0])
        shares, drags = (
            of(position, np.broadcast_to(passive_sliding, cases))[..., 0] for of in (self._shares, self._drags)
        )
        arms = routing.strand_coupling.T - weights[:, None] * routing.loads
        balance = arms @ (shares[:, :, None] * routing.strand_tension(np.eye(count)).T)
        demand = weight + drags @ arms.T
        left_vectors, lengths, right_vectors = np.linalg.svd(balance)
        kernel = right_vectors[:, -1] * np.sign(right_vectors[:, -1].sum(axis=1, keepdims=True))
        base = np.einsum("mit,mi->mt", right_vectors[:, :-1], np.einsum("mji,mj->mi", left_vectors, demand) / lengths)
        can_move = np.all(kernel > _CELL_TOLERANCE * np.max(kernel, axis=1, keepdims=True), axis=1)
        largest = np.where(can_move, 0.0, np.inf)
        kernel, base, moving_position = kernel[can_move], base[can_move], position[can_move]
        share, drag = np.ones_like(base), np.zeros_like(base)
        for signs in sliding if can_move.any() else ():
            way_cases = np.broadcast_to(signs, base.shape)
            share[:, :actuated] = self._shares(moving_position, way_cases)[:, :actuated, 0]
            drag[:, :actuated] = self._drags(moving_position, way_cases)[:, :actuated, 0]
            # A tendon at f0 that does not overcome its drag delivers nothing.
            level = np.max((np.maximum(minimum * share - drag, 0.0) - base) / kernel, axis=1, keepdims=True)
            delivered = base + level * kernel
            command = np.where(delivered > _CELL_TOLERANCE * delivered.max(), (delivered + drag) / share, minimum)
            largest[can_move] = np.maximum(largest[can_move], command[:, :actuated].max(axis=1))
        return largest

    def _joint_torques(self, strands: Array) -> tuple[Array, Array]:
        """Return joint torques and pin loads, (m, n) each, of tensions of the strands at every joint, (m, s, n)."""
        routing = self.tendons.routing
        pull, load = (np.einsum("msj,sj->mj", strands, each) for each in (routing.strand_coupling, routing.loads.T))
        return pull, load

    def _shares(self, position: Array, sliding: Array) -> Array:
        """Return the tension of every strand at every joint over the command or its tendon's mean, shape (m, s, n)."""
        routing, actuated = self.tendons.routing, self.tendons.routing.actuated
        friction = (sliding * capstan_coefficient(self.tendons.surface, routing.curvature(position)))[:, actuated:]
        share, direction = self.tendons.in_sliding(position, sliding)[0][:, :actuated], sliding[:, :actuated]
        gears = np.where(direction > 0.0, self.gears[0], np.where(direction < 0.0, self.gears[1], 1.0))
        pairs = np.stack([1.0 + friction, 1.0 - friction], axis=-1).reshape(len(position), -1)
        halves = np.repeat(pairs[..., None], share.shape[-1], axis=-1)
        return np.concatenate([share * gears[..., None], halves], axis=1)

    def _drags(self, position: Array, sliding: Array) -> Array:
        """Return the friction of every strand at every joint, shape (m, s, n), N."""
        routing, actuated = self.tendons.routing, self.tendons.routing.actuated
        actuated_drag = self.tendons.in_sliding(position, sliding)[1][:, :actuated]
        passive_drag = sliding[:, actuated:] * self.tendons.drag[actuated:]
        halves = np.repeat(0.5 * passive_drag, 2, axis=1) * np.tile([-1.0, 1.0], routing.passive)
        return np.concatenate([actuated_drag, np.repeat(halves[..., None], actuated_drag.shape[-1], axis=-1)], axis=1)
