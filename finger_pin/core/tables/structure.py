"""The structure of a mechanism: topology, indices and addresses of code, all that other numbers leave as it is."""

from __future__ import annotations

from typing import Annotated, NamedTuple, NoReturn

from finger_pin.core.jit import IndexTable, Indices, Matrix, refuse_copy
from finger_pin.core.tables.axes import along
from finger_pin.core.tables.path_tables import PathStructure
from finger_pin.core.tables.row_tables import Groups


class Structure(NamedTuple):
    """A mechanism with n bodies, N coordinates, K rows in G groups, and t tips; compared by identity.

    A joint of several coordinates is a chain of bodies with one each, of which the last has the mass; the
    three that turn a free body start from its attitude (`attitude_charts`).

    Attributes:
        parents: Of the bodies, -1 for the base, shape (n,).
        roots: First body of the tree that each belongs to, shape (n,): trees do not feel each other's inertia.
        kinds: 1 where a body slides, 0 where it turns, shape (n,).
        charts: First of the three bodies that turn a free one, shape (f,).
        prescribed: For coordinates that are moved along paths, the number of their acceleration; -1 else, shape (N,).
        tip_body: Shape (t,).
        parent_links: Body that has the link before each joint, -1 for the base, shape (n,).
        groups: Tables of rows, and the addresses of their laws.
        energies: Of stored energy and powers of each group, places in `Energies` or -1, shape (G, 1 + most powers).
        arm_start: First index of the row's arm in the following, shape (K + 1,).
        arm_at: Coordinates that a row acts on or measures, shape (arms,).
        arm_row: The row, shape (arms,).
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
        read_start: First index of the states that a row reads, shape (K + 1,).
        read_at: Their indices in z, shape (readings,).
        read_row: The row, shape (readings,).
        read_states: States that any row reads, shape (R,).
        read_place: Of every state its place among these, -1 for none, shape (states,).
        joint_pin: The body whose pin the row is, -1 for none, shape (K,).
        supported_by: One where a force at a tip passes the pin of a body, shape (t, n).
        bend_start: First index of the row's bends, shape (K + 1,).
        bend_at: Coordinates that bend its path, shape (bends,).
        bend_row: The row, shape (bends,).
        paths: Pieces of paths through space.
    """

    parents: Annotated[Indices, along("body", of="body")]
    roots: Annotated[Indices, along("body", of="body")]
    kinds: Annotated[Indices, along("body")]
    charts: Annotated[Indices, along("chart", of="body")]
    prescribed: Annotated[Indices, along("coordinate")]
    tip_body: Annotated[Indices, along("tip", of="body")]
    parent_links: Annotated[Indices, along("body", of="body")]
    groups: Groups
    energies: Annotated[IndexTable, along("group", "c")]
    arm_start: Annotated[Indices, along("row", starts="arm")]
    arm_at: Annotated[Indices, along("arm", of="coordinate")]
    arm_row: Annotated[Indices, along("arm", of="row")]
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
    read_start: Annotated[Indices, along("row", starts="reading")]
    read_at: Annotated[Indices, along("reading", of="state")]
    read_row: Annotated[Indices, along("reading", of="row")]
    read_states: Annotated[Indices, along("read state", of="state")]
    read_place: Annotated[Indices, along("state", of="read state")]
    joint_pin: Annotated[Indices, along("row", of="body")]
    supported_by: Annotated[Matrix, along("tip", "body")]
    bend_start: Annotated[Indices, along("row", starts="bend")]
    bend_at: Annotated[Indices, along("bend", of="coordinate")]
    bend_row: Annotated[Indices, along("bend", of="row")]
    paths: PathStructure

    def __reduce__(self) -> NoReturn:
        """Refuse: addresses of laws are those of one process."""
        refuse_copy(self)

    def __eq__(self, other: object) -> bool:
        """Return whether it is the same one: all mechanisms of one wiring share it."""
        return self is other

    def __hash__(self) -> int:
        """Return a hash of the identity."""
        return id(self)
