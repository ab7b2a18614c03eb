"""The energy account: energies stored, supplied and lost, by name, and powers integrated over a trajectory.

    d/dt (kinetic + gravity + what the rows store) = supplied by rows + fingertip force - lost in rows

It closes to the integrator's tolerance, or a sign somewhere is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import SUPPLIED, Energies, Energy
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import Kinematics, Motion
from finger_pin.typing import Array

FINGERTIP = Energy("fingertip", "fingertip force", SUPPLIED)
_KINETIC, _GRAVITY = Energy("kinetic", "kinetic"), Energy("gravity", "gravity")
_ROTOR_TERM = Energy("rotors", "rotors")
_OBJECT_TERMS = Energy("objects_kinetic", "objects, kinetic"), Energy("objects_gravity", "objects, gravity")
# Three-point Gauss quadrature on [0, 1]. All nodes are inside the step: a controller that is sampled changes its
# tensions at the ends of steps, where a node would see those of the next one.
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
# Five-point Lobatto quadrature, which checks it: at the ends as well, all but a trace, where powers may bend unseen.
_CHECK_NODES = 0.5 + 0.5 * (1.0 - 1e-9) * np.array([-1.0, -np.sqrt(3.0 / 7.0), 0.0, np.sqrt(3.0 / 7.0), 1.0])
_CHECK_WEIGHTS = np.array([9.0, 49.0, 64.0, 49.0, 9.0]) / 180.0
# Coefficients of u^3, u^2 and u in the integrals from 0 to u of the parabolas that are one at a node and zero at the
# other two, shape (3, 3).
_PARABOLAS = np.linalg.inv(np.vander(_NODES, 3)) / np.array([[3.0], [2.0], [1.0]])
_CHUNK = 4096
# A power may bend inside a step where no force does, as that which a limiter loses where it would have to pull; and
# an impact may be one step. Where more than this stays open, of all energy exchanged and in J, steps are halved, so
# often at most, until no work of one is wrong by a thousandth of it: of so many steps those where it opens most.
_CLOSED_SHARE, _LEAST_ENERGY, _STEP_SHARE = 1e-5, 1e-12, 1e-3
_MAX_HALVINGS, _MAX_REFINED_STEPS = 8, 20_000

# The ends of steps, and what maps times to powers there.
_IslandPowers = tuple[Array, Callable[[Array], Array]]
# Where steps begin, and how long they are, s.
_Steps = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Flows:
    """Powers, W, or their integrals, J, by name.

    Slack is the difference that cutting a tension at zero makes: (f^a - f^f) v where f = 0. Micro-damping may return
    part of the energy that it takes while the bristles spring back.

    Attributes:
        values: By name, shape (..., f).
        energy_terms: Energies and powers of the f of them.
    """

    values: Array
    energy_terms: tuple[Energy, ...]

    @classmethod
    def from_rows(cls, energies: Energies, rows: Array, fingertip: Array) -> Flows:
        """Join the powers of the rows, shape (..., powers), and that of the fingertip force, shape (...,)."""
        values = np.concatenate([rows, np.asarray(fingertip)[..., None]], axis=-1)
        return cls(values, flow_terms(energies))

    def __getitem__(self, name: str) -> Array:
        """Return one energy or power by name, shape (...,)."""
        value: Array = self.values[..., [each.name for each in self.energy_terms].index(name)]
        return value

    @property
    def net(self) -> Array:
        """Supplied less lost, shape (...,)."""
        return np.asarray(self.values @ [1.0 if each.kind == SUPPLIED else -1.0 for each in self.energy_terms])


def energies(finger: Finger, signals: FingerSignals, motion: Motion | Kinematics) -> dict[str, Array]:
    """Return the stored energies at the given signals by name, shape (...,), J."""
    state, (stored, _) = signals.state, signals.mechanism.account()
    lumps = 0.5 * np.sum(finger.tendons.mass * state.passive_velocity**2, axis=-1)
    energy_by_name = {_KINETIC.name: motion.kinetic_energy + lumps, _GRAVITY.name: motion.potential_energy, **stored}
    if finger.actuators.names and state.motor_velocity is not None:
        rotor_velocity = np.concatenate([state.spool_velocity, state.motor_velocity], axis=-1)
        energy_by_name[_ROTOR_TERM.name] = 0.5 * np.sum(finger.actuators.inertias * rotor_velocity**2, axis=-1)
    if isinstance(motion, Motion) and motion.objects is not None:
        energy_by_name |= dict(zip((each.name for each in _OBJECT_TERMS), motion.objects, strict=True))
    return energy_by_name


def flow_terms(energies: Energies) -> tuple[Energy, ...]:
    """Return the entries of a mechanism's powers, with that of the fingertip force."""
    return (*energies.powers, FINGERTIP)


