"""Arrays of the frictions on the device: what does not change, and what a step changes."""

import warp as wp

from finger_pin.exchange.mujoco_friction import COULOMB, HARDENING, SIGNALS

#: Numbers of the law, from coulomb to curvature_offset.
LAW = HARDENING + 1 - COULOMB
#: Of each friction in `State.memory`: the bristles' force, the force of limits and equalities, three of contacts.
BRISTLE, HELD, CONTACT, MEMORY = 0, 1, 2, 5
#: Of each row: F - x, c + b, and the most that it exerts.
PULL, DAMP, LIMIT, TERMS = range(4)
#: The clock of a world whose last step is not to be finished, s.
NEVER = -1e30


@wp.struct
class Table:
    """Frictions as `PluginFriction` has them; lists of each stand one after the other, and ``*_first`` where.

    Attributes:
        kind: Of the friction.
        element: Tendon or joint.
        trunk: Friction whose tendon pulls it: of a branch that of the cord before the pulley, else itself.
        row: Degree of freedom, or nv plus tendon.
        ratio: Its speed over the row's.
        share: Of a link its tension over the joint's drive, of a branch the part of the cord's tension.
        held: Whether limits or equalities pull it too.
        tendons: Frictions of tendons.
        pins: Frictions of joints.
        actuators: Those that pull it, by friction.
        bends: Joints that bend it, with weights.
        loads: Of a pin, the frictions whose tension loads it.
        sharing: Frictions of a row.
        row_of: Index of the row of a degree of freedom or tendon, -1 without friction.
    """

    kind: wp.array[int]
    element: wp.array[int]
    trunk: wp.array[int]
    row: wp.array[int]
    ratio: wp.array[float]
    share: wp.array[float]
    held: wp.array[int]
    tendons: wp.array[int]
    pins: wp.array[int]
    actuators_first: wp.array[int]
    actuators: wp.array[int]
    bends_first: wp.array[int]
    bends: wp.array[int]
    weights: wp.array[float]
    loads_first: wp.array[int]
    loads: wp.array[int]
    sharing_first: wp.array[int]
    sharing: wp.array[int]
    row_of: wp.array[int]


@wp.struct
class State:
    """What a step changes; worlds, then frictions.

    Attributes:
        law: Coefficients, first axis in the order of `PluginFriction.law`.
        signals: First axis level, friction, tension, turn.
        memory: Last axis `BRISTLE`, `HELD`, `CONTACT`.
        following: The loads that the last step leaves for the next; last axis as of ``memory``.
        delivered: Tension behind the friction, N.
        terms: Parts of rows; last axis as `TERMS`.
        arms: Tendons' Jacobian of the last step.
        address: The solver's row of each row of friction, -1 without.
        clock: Time at which the last step started, s; `NEVER` where nothing is to be finished.
    """

    law: wp.array3d[float]
    signals: wp.array3d[float]
    memory: wp.array3d[float]
    following: wp.array3d[float]
    delivered: wp.array2d[float]
    terms: wp.array3d[float]
    arms: wp.array2d[float]
    address: wp.array2d[int]
    clock: wp.array[float]


def allocate(worlds: int, frictions: int, rows: int, arms: int) -> State:
    """Return the state of worlds at rest."""
    state = State()
    state.law = wp.zeros((LAW, worlds, frictions), dtype=float)
    state.signals = wp.zeros((SIGNALS, worlds, frictions), dtype=float)
    state.memory = wp.zeros((worlds, frictions, MEMORY), dtype=float)
    state.following = wp.zeros((worlds, frictions, MEMORY), dtype=float)
    state.delivered = wp.zeros((worlds, frictions), dtype=float)
    state.terms = wp.zeros((worlds, frictions, TERMS), dtype=float)
    state.arms = wp.zeros((worlds, arms), dtype=float)
    state.address = wp.full((worlds, rows), -1, dtype=int)
    state.clock = wp.full((worlds,), NEVER, dtype=float)
    return state
