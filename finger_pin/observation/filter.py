"""An extended Kalman filter with considered parameters, compiled: one period predicted and corrected by readings.

The estimate is (x, F): the packed state, and forces at tips that follow an Ornstein-Uhlenbeck process. Parameters p of
the model are *considered* (Schmidt, "Application of state-space methods to navigation problems", Advances in Control
Systems 3, 1966): their uncertainty, and how estimates correlate with it, is in the covariance P of (x, F, p); readings
never correct them. Over a period, with x' = phi(x, u, F, p),

    P <- A P A^T + Q,  A = [[dphi/dx, dphi/dF, dphi/dp], [0, d, 0], [0, 0, 1]],  d = exp(-dt / tau),

and Q has the noise of what is held, dphi/du s_u^2 dphi/du^T, that of the forces, and that of the model's own. A reading
y of a number i of the estimate, of variance r, corrects by

    k = P e_i / S with zeros for p,  S = P_ii + r,  (x, F) <- (x, F) + k (y - x_i),

P <- (1 - k e_i^T) P (1 - k e_i^T)^T + r k k^T, which holds for any k. A reading beyond `JUMP` standard deviations is
left out. Where k (y - x_i) would lead farther than the model is about linear, as where a slack cord gets taut, k is
made shorter.
"""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Matrix,
    StructType,
    Vector,
    call_at,
    njit_inline,
    sum_products,
    unpack,
)

#: Standard deviations of an innovation beyond which a reading is a jump.
JUMP = 10.0


class FilterArgs(NamedTuple):
    """Arguments of `predict` and `correct`: n states, u inputs, t tips, f forces, p parameters; N = n + f + p.

    Attributes:
        advance: Address of the function that advances a period and fills derivatives, returning 0 when done.
        limit: Address of the function that limits bristles.
        period: Address of what both take.
        state: The state that they change, shape (n,).
        forces: Forces at the tips that they hold, shape (t, 3).
        derivatives: What they fill, shape (n, n + u + 3 t + p).
        covariance: P, shape (N, N).
        map: Memory for the first n rows of A, shape (n, N).
        product: Memory, shape (n, N).
        force_at: Which numbers of ``forces`` are estimated, shape (f,).
        decay: d of each, shape (f,).
        noise: Variance that a period adds to each number of the estimate, shape (n + f,).
        input_variance: Of what is held over the period, shape (u,).
        places: Numbers of the estimate that sensors read, shape (s,).
        readings: Of the sensors, NaN where there is none, shape (s,).
        variance: Of the readings, shape (s,).
        levels: The largest deviation of each number of the state; of bristles filled by ``limit``, shape (n,).
        reach: The longest correction of each number of the state, shape (n,).
        innovations: Filled: of each reading that is there, over its standard deviation, shape (s,).
        gain: Memory, shape (N,).
        slopes: Derivatives of signals, by what ``derivatives`` are by, shape (k, n + u + 3 t + p).
        columns: Where in these the numbers of P stand, shape (N,).
        signal_variance: Filled by `spread`: variances of the signals, shape (k,).
        considered: Filled by it: of each number of the state the part of its variance that follows from p, shape (n,).
        distance: Filled by it: F^T P_F^-1 F of the forces at each tip, shape (f / 3,).
    """

    advance: int
    limit: int
    period: int
    state: Vector
    forces: Matrix
    derivatives: Matrix
    covariance: Matrix
    map: Matrix
    product: Matrix
    force_at: Indices
    decay: Vector
    noise: Vector
    input_variance: Vector
    places: Indices
    readings: Vector
    variance: Vector
    levels: Vector
    reach: Vector
    innovations: Vector
    gain: Vector
    slopes: Matrix
    columns: Indices
    signal_variance: Vector
    considered: Vector
    distance: Vector


FILTER_ARGS = StructType(FilterArgs)


@njit_inline
def _fill_map(args: FilterArgs) -> None:
    """Fill the first n rows of A from the derivatives."""
    size, inputs, tips, forces = args.state.size, args.input_variance.size, args.forces.size, args.force_at.size
    parameters = size + inputs + tips
    for i in range(size):
        for c in range(size):
            args.map[i, c] = args.derivatives[i, c]
        for c in range(forces):
            args.map[i, size + c] = args.derivatives[i, size + inputs + args.force_at[c]]
        for c in range(args.map.shape[1] - size - forces):
            args.map[i, size + forces + c] = args.derivatives[i, parameters + c]


@njit_inline
def _propagate(args: FilterArgs) -> None:
    """Propagate P over a period."""
    size, known = args.state.size, args.state.size + args.force_at.size
    p, product, wide = args.covariance, args.product, args.covariance.shape[0]
    for i in range(size):
        for c in range(wide):
            product[i, c] = 0.0
        for k in range(wide):
            factor = args.map[i, k]
            # The covariance of parameters is diagonal for good.
            if factor != 0.0:
                for c in range(wide if k < known else known):
                    product[i, c] += factor * p[k, c]
                if k >= known:
                    product[i, k] += factor * p[k, k]
    for i in range(size):
        for j in range(i + 1):
            total = sum_products(product[i], args.map[j], wide)
            for u in range(args.input_variance.size):
                total += args.derivatives[i, size + u] * args.input_variance[u] * args.derivatives[j, size + u]
            p[i, j] = p[j, i] = total
        for c in range(size, wide):
            decay = args.decay[c - size] if c < known else 1.0
            p[i, c] = p[c, i] = product[i, c] * decay
    for i in range(args.force_at.size):
        for c in range(size, wide):
            decay = args.decay[c - size] if c < known else 1.0
            p[size + i, c] = p[size + i, c] * args.decay[i] * decay
            p[c, size + i] = p[size + i, c]
    for i in range(known):
        p[i, i] += args.noise[i]