def stored_terms(finger: Finger) -> tuple[Energy, ...]:
    """Return the entries of a finger's stored energies."""
    rotors = (_ROTOR_TERM,) if finger.actuators.names else ()
    objects = () if finger.scene is None else _OBJECT_TERMS
    return (_KINETIC, _GRAVITY, *finger.mechanism.energies.stored, *rotors, *objects)


def powers(signals: FingerSignals) -> Flows:
    """Return the powers supplied and lost at the given signals."""
    evaluation = signals.mechanism
    if evaluation.energy_terms is not None:
        rows = evaluation.energy_terms[..., len(evaluation.energies.stored) :]
    else:
        rows = np.stack(list(evaluation.account()[1].values()), axis=-1)
    return Flows.from_rows(
        evaluation.energies, rows, np.sum(signals["external_torque"] * signals.state.velocity, axis=-1)
    )


def account_entries(result: xr.Dataset, *kinds: str) -> dict[str, xr.Variable]:
    """Return the energies in a result's account, J, that are of some kinds: stored, supplied or lost.

    Args:
        result: Dataset of `simulate`.
        kinds: `STORED`, `SUPPLIED` or `LOST`, of `mechanism.rows`.

    Returns:
        By the name of the variable; ``label`` among its attributes says in words what it is.
    """
    return {
        str(name): values
        for name, values in result.variables.items()
        if values.attrs.get("account") in kinds and values.attrs["units"] == "J"
    }


@dataclass(frozen=True, eq=False)
class Account:
    """Energies, powers and works at the saved times, each of shape (m,).

    Attributes:
        stored: J.
        powers: W.
        works: Powers integrated from the start, J.
        residual: Stored less its start, less the net work, J; zero for an exact integration.
    """

    stored: dict[str, Array]
    powers: Flows
    works: Flows
    residual: Array


def account(loop: ClosedLoop, trajectory: Trajectory, times: Array, signals: LoopSignals, motion: Motion) -> Account:
    """Compute the energy account of a trajectory.

    Args:
        loop: The system.
        trajectory: Its solution.
        times: Saved times, shape (m,), beginning at the trajectory's start.
        signals: The signals at those times.
        motion: Fingertip and energies of the rigid body at those times.
    """
    flows = powers(signals.finger)
    stored = energies(loop.finger, signals.finger, motion)
    total = np.sum(list(stored.values()), axis=0)
    islands, sums = _island_powers(loop, trajectory), np.zeros((len(times), len(flows.energy_terms)))
    for knots, power in islands:
        sums += _works(power, knots[:-1], np.diff(knots), times, sums.shape[1])
    works = Flows(sums, flows.energy_terms)
    stored_change = total - total[0]
    residual = stored_change - works.net
    allowed = max(_CLOSED_SHARE * float(np.sum(np.max(np.abs(sums), axis=0, initial=0.0))), _LEAST_ENERGY)
    if allowed < float(np.max(np.abs(residual))) < np.inf:
        increments = np.abs(np.diff(residual))
        refined = [np.zeros(0, dtype=np.int64) for _ in islands]
        for spans in _worst_spans(increments, allowed):
            for index, (knots, power) in enumerate(islands):
                steps = np.setdiff1d(_steps_between(knots, times, spans), refined[index])
                refined[index] = np.union1d(refined[index], steps)
                coarse, fine = _refine(power, knots[steps], np.diff(knots)[steps], _STEP_SHARE * allowed)
                if len(coarse[0]):
                    sums += _works(power, *fine, times, sums.shape[1]) - _works(power, *coarse, times, sums.shape[1])
            works = Flows(sums, flows.energy_terms)
            residual = stored_change - works.net
            if np.sum(np.abs(np.diff(residual))[spans]) > 0.5 * np.sum(increments[spans]):
                break
    return Account(stored=stored, powers=flows, works=works, residual=residual)


def _worst_spans(increments: Array, allowed: float) -> Iterator[NDArray[np.int64]]:
    """Yield the spans of saved times with the largest residuals, which make up half of it, then the others.

    The residual that arises elsewhere is less than half of the allowed one. One that halving steps does not reduce
        is no error of the quadrature.

    Args:
            increments: Change of the residual in each span, shape (m - 1,), J.
            allowed: Largest residual, J.
    """
    order = np.argsort(-increments)
    cumulated = np.cumsum(increments[order])
    half_count, total_count = np.searchsorted(cumulated, (0.5 * cumulated[-1], cumulated[-1] - 0.5 * allowed)) + 1
    yield order[:half_count]
    yield order[half_count:total_count]


