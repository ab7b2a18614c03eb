"""The parameters of a mechanism: all numbers that a scenario's keys change while the structure stays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from finger_pin.core.jit import Layers, Matrix, Vector
from finger_pin.core.tables.axes import along
from finger_pin.core.tables.chains import Chains, read_chains, tree_arrays, weighed
from finger_pin.core.tables.path_tables import PathParameters, coordinates_of_paths, read_paths
from finger_pin.core.tables.row_tables import row_arrays, stacked, term_weights
from finger_pin.core.tables.structure import Structure
from finger_pin.description.caching import memoised
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rows import Rows
from finger_pin.typing import Array


class Parameters(NamedTuple):
    """Numbers of a mechanism, for one `Structure`.

    Arrays that change in place belong to one owner; see `separate`.

    Attributes:
        bodies: Placement and inertia, columns `BODY`, shape (n, columns); free bodies turn with their attitude.
        chart_frames: Rotation of each free body's spherical joint in the body before it, shape (f, 3, 3).
        gravity: Shape (3,), m/s2.
        lumps: Inertia of the coordinates that are no body's, shape (N - n,).
        tip_offset: In the frame of the body, shape (t, 3), m.
        tip_force: Shape (t, 3), N, base frame; changed in place.
        has_tip_force: Whether forces at the tips count.
        directions: Unit vector of the link before each joint in its frame, shape (n, 3).
        laws: Of all rows, shape (most parameters, K).
        offset: Length of a row at q = 0, shape (K,).
        arm: Torque per force, shape (arms,).
        measure: dl/dq there, shape (arms,).
        weights: Of earlier rows in inputs and loads, shape (terms,).
        read_weight: Of states in readings, shape (readings,).
        bend: Curvature per |q|, shape (bends,).
        curvature_offset: Shape (K,).
        paths: Of the pieces of paths through space.
    """

    bodies: Annotated[Matrix, along("body", "c")]
    chart_frames: Annotated[Layers, along("chart", "x", "y")]
    gravity: Vector
    lumps: Annotated[Vector, along("lump")]
    tip_offset: Annotated[Matrix, along("tip", "x")]
    tip_force: Annotated[Matrix, along("tip", "x")]
    has_tip_force: bool
    directions: Annotated[Matrix, along("body", "x")]
    laws: Annotated[Matrix, along("c", "row")]
    offset: Annotated[Vector, along("row")]
    arm: Annotated[Vector, along("arm")]
    measure: Annotated[Vector, along("arm")]
    weights: Annotated[Vector, along("term")]
    read_weight: Annotated[Vector, along("reading")]
    bend: Annotated[Vector, along("bend")]
    curvature_offset: Annotated[Vector, along("row")]
    paths: PathParameters

    def separate(self) -> Parameters:
        """Return the same with separate memory for what changes in place."""
        return self._replace(bodies=self.bodies.copy(), tip_force=self.tip_force.copy())

    def changed(self, mechanism: Mechanism, before: Mechanism) -> Parameters:
        """Return those of a mechanism that shares its wiring with the one of these."""
        other = self._replace(laws=_laws(mechanism.rows))
        if mechanism.body is before.body:
            return other
        return other._replace(bodies=weighed(_structure(mechanism)[0], mechanism.body.model))


def compile_mechanism(mechanism: Mechanism) -> tuple[Structure, Parameters]:
    """Return the structure of a mechanism, which is built once for one wiring, and its parameters.

    Pinocchio's model is the source of the rigid body.
    """
    body, rows = mechanism.body, mechanism.rows
    chains, structure, geometry = _structure(mechanism)
    arms, bends = (structure.arm_row, structure.arm_at), (structure.bend_row, structure.bend_at)
    return structure, Parameters(
        bodies=weighed(chains, body.model),
        gravity=np.array(body.model.gravity.linear),
        lumps=mechanism.inertia,
        tip_force=np.zeros((len(body.tips), 3)),
        has_tip_force=False,
        laws=_laws(rows),
        offset=np.concatenate([np.zeros(0), *(table.offset for table in rows)]),
        arm=stacked(mechanism, "arm")[arms],
        measure=stacked(mechanism, "measure")[arms],
        weights=np.concatenate([term_weights(rows, "inputs"), term_weights(rows, "loads")]),
        read_weight=term_weights(rows, "readings"),
        bend=stacked(mechanism, "bends")[bends],
        curvature_offset=np.concatenate([np.zeros(0), *(table.curvature_offset for table in rows)]),
        **geometry,
    )


def _laws(rows: Sequence[Rows]) -> Array:
    """Return the parameters of the laws of all rows, shape (most parameters, K)."""
    ends = np.cumsum([0, *(table.count for table in rows)])
    parameters = np.zeros((max((len(table.law.parameters) for table in rows), default=0), ends[-1]))
    for table, begin, end in zip(rows, ends[:-1], ends[1:], strict=True):
        parameters[: len(table.parameters), begin : end : table.law.arms] = table.parameters
    return parameters


def _wiring(mechanism: Mechanism) -> tuple[Any, ...]:
    states = tuple(each.start for each in mechanism.states)
    moved = mechanism.prescribed.tobytes()
    return (mechanism.body.topology, states, moved, *(each.structure_key for each in mechanism.rows))


@memoised(_wiring)
def _structure(mechanism: Mechanism) -> tuple[Chains, Structure, dict[str, Any]]:
    """Return the chains and the structure of a mechanism, and the parameters that follow from its bodies' places."""
    rows, chains = mechanism.rows, read_chains(mechanism.body.model)
    paths, path_parameters = read_paths([path for table in rows for path in table.paths], chains)
    routed = coordinates_of_paths(paths, sum(table.count for table in rows), mechanism.coordinates)
    tree, places = tree_arrays(mechanism.body, chains)
    structure = Structure(paths=paths, prescribed=mechanism.prescribed, **tree, **row_arrays(mechanism, routed))
    return chains, structure, {"paths": path_parameters, **places}
