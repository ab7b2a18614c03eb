"""A mechanism as plain arrays, for the compiled core: bodies, rows and tips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, NoReturn

import numpy as np

from finger_pin.core.axes import along
from finger_pin.core.chains import Chains, read_chains, tree_arrays, weighed
from finger_pin.core.jit import IndexTable, Indices, Layers, Matrix, Vector, refuse_copy
from finger_pin.core.path_tables import Paths, reached, read_paths
from finger_pin.core.row_tables import Groups, row_arrays
from finger_pin.description.caching import memoised
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows
from finger_pin.typing import Array


class Tables(NamedTuple):
    """A mechanism with n bodies, N coordinates, K rows in G groups, and t tips.

    A joint of several coordinates is a chain of bodies with one each, of which the last has the mass; the
    three that turn a free body start from its attitude (`attitude_charts`).

    Attributes:
        parents: Of the bodies, -1 for the base, shape (n,).
        roots: First body of the tree that each belongs to, shape (n,): trees do not feel each other's inertia.
        kinds: 1 where a body slides, 0 where it turns, shape (n,).
        bodies: Placement and inertia, columns `BODY`, shape (n, columns).
        charts: First of the three bodies that turn a free one, shape (f,).
        chart_frames: Rotation of each one's spherical joint in the body before it, shape (f, 3, 3).
        prescribed: For coordinates that are moved along paths, the number of their acceleration; -1 else, shape (N,).
        gravity: Shape (3,), m/s2.
        lumps: Inertia of the other coordinates, shape (N - n,).
        tip_body: Shape (t,).
        tip_offset: In the frame of the body, shape (t, 3), m.
        tip_force: Shape (t, 3), N, base frame; changed in place.
        has_tip_force: Whether forces at the tips count.
        parent_links: Body that has the link before each joint, -1 for the base, shape (n,).
        directions: Unit vector of that link in its frame, shape (n, 3).
        groups: Tables of rows, and the addresses of their laws.
        energies: Of stored energy and powers of each group, places in `Energies` or -1, shape (G, 1 + most powers).
        parameters: Shape (most parameters, K).
        offset: Shape (K,).
        arm_start: First index of the row's arm in the following, shape (K + 1,).
        arm_at: Coordinates that a row acts on or measures, shape (arms,).
        arm_row: The row, shape (arms,).
        arm: Torque per force there, shape (arms,).
        measure: dl/dq there, shape (arms,).
        state: Index of each row's state in z, -1 without one, shape (K,).
        state_row: The row of each state, shape (states,).
        touch: 1 for the first of the rows of a contact, 2 for the others, 0 for all else, shape (K,).
        contact_rows: Number of rows of contacts, which stand before all others.
        contact_arms: Number of rows of each contact.
        channel: Index of its input from outside, -1 without one, shape (K,).
        input_rows: Rows that have an input, from outside or from earlier rows, ascending.
        input_start: First index of the terms of its input from earlier rows in ``terms``, shape (K + 1,).
        load_start: First index of the terms of its load, shape (K + 1,).
        terms: Earlier rows, shape (terms,).
        weights: Their weights, shape (terms,).
        read_start: First index of the states that a row reads, shape (K + 1,).
        read_at: Their indices in z, shape (readings,).
        read_row: The row, shape (readings,).
        read_weight: Their weights, shape (readings,).
        read_states: States that any row reads, shape (R,).
        read_place: Of every state its place among these, -1 for none, shape (states,).
        joint_pin: The body whose pin the row is, -1 for none, shape (K,).
        supported_by: One where a force at a tip passes the pin of a body, shape (t, n).
        bend_start: First index of the row's bends, shape (K + 1,).
        bend_at: Coordinates that bend its path, shape (bends,).
        bend_row: The row, shape (bends,).
        bend: Curvature per |q| there, shape (bends,).
        curvature_offset: Shape (K,).
        paths: Pieces of paths through space.
    """

    parents: Annotated[Indices, along("body", of="body")]
    roots: Annotated[Indices, along("body", of="body")]
    kinds: Annotated[Indices, along("body")]
    bodies: Annotated[Matrix, along("body", "c")]
    charts: Annotated[Indices, along("chart", of="body")]
    chart_frames: Annotated[Layers, along("chart", "x", "y")]
    prescribed: Annotated[Indices, along("coordinate")]
    gravity: Vector
    lumps: Annotated[Vector, along("lump")]
    tip_body: Annotated[Indices, along("tip", of="body")]
    tip_offset: Annotated[Matrix, along("tip", "x")]
    tip_force: Annotated[Matrix, along("tip", "x")]
    has_tip_force: bool
    parent_links: Annotated[Indices, along("body", of="body")]
    directions: Annotated[Matrix, along("body", "x")]
    groups: Groups
    energies: Annotated[IndexTable, along("group", "c")]
    parameters: Annotated[Matrix, along("c", "row")]
    offset: Annotated[Vector, along("row")]
    arm_start: Annotated[Indices, along("row", starts="arm")]
    arm_at: Annotated[Indices, along("arm", of="coordinate")]
    arm_row: Annotated[Indices, along("arm", of="row")]
    arm: Annotated[Vector, along("arm")]
    measure: Annotated[Vector, along("arm")]
    state: Annotated[Indices, along("row", of="state")]
    state_row: Annotated[Indices, along("state", of="row")]
    touch: Annotated[Indices, along("row")]
    contact_rows: int
    contact_arms: int
    channel: Annotated[Indices, along("row", of="channel")]
    input_rows: Annotated[Indices, along("input row", of="row")]
    input_start: Annotated[Indices, along("row", starts="term")]
    load_start: Annotated[Indices, along("row", starts="term")]
    terms: Annotated[Indices, along("term", of="row")]
    weights: Annotated[Vector, along("term")]
    read_start: Annotated[Indices, along("row", starts="reading")]
    read_at: Annotated[Indices, along("reading", of="state")]
    read_row: Annotated[Indices, along("reading", of="row")]
    read_weight: Annotated[Vector, along("reading")]
    read_states: Annotated[Indices, along("read state", of="state")]
    read_place: Annotated[Indices, along("state", of="read state")]
    joint_pin: Annotated[Indices, along("row", of="body")]
    supported_by: Annotated[Matrix, along("tip", "body")]
    bend_start: Annotated[Indices, along("row", starts="bend")]
    bend_at: Annotated[Indices, along("bend", of="coordinate")]
    bend_row: Annotated[Indices, along("bend", of="row")]
    bend: Annotated[Vector, along("bend")]
    curvature_offset: Annotated[Vector, along("row")]
    paths: Paths

    def __reduce__(self) -> NoReturn:
        """Refuse: addresses of laws are those of one process."""
        refuse_copy(self)


def build_tables(mechanism: Mechanism) -> Tables:
    """Return the arrays of a mechanism: those of its structure, which is read once, and its numbers.

    Pinocchio's model is the source of the rigid body. Arrays that change in place are the caller's own.

    Raises:
        InputError: If a joint neither turns nor slides about a fixed axis, nor translates or is spherical.
    """
    body = mechanism.body
    chains, structure = _structure(mechanism)
    return Tables(
        prescribed=mechanism.prescribed,
        lumps=mechanism.inertia,
        bodies=weighed(chains, body.model),
        gravity=np.array(body.model.gravity.linear),
        tip_force=np.zeros((len(body.tips), 3)),
        has_tip_force=False,
        parameters=_parameters(mechanism.rows),
        **structure,
    )


def _parameters(rows: Sequence[Rows]) -> Array:
    """Return the parameters of the laws of all rows, shape (most parameters, K)."""
    ends = np.cumsum([0, *(table.count for table in rows)])
    parameters = np.zeros((max((len(table.law.parameters) for table in rows), default=0), ends[-1]))
    for table, begin, end in zip(rows, ends[:-1], ends[1:], strict=True):
        parameters[: len(table.parameters), begin : end : table.law.arms] = table.parameters
    return parameters


def _wired(mechanism: Mechanism) -> tuple[Any, ...]:
    states = tuple(each.start for each in mechanism.states)
    return (mechanism.body.topology, states, *(each.structure_key for each in mechanism.rows))


# Inertias and parameters of laws change from run to run; bodies' places and how rows are wired seldom do.
@memoised(_wired)
def _structure(mechanism: Mechanism) -> tuple[Chains, dict[str, Any]]:
    """Return all but masses, gravity and the parameters of laws: places of bodies, wiring, arms and paths of rows."""
    rows, chains = mechanism.rows, read_chains(mechanism.body.model)
    paths = read_paths([path for table in rows for path in table.paths], chains)
    routed = reached(paths, sum(table.count for table in rows), mechanism.coordinates)
    return chains, {"paths": paths, **tree_arrays(mechanism.body, chains), **row_arrays(mechanism, routed)}