def _steps_between(breakpoints: Array, times: Array, spans: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the steps between saved times, up to a maximum number."""
    first = np.searchsorted(breakpoints[1:-1], times[spans], side="right")
    last = np.searchsorted(breakpoints[1:-1], times[spans + 1], side="left") + 1
    within_limit = np.cumsum(last - first) <= _MAX_REFINED_STEPS
    ranges = zip(first[within_limit], last[within_limit], strict=True)
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(*bounds) for bounds in ranges)]))


def _refine(power: Callable[[Array], Array], start: Array, length: Array, allowed: float) -> tuple[_Steps, _Steps]:
    """Return the inaccurate steps, as starts and lengths, and the shorter ones that replace them.

    Steps are halved until the error of each is at most the allowed one, J.
    """
    coarse: _Steps | None = None
    fine: list[_Steps] = []
    for _ in range(_MAX_HALVINGS):
        chunks = [slice(first, first + _CHUNK) for first in range(0, len(start), _CHUNK)]
        errors = [_quadrature_error(power, start[chunk], length[chunk]) for chunk in chunks]
        inaccurate = np.concatenate([np.zeros(0), *errors]) > allowed
        if coarse is None:
            coarse = start[inaccurate], length[inaccurate]
        else:
            fine.append((start[~inaccurate], length[~inaccurate]))
        start, length = start[inaccurate], 0.5 * length[inaccurate]
        start, length = np.concatenate([start, start + length]), np.tile(length, 2)
    fine.append((start, length))
    start, length = (np.concatenate(arrays) for arrays in zip(*fine, strict=True))
    order = np.argsort(start)
    return coarse or fine[0], (start[order], length[order])


def _quadrature_error(power: Callable[[Array], Array], start: Array, length: Array) -> Array:
    """Return the error of the integral of any power over steps, shape (steps,), J."""
    integral = np.tensordot(_WEIGHTS, _weighted_powers(power, start, length, _NODES), (0, 1))
    check = np.tensordot(_CHECK_WEIGHTS, _weighted_powers(power, start, length, _CHECK_NODES), (0, 1))
    return np.asarray(np.max(np.abs(integral - check), axis=1))


def _island_powers(loop: ClosedLoop, trajectory: Trajectory) -> list[_IslandPowers]:
    """Return breakpoints and powers of islands, or of the whole mechanism."""
    end = trajectory.breakpoints[-1]
    islands: list[_IslandPowers] = []
    for island in trajectory.islands:
        breakpoints = island.times
        islands.append((np.append(breakpoints[breakpoints < end], end), island.powers))

    def powers(times: Array) -> Array:
        return loop.powers(times, trajectory.interpolate(times))

    return islands or [(trajectory.breakpoints, powers)]


def _works(power: Callable[[Array], Array], start: Array, length: Array, times: Array, count: int) -> Array:
    """Return the integrals of all powers over steps, in order, up to the saved times, shape (m, count), J.

    Inside a step the power is the parabola through its values at the nodes, which gives the quadrature over whole
    steps; its error inside a step does not add up.
    """
    works, total = np.zeros((len(times), count)), np.zeros(count)
    for first in range(0, len(start), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        values = _weighted_powers(power, start[chunk], length[chunk], _NODES)
        sums = np.vstack([total, total + np.cumsum(np.tensordot(_WEIGHTS, values, (0, 1)), axis=0)])
        chunk_end = np.append(start, np.inf)[min(first + _CHUNK, len(start))]
        rows = slice(*(int(row) for row in np.searchsorted(times, (start[first], chunk_end))))
        step = np.searchsorted(start[chunk], times[rows], side="right") - 1
        share = np.minimum((times[rows] - start[chunk][step]) / length[chunk][step], 1.0)
        factors = np.vander(share, 4)[:, :3] @ _PARABOLAS
        works[rows] = sums[step] + np.einsum("mn,mnp->mp", factors, values[step])
        total = sums[-1]
    return works


def _weighted_powers(power: Callable[[Array], Array], start: Array, length: Array, nodes: Array) -> Array:
    """Return the powers at nodes of steps, times the steps' lengths, shape (steps, nodes, count)."""
    times = (start[:, None] + length[:, None] * nodes).ravel()
    weighted = power(times).reshape(len(start), len(nodes), -1)
    weighted *= length[:, None, None]
    return weighted
