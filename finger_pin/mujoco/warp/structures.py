"""Arrays of the frictions on the device: the constant ones, and those that a step changes."""

from typing import Any, NamedTuple

import warp as wp

from finger_pin.exchange.mujoco_friction import SIGNALS, Coefficients, SignalPlaces
from finger_pin.mujoco.constraint_rows import TERMS, RowTerms


class MemoryColumns(NamedTuple):
    """Columns of `State.memory`: the bristles' force, that of limits and equalities, and that of contacts."""

    bristle: int
    constraint_tension: int
    contact_x: int
    contact_y: int
    contact_z: int


def _field_indices(columns: Any) -> Any:
    """Return the place of each field of a NamedTuple, as constants of a class, which Warp reads as they are."""
    return type(columns.__name__, (), {name: place for place, name in enumerate(columns._fields)})


LAW, SIGNAL, MEMORY, TERM = map(_field_indices, (Coefficients, SignalPlaces, MemoryColumns, RowTerms))
LAWS, MEMORIES = len(Coefficients._fields), len(MemoryColumns._fields)
_Vector5 = wp.types.vector(length=5, dtype=float)
#: The clock of a world whose last step is not to be finished, s.
NEVER = -1e30


@wp.struct
class Table:
    """Frictions as `PluginFriction` has them; lists stand one after the other, each from its ``*_first`` on.

    Attributes:
        kind: Of the friction.
        element: Tendon or joint.
        trunk: Friction whose tendon pulls it: of a branch that of the cord before the pulley, else itself.
        row: Degree of freedom, or nv plus tendon.
        ratio: Its speed over the row's.
        share: Of a link its tension over the joint's drive, of a branch the part of the cord's tension.
        constrained: Whether limits or equalities pull it too.
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
    constrained: wp.array[int]
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
    """Arrays that a step changes; worlds, then frictions.

    Attributes:
        law: Coefficients, first axis `LAW`.
        signals: First axis `SIGNAL`.
        memory: Last axis `MEMORY`.
        following: The loads that the last step leaves for the next; last axis as of ``memory``.
        delivered: Tension behind the friction, N.
        terms: Parts of rows; last axis `TERM`.
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


@wp.struct
class TendonInputs:
    """Fields of MuJoCo's model and data that frictions of tendons read, under its names."""

    nv: int
    timestep: wp.array[float]
    actuator_gear: wp.array2d[wp.spatial_vector]
    actuator_forcelimited: wp.array[bool]
    actuator_forcerange: wp.array2d[wp.vec2]
    tendon_actfrclimited: wp.array[bool]
    tendon_actfrcrange: wp.array2d[wp.vec2]
    tendon_stiffness: wp.array2d[float]
    tendon_damping: wp.array2d[float]
    tendon_lengthspring: wp.array2d[wp.vec2]
    ten_J_rowadr: wp.array[int]
    ten_J_rownnz: wp.array[int]
    ten_J_colind: wp.array[int]
    jnt_qposadr: wp.array[int]
    actuator_force: wp.array2d[float]
    ten_length: wp.array2d[float]
    ten_velocity: wp.array2d[float]
    time: wp.array[float]
    qpos: wp.array2d[float]
    qvel: wp.array2d[float]
    ten_J: wp.array2d[float]
    ten_wrapadr: wp.array2d[int]
    ten_wrapnum: wp.array2d[int]
    wrap_obj: wp.array2d[wp.vec2i]
    wrap_xpos: wp.array2d[wp.spatial_vector]


@wp.struct
class PinInputs:
    """Fields that frictions of joints read, likewise."""

    timestep: wp.array[float]
    body_parentid: wp.array[int]
    body_jntadr: wp.array[int]
    body_jntnum: wp.array[int]
    jnt_bodyid: wp.array[int]
    qvel: wp.array2d[float]
    xanchor: wp.array2d[wp.vec3]
    xmat: wp.array2d[wp.mat33]


@wp.struct
class RowInputs:
    """Inputs of the solver's rows of friction, and the rows: ``type`` to ``frictionloss`` of ``efc``."""

    nv: int
    timestep: wp.array[float]
    qvel: wp.array2d[float]
    ten_velocity: wp.array2d[float]
    ne: wp.array[int]
    nf: wp.array[int]
    njmax: int
    type: wp.array2d[int]
    id: wp.array2d[int]
    D: wp.array2d[float]
    aref: wp.array2d[float]
    frictionloss: wp.array2d[float]


@wp.struct
class ForceInputs:
    """The solver's rows with their forces, of ``efc``, and the elements that they belong to."""

    nefc: wp.array[int]
    njmax: int
    type: wp.array2d[int]
    id: wp.array2d[int]
    force: wp.array2d[float]
    eq_type: wp.array[int]
    eq_obj1id: wp.array[int]
    eq_obj2id: wp.array[int]
    geom_bodyid: wp.array[int]
    body_isdofancestor: wp.array2d[int]
    dim: wp.array[int]
    geom: wp.array[wp.vec2i]
    frame: wp.array[wp.mat33]
    friction: wp.array[_Vector5]
    efc_address: wp.array2d[int]


def allocate(worlds: int, frictions: int, rows: int, arms: int) -> State:
    """Return the state of worlds at rest."""
    state = State()
    state.law = wp.zeros((LAWS, worlds, frictions), dtype=float)
    state.signals = wp.zeros((SIGNALS, worlds, frictions), dtype=float)
    state.memory = wp.zeros((worlds, frictions, MEMORIES), dtype=float)
    state.following = wp.zeros((worlds, frictions, MEMORIES), dtype=float)
    state.delivered = wp.zeros((worlds, frictions), dtype=float)
    state.terms = wp.zeros((worlds, frictions, TERMS), dtype=float)
    state.arms = wp.zeros((worlds, arms), dtype=float)
    state.address = wp.full((worlds, rows), -1, dtype=int)
    state.clock = wp.full((worlds,), NEVER, dtype=float)
    return state
