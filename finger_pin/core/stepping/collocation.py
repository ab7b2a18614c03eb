"""Derivatives of a motion by numbers, S' = A S + E along it, by collocation (Radau IIA), compiled.

Rosenbrock methods keep their order only with the exact Jacobian, and that of state and derivatives together has the
block dA/dx S, which nobody wants to form. But along a motion that is known, S obeys a linear equation in time. A method
that is stiffly accurate solves it from the exact A at its nodes alone, in intervals of its own: as long as a polynomial
follows S, mostly several steps. At each node the condensed linear system of a step gives
(g - A)^-1, and every number adds its own E, a difference of rates (`radau`).

S is continuous where laws bend, but A is not: intervals end where a sliding speed or the kink of a law changes its
sign. Where an input jumps at a time that depends on a number, S jumps by the difference of the rates times dt/dp.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from finger_pin.core.collision.broad_phase import rouse
from finger_pin.core.evaluation.attitude_charts import place_bodies, turn_small
from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Layers,
    Matrix,
    StructType,
    Vector,
    copy,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.events import cross, hold_all, last_before, look, rate_at, state_at, turned_after
from finger_pin.core.stepping.interpolation import Between, begin_of
from finger_pin.core.stepping.kink_sides import release
from finger_pin.core.stepping.radau import add, curvature, node, relax

# Entries of the memory.
STEP, TIME, SPLIT, LENGTH, MEMORY_SIZE = range(5)
# In how many parts a step is cut at most.
_SPLITS = 12.0
# How many steps long an interval is at most and at least, and how much more curved than is allowed S may be in it.
_LONGEST, _SHORTEST, _TOO_CURVED = 10.0, 0.05, 2.0
# How short an interval is not worth one, of the time.
_NOTHING = 1e-13
SINGULAR = -1


class Collocation(NamedTuple):
    """A motion of size n with p numbers, and its at most m intervals to be filled.

    Derivatives stand one number after the other, each in w places, n or a few more, which stay zero: `radau.LANES`.

    Attributes:
        model: Address of the bound `Model`.
        changed: Addresses of models with one number changed each, shape (p,); 0 where the rates do not feel it.
        within: Whether it changes laws alone, and so shares the memory of the model without, shape (p,).
        changes: By how much, shape (p,).
        motion: The steps.
        corners: One more than the row of ``shifts`` where inputs bend or jump at the end of a step, else 0, shape
            (steps,).
        shifts: How much later each corner is for a larger number, dt/dp, shape (corners, p).
        rows: Rows that may bend, shape (r,).
        columns: What changes its sign there, columns of the table of rows, shape (r,).
        held: Whether the row can be held on a side, shape (r,).
        leaders: Memory, the tension that sets lambda in (22), by controller, shape (l,); b = r + l bends in all.
        nodes: `radau.NODES`.
        memory: The step, the time, and how often the step has been cut so far; kept between calls.
        sides: Memory, on which side of each bend the motion is, shape (b,).
        before, between, after: Scratch, what changes its sign at each, shape (b,).
        derivative: S, changed in place, shape (p w,).
        rate: Memory, its rate, shape (p w,).
        bend: Memory, the rate of that, as far as it is known, shape (p w,).
        largest: Memory, the largest S so far, shape (p w,).
        scale: Sizes of the states, and ones, shape (w,).
        weight: Scratch, of each state in what is allowed, shape (p w,).
        allowed: How curved S may be in an interval, of its largest.
        matrix, sweep, back, slope: Of the method, as in `radau`; s nodes.
        state: Scratch, shape (n,).
        order: Scratch, shape (n,).
        torque: Scratch, by coordinate.
        part: Scratch, shape (n,).
        source, found: Scratch, shape (p w,).
        resolvents: Scratch, transposed, shape (s, w, w).
        given: Scratch, E at the nodes, shape (s, p w).
        known, nodal, rates: Scratch, S at the nodes and its rates there, shape (s, p w).
        ends: Filled with the ends of the intervals, shape (m,), s.
        solution: Filled with S at their begins and nodes, shape ((s + 1) m, p w).
    """

    model: int
    changed: Indices
    within: Indices
    changes: Vector
    motion: Between
    corners: Indices
    shifts: Matrix
    rows: Indices
    columns: Indices
    held: Indices
    leaders: Indices
    nodes: Vector
    memory: Vector
    sides: Vector
    before: Vector
    between: Vector
    after: Vector
    derivative: Vector
    rate: Vector
    bend: Vector
    largest: Vector
    scale: Vector
    weight: Vector
    allowed: float
    matrix: Matrix
    sweep: Matrix
    back: Vector
    slope: Vector
    state: Vector
    order: Indices
    torque: Vector
    part: Vector
    source: Vector
    found: Vector
    resolvents: Layers
    given: Matrix
    known: Matrix
    nodal: Matrix
    rates: Matrix
    ends: Vector
    solution: Matrix


COLLOCATION = StructType(Collocation)


@njit_always_inline
def _place(col: Any, step: int) -> None:
    """Place free bodies of all models by their attitudes at the begin of a step."""
    b = col.motion
    attitude = b.attitude if step == 0 else b.attitudes[step - 1]
    place_bodies(unpack(col.model, MODEL).tables, attitude)
    for k in range(col.changed.size):
        if col.changed[k] != 0:
            place_bodies(unpack(col.changed[k], MODEL).tables, attitude)


@njit_inline
def _awake(address: int) -> None:
    """Wake all contacts of a model, and release all rows from the sides of an earlier integration."""
    model = unpack(address, MODEL)
    release(model.tables, model.work.rows)
    rouse(model.tables, model.work)


@njit_always_inline
def _jump(col: Any, model: Any, step: int, corner: int) -> None:
    """Add to S the effect of a later jump of the inputs: (f before - f after) dt/dp."""
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
            col.derivative[k * col.scale.size + c] += (col.part[c] - model.rate[c]) * col.shifts[corner, k]


@njit_always_inline
def _turn(col: Any, step: int) -> None:
    """Let the angles of free bodies begin anew in S too, after a step."""
    b = col.motion
    for f in range(b.charts.size):
        i = b.charts[f]
        x = b.states[step]
        for k in range(col.changes.size):
            own, angles, rates = col.derivative[k * col.scale.size :], col.state[:3], col.part[:3]
            for r in range(3):
                angles[r], rates[r] = own[i + r], own[b.width + i + r]
            turn_small(x[i], x[i + 1], x[i + 2], x[b.width + i], x[b.width + i + 1], x[b.width + i + 2], angles, rates)
            for r in range(3):
                own[i + r], own[b.width + i + r] = angles[r], rates[r]


@njit_always_inline
def _interval(col: Any, model: Any, step: int, begin: float, end: float, looks: bool) -> Any:
    """Solve for S at the nodes between two times, of which the first is in a step.

    Returns:
        0 if it is solved, `SINGULAR` if a linear system is; else a time by which the motion has bent.
    """
    h, at = end - begin, step
    while looks and col.motion.ends[at] < end:
        # From one node to the next it may bend and bend back.
        look(col, model, at, col.motion.ends[at], col.after)
        if turned_after(col, col.after, col.after) < 1.0:
            return col.motion.ends[at]
        at += 1
    # The last node first: there most bends show, before anything is spent.
    for a in range(col.nodes.size - 1, -1, -1):
        time = end if a == col.nodes.size - 1 else begin + col.nodes[a] * h
        if looks:
            look(col, model, step, time, col.after)
            if turned_after(col, col.after, col.after) < 1.0:
                return time
        else:
            state_at(col.motion, step, time, col.state)
            rate_at(col.model, time, col.state)
        if not node(col, model, a, time, h):
            return float(SINGULAR)
    relax(col, h)
    return 0.0


@njit_always_inline
def _keep(col: Any, taken: int, begin: float, end: float) -> None:
    """Take an interval that is solved."""
    nodes = col.nodes.size
    first, last = taken * (nodes + 1), nodes - 1
    copy(col.derivative, col.solution[first])
    for a in range(nodes):
        copy(col.nodal[a], col.solution[first + 1 + a])
    copy(col.nodal[last], col.derivative)
    copy(col.rates[last], col.rate)
    col.bend[:] = 0.0
    for a in range(nodes):
        add(col.slope[a] / (end - begin), col.rates[a], col.bend)
    for i in range(col.largest.size):
        col.largest[i] = max(col.largest[i], abs(col.derivative[i]))
    col.ends[taken] = end


@njit_always_inline
def _latest(col: Any, step: int) -> Any:
    """Return the latest end of the interval that begins in a step: a knot of the inputs, or a restart of the angles."""
    b, close = col.motion, col.motion.charts.size > 0 or col.memory[SPLIT] >= _SPLITS
    while step < b.ends.size - 1 and not close and col.corners[step] == 0:
        step += 1
    return b.ends[step]


@njit_always_inline
def _solved(col: Any, model: Any, step: int, begin: float) -> Any:
    """Solve over an interval from a time in a step, as long as S is smooth enough.

    Returns:
        Its end, no later than the begin if it is nothing, and 1 if the motion bends there; `SINGULAR`.
    """
    memory, least, latest = col.memory, begin + _NOTHING * max(1.0, abs(begin)), _latest(col, step)
    own = col.motion.ends[step] - begin_of(col.motion, step)
    shortest = _SHORTEST * own
    length, bends = min(max(memory[LENGTH], shortest), _LONGEST * own), 0
    while True:
        end = begin + length
        if end + 0.1 * length >= latest:
            end = latest
        if end <= least:
            return end, bends
        behind = _interval(col, model, step, begin, end, bends == 0 and memory[SPLIT] < _SPLITS)
        if behind > 0.0:
            latest, bends = last_before(col, model, step, begin, behind), 1
            length = latest - begin
            continue
        if behind == SINGULAR:
            return end, SINGULAR
        curved = curvature(col) / col.allowed
        factor = min(max(0.9 * max(curved, 1e-6) ** (-1.0 / col.nodes.size), 0.3), 3.0)
        memory[LENGTH] = (end - begin) * factor
        if curved <= _TOO_CURVED or length <= shortest:
            return end, bends
        length, bends = max(memory[LENGTH], shortest), 0


@CompiledFunction
def collocate(address: int, _time: float) -> int:
    """Fill intervals of the `Collocation` at an address; return their number, or `SINGULAR`."""
    col = unpack(address, COLLOCATION)
    model, b, memory = unpack(col.model, MODEL), col.motion, col.memory
    taken, last = 0, b.ends.size - 1
    _awake(col.model)
    for k in range(col.changed.size):
        if col.changed[k] != 0:
            _awake(col.changed[k])
    hold_all(col)
    while memory[STEP] <= last and taken < col.ends.size:
        step, begin = int(memory[STEP]), memory[TIME]
        if b.charts.size > 0 and begin == begin_of(b, step):
            _place(col, step)
        end, bends = _solved(col, model, step, begin)
        if bends == SINGULAR:
            return SINGULAR
        if end > begin + _NOTHING * max(1.0, abs(begin)):
            _keep(col, taken, begin, end)
            taken += 1
        memory[TIME], anew = end, bends == 1
        if anew:
            cross(col)
            memory[SPLIT] += 1.0
        while step <= last and end >= b.ends[step]:
            if col.corners[step] > 0:
                _jump(col, model, step, col.corners[step] - 1)
                anew = True
            _turn(col, step)
            step += 1
            memory[SPLIT] = 0.0
        if anew:
            col.bend[:] = 0.0
        if anew and step <= last:
            memory[LENGTH] = b.ends[step] - begin_of(b, step)
        memory[STEP] = step
    return taken