@CompiledFunction
def predict(address: int, end: float) -> int:
    """Predict the estimate of the `FilterArgs` at an address to a time, s; return the status of the integration."""
    args = unpack(address, FILTER_ARGS)
    status: int = call_at(args.advance, args.period, end)
    if status != 0:
        return status
    _fill_map(args)
    _propagate(args)
    for c in range(args.force_at.size):
        args.forces[args.force_at[c] // 3, args.force_at[c] % 3] *= args.decay[c]
    return 0


@njit_inline
def _correct_by(args: FilterArgs, place: int, innovation: float, total: float) -> None:
    """Correct the estimate by one reading."""
    p, gain, size, known = args.covariance, args.gain, args.state.size, args.state.size + args.force_at.size
    wide, share = p.shape[0], 1.0
    for i in range(wide):
        gain[i] = p[i, place]
    for i in range(size):
        step = abs(gain[i] / total * innovation)
        if step * share > args.reach[i]:
            share = args.reach[i] / step
    # Of x and F alone, P loses share (2 - share) k k^T S, and share k k^T S of what it has with p.
    within = share * (2.0 - share)
    for i in range(known):
        factor = gain[i] / total
        if i < size:
            args.state[i] += share * factor * innovation
        else:
            at = args.force_at[i - size]
            args.forces[at // 3, at % 3] += share * factor * innovation
        for c in range(known):
            p[i, c] -= within * factor * gain[c]
        for c in range(known, wide):
            p[i, c] -= share * factor * gain[c]
    for i in range(known):
        for c in range(known, wide):
            p[c, i] = p[i, c]
        for c in range(i):
            p[c, i] = p[i, c] = 0.5 * (p[i, c] + p[c, i])


@njit_inline
def _limit(args: FilterArgs) -> None:
    """Bring bristles back to their levels, and deviations to theirs, beyond which no derivative holds."""
    call_at(args.limit, args.period, 0.0)
    p = args.covariance
    for i in range(args.state.size):
        if p[i, i] > args.levels[i] * args.levels[i]:
            share = args.levels[i] / p[i, i] ** 0.5
            for c in range(p.shape[0]):
                p[i, c] *= share
                p[c, i] *= share


@CompiledFunction
def correct(address: int, _time: float) -> int:
    """Correct the estimate of the `FilterArgs` at an address by its readings, one after the other; return how many."""
    args = unpack(address, FILTER_ARGS)
    size, taken = args.state.size, 0
    for s in range(args.places.size):
        place = args.places[s]
        args.innovations[s] = float("nan")
        if args.readings[s] != args.readings[s]:
            continue
        if place < size:
            value = args.state[place]
        else:
            value = args.forces[args.force_at[place - size] // 3, args.force_at[place - size] % 3]
        total = args.covariance[place, place] + args.variance[s]
        innovation = args.readings[s] - value
        args.innovations[s] = innovation / total**0.5
        if abs(args.innovations[s]) > JUMP:
            continue
        _correct_by(args, place, innovation, total)
        taken += 1
    _limit(args)
    return taken


@njit_inline
def _force_distance(args: FilterArgs, tip: int) -> float:
    """Return F^T P_F^-1 F of the forces at a tip, by Cholesky's factors: its squares are those of L^-1 F."""
    first, factor, total = args.state.size + 3 * tip, args.product[0], 0.0
    # L and L^-1 F, row by row.
    for i in range(3):
        at = args.force_at[3 * tip + i]
        value = args.forces[at // 3, at % 3]
        for j in range(i + 1):
            entry = args.covariance[first + i, first + j]
            for k in range(j):
                entry -= factor[3 * i + k] * factor[3 * j + k]
            factor[3 * i + j] = entry**0.5 if i == j else entry / factor[4 * j]
        for j in range(i):
            value -= factor[3 * i + j] * factor[9 + j]
        factor[9 + i] = value / factor[4 * i]
        total += factor[9 + i] ** 2
    return total


@CompiledFunction
def spread(address: int, _time: float) -> int:
    """Fill what the covariance of the `FilterArgs` at an address says of signals, parameters and forces."""
    args = unpack(address, FILTER_ARGS)
    p, wide = args.covariance, args.covariance.shape[0]
    slope = args.gain
    for s in range(args.signal_variance.size):
        total = 0.0
        for i in range(wide):
            slope[i] = args.slopes[s, args.columns[i]]
        for i in range(wide):
            if slope[i] != 0.0:
                total += slope[i] * sum_products(p[i], slope, wide)
        args.signal_variance[s] = max(total, 0.0)
    for i in range(args.considered.size):
        total = 0.0
        for j in range(args.state.size + args.force_at.size, wide):
            if p[j, j] > 0.0:
                total += p[i, j] * p[i, j] / p[j, j]
        args.considered[i] = min(total / p[i, i], 1.0) if p[i, i] > 0.0 else 0.0
    for tip in range(args.distance.size):
        args.distance[tip] = _force_distance(args, tip)
    return 1
