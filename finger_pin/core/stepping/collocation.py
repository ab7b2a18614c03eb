"""Derivatives of a motion by numbers, S' = A S + E along its steps, by collocation (Radau IIA), compiled.

Rosenbrock methods keep their order only with the exact Jacobian, and that of state and derivatives together has the
block dA/dx S, which nobody wants to form. But along a motion that is known, S obeys a linear equation in time. The
method of three nodes, of order five and stiff accuracy (Hairer and Wanner, Solving Ordinary Differential Equations II,
1996, IV.5), solves it from the exact A at its nodes alone. The equation of an interval h, with W the inverse of the
method's matrix,

    (W_aa / h - A_a) Y_a = sum_b W_ab / h S - sum_(b != a) W_ab / h Y_b + E_a,

is what the condensed linear systems of a step solve, node by node; what joins the nodes is eliminated by blocks. All
numbers share that: each adds its own E, a difference of rates at every node, and back-substitutions.

S is continuous where laws bend, but A is not: intervals end where a sliding speed or the kink of a law changes its
sign. Where an input jumps at a time that depends on a number, S jumps by the difference of the rates times dt/dp.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from finger_pin.core.evaluation.charts import place_bodies, turn_small
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import Indices, Kind, Layers, Matrix, Unit, Vector, bound_at, call_at, compiled
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.bends import cross, hold_all, last_before, look, rate_at, state_at, turned_after
from finger_pin.core.stepping.broad_phase import list_awake
from finger_pin.core.stepping.interpolation import Between
from finger_pin.core.stepping.radau import join, multiply

# Entries of the memory.
STEP, TIME, SPLIT, MEMORY_SIZE = range(4)
# In how many parts a step is cut at most.
_SPLITS = 12.0
# How short an interval is not worth one, of the time.
_NOTHING = 1e-13
SINGULAR = -1


class Collocation(NamedTuple):
    """A motion of size n with p numbers, and what is filled for at most m intervals.

    Attributes:
        model: Address of the bound `Model`.
        changed: Addresses of models with one number changed each, shape (p,); 0 where the rates do not feel it.
        changes: By how much, shape (p,).
        motion: The steps.
        corners: One more than the row of ``shifts`` where inputs bend or jump at the end of a step, else 0, shape
            (steps,).
        shifts: How much later each corner is for a larger number, dt/dp, shape (corners, p).
        rows: Rows that may bend, shape (r,).
        columns: What changes its sign there, columns of the table of rows, shape (r,).
        held: Whether the row can be held on a side, shape (r,).
        leaders: Memory, the tension that sets lambda in (22), by controller, shape (l,); w = r + l bends in all.
        weights: `radau.WEIGHTS`.
        nodes: `radau.NODES`.
        memory: The step, the time, and how often the step has been cut so far; kept between calls.
        sides: Memory, on which side of each bend the motion is, shape (w,).
        before, between, after: Scratch, what changes its sign at each, shape (w,).
        derivative: S, changed in place, shape (n, p).
        state: Scratch, shape (n,).
        right: Scratch, shape (n + 1,).
        part: Scratch, shape (n,).
        resolvents: Scratch, shape (3, n, n).
        given: Scratch, shape (3, n, p).
        square: Scratch, shape (2, n, n).
        wide: Scratch, shape (2, n, n + p).
        pivots: Scratch, shape (n,).
        ends: Filled with the ends of the intervals, shape (m,), s.
        solution: Filled with S at their begins and nodes, shape (4 m, n, p).
    """

    model: int
    changed: Indices
    changes: Vector
    motion: Between
    corners: Indices
    shifts: Matrix
    rows: Indices
    columns: Indices
    held: Indices
    leaders: Indices
    weights: Matrix
    nodes: Vector
    memory: Vector
    sides: Vector
    before: Vector
    between: Vector
    after: Vector
    derivative: Matrix
    state: Vector
    right: Vector
    part: Vector
    resolvents: Layers
    given: Layers
    square: Layers
    wide: Layers
    pivots: Indices
    ends: Vector
    solution: Layers


COLLOCATION = Kind(Collocation)


@compiled
def _node(col: Any, model: Any, a: int, time: float, h: float) -> Any:
    """Fill the resolvent at a node that is evaluated, and R (sum_b W_ab / h S + E); false if it is singular."""
    size, count = col.derivative.shape
    given, total = col.given[a], (col.weights[a, 0] + col.weights[a, 1] + col.weights[a, 2]) / h
    for k in range(count):
        for c in range(size):
            given[c, k] = total * col.derivative[c, k]
        if col.changed[k] == 0:
            continue
        rate_at(col.changed[k], time, col.state)
        other = bound_at(col.changed[k], MODEL)
        for c in range(size):
            given[c, k] += (other.rate[c] - model.rate[c]) / col.changes[k]
    call_at(model.linearise, col.model, time)
    if call_at(model.condense, col.model, col.weights[a, a] / h) == 0:
        return False
    resolvent = col.resolvents[a]
    if model.linear.blocks.touches.size == 0:
        for i in range(size):
            for c in range(size):
                resolvent[i, c] = model.linear.solution[i, c]
    else:
        for c in range(size + 1):
            col.right[c] = 0.0
        for c in range(size):
            col.right[c] = 1.0
            solve(model.linear, col.right, col.part)
            col.right[c] = 0.0
            for i in range(size):
                resolvent[i, c] = col.part[i]
    wide = col.wide[0]
    multiply(resolvent, given, count, wide)
    for i in range(size):
        for k in range(count):
            given[i, k] = wide[i, k]
    return True


@compiled
def _place(col: Any, step: int) -> None:
    """Place free bodies of all models by their attitudes at the begin of a step."""
    b = col.motion
    attitude = b.attitude if step == 0 else b.attitudes[step - 1]
    place_bodies(bound_at(col.model, MODEL).tables, attitude)
    for k in range(col.changed.size):
        if col.changed[k] != 0:
            place_bodies(bound_at(col.changed[k], MODEL).tables, attitude)


@compiled
def _awake(address: int) -> None:
    """Let no contact of a model sleep."""
    model = bound_at(address, MODEL)
    paths = model.work.paths
    for k in range(paths.asleep.size):
        paths.asleep[k] = 0
    for e in range(paths.path.size):
        paths.path[e] = 0.0
    list_awake(model.tables, paths)


@compiled
def _jump(col: Any, model: Any, step: int, corner: int) -> None:
    """Add to S what a later jump of the inputs makes of it: (f before - f after) dt/dp."""
    moves = False
    for k in range(col.changes.size):
        moves = moves or col.shifts[corner, k] != 0.0
    if not moves:
        return
    end = col.motion.ends[step]
    state_at(col.motion, step, end, col.state)
    rate_at(col.model, end, col.state)
    for c in range(col.state.size):
        col.part[c] = model.rate[c]
    rate_at(col.model, end * (1.0 + 2.0**-51), col.state)
    for c in range(col.state.size):
        for k in range(col.changes.size):
            col.derivative[c, k] += (col.part[c] - model.rate[c]) * col.shifts[corner, k]


@compiled
def _turn(col: Any, step: int) -> None:
    """Let the angles of free bodies begin anew in S too, after a step."""
    b = col.motion
    for f in range(b.charts.size):
        i = b.charts[f]
        x = b.states[step]
        for k in range(col.changes.size):
            angles, rates = col.right[:3], col.part[:3]
            for r in range(3):
                angles[r], rates[r] = col.derivative[i + r, k], col.derivative[b.width + i + r, k]
            turn_small(x[i], x[i + 1], x[i + 2], x[b.width + i], x[b.width + i + 1], x[b.width + i + 2], angles, rates)
            for r in range(3):
                col.derivative[i + r, k], col.derivative[b.width + i + r, k] = angles[r], rates[r]


@compiled
def _interval(col: Any, model: Any, taken: int, step: int, begin: float, end: float, evaluated: bool) -> Any:
    """Carry S from one time of a step to another, maybe evaluated; false where a linear system is singular."""
    size, count = col.derivative.shape
    h = end - begin
    for a in range(2, -1, -1):
        time = end if a == 2 else begin + col.nodes[a] * h
        if a < 2 or not evaluated:
            state_at(col.motion, step, time, col.state)
            rate_at(col.model, time, col.state)
        if not _node(col, model, a, time, h):
            return False
    if not join(col, h):
        return False
    for c in range(size):
        for k in range(count):
            col.solution[4 * taken, c, k] = col.derivative[c, k]
            for a in range(3):
                col.solution[4 * taken + 1 + a, c, k] = col.given[a, c, k]
            col.derivative[c, k] = col.given[2, c, k]
    col.ends[taken] = end
    return True


@Unit
def collocate(address: int, _time: float) -> int:
    """Fill intervals of the `Collocation` at an address; return how many, or `SINGULAR`."""
    col = bound_at(address, COLLOCATION)
    model, b, memory = bound_at(col.model, MODEL), col.motion, col.memory
    taken, last = 0, b.ends.size - 1
    _awake(col.model)
    for k in range(col.changed.size):
        if col.changed[k] != 0:
            _awake(col.changed[k])
    hold_all(col)
    while memory[STEP] <= last and taken < col.ends.size:
        step, begin = int(memory[STEP]), memory[TIME]
        if memory[SPLIT] == 0.0 and b.charts.size > 0:
            _place(col, step)
        end, crossed = b.ends[step], False
        look(col, model, step, end, col.after)
        turned = turned_after(col, col.after, col.after) < 1.0
        if turned and memory[SPLIT] < _SPLITS:
            end, crossed = last_before(col, model, step, begin, end), True
        if end - begin > _NOTHING * max(1.0, abs(end)):
            if not _interval(col, model, taken, step, begin, end, not crossed):
                return SINGULAR
            taken += 1
        memory[TIME] = end
        if turned:
            cross(col)
        if crossed:
            memory[SPLIT] += 1.0
            continue
        memory[SPLIT] = 0.0
        memory[STEP] += 1.0
        if col.corners[step] > 0:
            _jump(col, model, step, col.corners[step] - 1)
        _turn(col, step)
    return taken
