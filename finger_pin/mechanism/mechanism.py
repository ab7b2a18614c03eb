"""The model as coordinates and rows, and its evaluation: (18) for any mechanism.

    M(q) v' + h(q, v) = sum_k A_k(q)^T phi_k + J^T F,       q' = E(q) v
    (phi_k, z_k') = law_k(l_k, l_k', z_k, N_k, u_k, curvature_k, reading_k)

Coordinates are everything that has inertia: the joints of the tree, then lumps, which move along a line of their own
(the mass of a passive tendon, a rotor). Rows are everything that exerts force. The packed state is

    | q | v | z |

with the states z of the rows in the order in which their tables are listed. q and v have the same size N, but for a
spherical joint, whose four numbers in q are a unit quaternion (x, y, z, w).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.laws.law import Row
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.path_elements import PathKinematics, Paths, path_kinematics
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Energies, Rows, RowSignals
from finger_pin.mechanism.wiring import sort_tables
from finger_pin.typing import Array

#: Where the accelerations of coordinates that are moved along paths stand, after the numbers of `base_motion`.
PRESCRIBED_ACCELERATIONS = 27


class Sliding(NamedTuple):
    """Rows that slide evenly, or rest after it, however the coordinates move.

    Attributes:
        speeds: By table, the speeds of its rows along their arms, shape (..., k).
        at_rest: Whether they have come to rest: their states stay, what their speed makes is gone.
    """

    speeds: Mapping[str, Array]
    at_rest: bool


class Mechanism:
    """Coordinates and rows.

    Attributes:
        body: The tree of rigid bodies; its joints are the first coordinates.
        lumps: Names of the further coordinates.
        inertia: Of the lumps, shape (l,), kg or kg m2.
        listed: The tables, whose states follow each other in z.
        rows: The tables, in the order of evaluation.
        states: For every table in that order the range of its states in z.
        energies: Energies and powers of the rows.
        channels: Number of inputs from outside.
        wiring: One for all mechanisms that differ in parameters of laws and in inertias alone.
        moved: Whether the base moves along a path.
        prescribed: For coordinates that are moved along paths, the number of their acceleration among all; else -1.
        tendons: Names of the tables that are tendons, whose torque is also summed up apart.
    """

    def __init__(
        self,
        body: RigidBody,
        rows: Sequence[Rows],
        lumps: Sequence[str] = (),
        inertia: Array | None = None,
        channels: int = 0,
        moved: bool = False,
        prescribed: NDArray[np.int64] | None = None,
        tendons: Sequence[str] = (),
    ) -> None:
        """Join coordinates and rows, as wide as there are coordinates; more inputs than rows have if asked for."""
        self.body, self.lumps = body, tuple(lumps)
        self.inertia = np.zeros(0) if inertia is None else np.asarray(inertia, dtype=float)
        # The core evaluates contacts before all else.
        self.listed = tuple(sorted(rows, key=lambda table: table.law.arms == 1))
        self.rows = sort_tables(self.listed)
        self.moved, self.tendons, self.wiring = moved, tuple(tendons), object()
        self.prescribed = np.full(self.coordinates, -1) if prescribed is None else prescribed
        self.energies = Energies.from_rows(self.rows, moved, not moved and bool(np.any(self.prescribed >= 0)))
        self.channels = max([channels, *(int(table.channels.max(initial=-1)) + 1 for table in self.rows)])
        ends = dict(zip((t.group for t in self.listed), accumulate(t.states for t in self.listed), strict=True))
        self.states = [slice(ends[table.group] - table.states, ends[table.group]) for table in self.rows]
        self.state_count = max(ends.values(), default=0)

    @property
    def coordinates(self) -> int:
        """Number N of coordinates."""
        return int(self.body.model.nv) + len(self.lumps)

    @property
    def positions(self) -> int:
        """Length of q."""
        return int(self.body.model.nq) + len(self.lumps)

    @property
    def size(self) -> int:
        """Length of the packed state."""
        return self.positions + self.coordinates + self.state_count

    def split(self, x: Array) -> tuple[Array, Array, Array]:
        """Return q, v and z of packed states, shape (..., size).

        Raises:
            ValueError: If the last dimension has the wrong size.
        """
        if x.shape[-1] != self.size:
            raise ValueError(f"a packed state has {self.size} numbers, not {x.shape[-1]}")
        end = self.positions + self.coordinates
        return x[..., : self.positions], x[..., self.positions : end], x[..., end:]

    def linear_positions(self, q: Array) -> Array:
        """Return q as numbers that arms multiply, shape (..., N): zero for joints with a quaternion."""
        model = self.body.model
        if model.nq == model.nv:
            return q
        linear = np.zeros((*q.shape[:-1], self.coordinates))
        for joint in model.joints[1:]:
            if joint.nq == joint.nv:
                linear[..., joint.idx_v : joint.idx_v + joint.nv] = q[..., joint.idx_q : joint.idx_q + joint.nq]
        linear[..., model.nv :] = q[..., model.nq :]
        return linear

    def evaluate(
        self,
        x: Array,
        command: Array,
        force: Array | None = None,
        base: Array | None = None,
        sliding: Sliding | None = None,
    ) -> Evaluation:
        """Return everything at packed states: accelerations of joints (18) and of masses of passive tendons (13).

        Args:
            x: Shape (size,) or (m, size).
            command: Inputs u, shape (channels,) or (m, channels).
            force: At the tips, shape (3,) or (m, 3) for one, (t, 3) or (m, t, 3) for several, N, base frame.
            base: Motion of the base, the numbers of `base_motion`, shape (12 or more,) or (m, 12 or more), at rest by
                default; after `PRESCRIBED_ACCELERATIONS` of them those of what is moved along paths, zero by default.
            sliding: Rows whose states have settled, in place of those in x.
        """
        q, v, _ = self.split(x)
        joints, turning, lead = int(self.body.model.nv), q[..., : self.body.model.nq], x.shape[:-1]
        forces = self._forces(force, lead)
        rows, torque, tendon_torque = self._rows(x, np.asarray(command, dtype=float), forces, sliding)
        external = np.zeros_like(torque)
        if np.any(forces):
            external[..., :joints] = self.body.external_torque(turning, forces)
        net, power = torque + external, None
        if base is not None:
            net[..., :joints] += self._inertial(turning, v[..., :joints], base)
        acceleration = np.concatenate(
            [self.body.forward_dynamics(turning, v[..., :joints], net[..., :joints]), net[..., joints:] / self.inertia],
            axis=-1,
        )
        prescribed, prescribed_power = np.flatnonzero(self.prescribed >= 0), None
        if len(prescribed):
            columns = self.prescribed[prescribed] + PRESCRIBED_ACCELERATIONS
            acceleration[..., prescribed] = 0.0 if base is None else base[..., columns]
            prescribed_power = -np.sum(torque[..., prescribed] * v[..., prescribed], axis=-1)
        if base is not None and self.moved:
            power = self._base_power(turning, v[..., :joints], acceleration[..., :joints], base)
            if prescribed_power is not None:
                # What pushes against a world that stands still does no work; the palm feels it.
                power, prescribed_power = power + prescribed_power[..., None], None
        moving = self.body.position_rate(turning, v[..., :joints])
        rates = [rows[table.group].rate for table in self.listed if table.states]
        return Evaluation(
            energies=self.energies,
            rows=rows,
            torque=torque,
            tendon_torque=tendon_torque,
            external=external,
            acceleration=acceleration,
            base_power=np.zeros((*lead, 1)) if power is None and self.moved else power,
            prescribed_power=prescribed_power,
            rate=np.concatenate([moving, v[..., joints:], acceleration, *rates], axis=-1),
        )

    def row_signals(
        self, x: Array, command: Array, force: Array | None = None, sliding: Sliding | None = None
    ) -> dict[str, RowSignals]:
        """Return the signals of all tables, by name, without accelerations; arguments are those of `evaluate`."""
        return self._rows(x, np.asarray(command, dtype=float), self._forces(force, x.shape[:-1]), sliding)[0]

    def with_row_states(self, x: Array, rows: Mapping[str, RowSignals]) -> Array:
        """Return a packed state with the states that rows had in an evaluation."""
        state = np.array(x, dtype=float)
        z = self.split(state)[2]
        for table, part in zip(self.rows, self.states, strict=True):
            if table.states and table.law.arms == 1:
                z[..., part] = rows[table.group].row.state
        return state

    def _rows(
        self, x: Array, command: Array, forces: Array, sliding: Sliding | None
    ) -> tuple[dict[str, RowSignals], Array, Array]:
        """Return signals of all tables under inputs and forces at tips, and sums of A^T phi, of all and of tendons."""
        q, v, z = self.split(x)
        turning, linear, lead = q[..., : self.body.model.nq], self.linear_positions(q), x.shape[:-1]
        states = {table.group: z[..., part] for table, part in zip(self.rows, self.states, strict=True)}
        rows, earlier = dict[str, RowSignals](), dict[str, Array]()
        touching: list[tuple[Paths, Array]] = []
        torque, tendon_torque = np.zeros((2, *lead, self.coordinates))
        for table in self.rows:
            routed = self._routed(table, turning)
            arm = table.arm + routed.arm
            row = Row(
                linear @ table.measure.T + table.offset + routed.length,
                (arm @ v[..., None])[..., 0],
                states[table.group] if table.states else np.zeros((*lead, table.count)),
                self._load(table, earlier, turning, forces, touching),
                self._input(table, earlier, command, lead),
                np.abs(linear) @ table.bends.T + table.curvature_offset + routed.turn,
                reading=_weighted(table.readings, states, np.zeros((*lead, table.count))),
            )
            law: Any = table.law
            if sliding is not None and table.group in sliding.speeds:
                row = law.settled(row._replace(speed=sliding.speeds[table.group]), table.parameters)
                row = row._replace(speed=np.zeros_like(row.speed)) if sliding.at_rest else row
            exerted, rate, signals = law.act(arguments := law.arguments(row), table.parameters)
            rows[table.group], earlier[table.group] = RowSignals(table, arguments, exerted, rate, signals), exerted
            if table.law.arms > 1:
                touching.append((table.paths[:: table.law.arms], _vectors(exerted, routed.force, table.law.arms)))
            parts = (exerted[..., None, :] @ arm)[..., 0, :]
            torque, tendon_torque = torque + parts, tendon_torque + parts * (table.group in self.tendons)
        return rows, torque, tendon_torque

    def _forces(self, force: Array | None, lead: tuple[int, ...]) -> Array:
        """Return the forces at all tips, shape (..., t, 3)."""
        tips, forces = len(self.body.tips), np.zeros(3) if force is None else np.asarray(force, dtype=float)
        forces = forces[..., None, :] if tips == 1 or force is None else forces
        return np.broadcast_to(forces, (*lead, tips, 3))

    def _routed(self, table: Rows, q: Array) -> PathKinematics:
        """Return lengths, turns and arms of paths through space for a table, shape (..., k) and (..., k, N)."""
        if not table.routed:
            return PathKinematics(*np.zeros((4, 1)))
        if q.ndim == 1:
            return path_kinematics(self.body, q, table.paths, self.coordinates)
        kinematics = [vars(path_kinematics(self.body, one, table.paths, self.coordinates)) for one in q]
        return PathKinematics(**{name: np.array([each[name] for each in kinematics]) for name in kinematics[0]})

    def _inertial(self, q: Array, v: Array, base: Array) -> Array:
        """Return the torques that the motion of the base adds to gravity at rest, shape (..., n)."""
        if q.ndim > 1:
            return np.array([self._inertial(*each) for each in zip(q, v, base, strict=True)])
        still = np.zeros_like(v)
        return self.body.inverse_dynamics(q, v, still) - self.body.base_dynamics(q, v, still, base)[1]

    def _base_power(self, q: Array, v: Array, a: Array, base: Array) -> Array:
        if q.ndim > 1:
            return np.array([self._base_power(*each) for each in zip(q, v, a, base, strict=True)])
        return np.array([base[:6] @ self.body.base_dynamics(q, v, a, base)[0]])

    def _input(self, table: Rows, forces: Mapping[str, Array], command: Array, lead: tuple[int, ...]) -> Array:
        total = np.zeros((*lead, table.count))
        wired = table.channels >= 0
        total[..., wired] = command[..., table.channels[wired]]
        return _weighted(table.inputs, forces, total)

    def _load(
        self, table: Rows, forces: Mapping[str, Array], q: Array, tips: Array, touching: Sequence[tuple[Paths, Array]]
    ) -> Array:
        """Return N, the magnitude of a sum of earlier rows' forces, or of -e S + F for the pins of joints (17)."""
        load = _weighted(table.loads, forces, np.zeros((*q.shape[:-1], table.count)))
        if not (table.pins >= 0).any() or not (np.any(tips) or touching):
            return np.abs(load)
        directions = self.body.link_directions(q)[..., table.pins, :]
        beyond = self.body.supports[:, table.pins].T @ tips
        for paths, pushes in touching:
            beyond = beyond + self._passing(paths, table.pins) @ pushes
        total: Array = beyond - load[..., None] * directions
        magnitude = np.sqrt(np.sum(total * total, axis=-1))
        return np.where(table.pins >= 0, magnitude, np.abs(load))

    def _passing(self, paths: Paths, pins: NDArray[np.int64]) -> Array:
        """Return the count of passages of every path's force, less its reaction, through each pin, shape (k, m)."""
        supports = [set(each) for each in self.body.model.supports]
        pieces = [legs[0].piece for legs in paths]
        pairs = [[(pin + 1 in supports[p.ends[0].joint], pin + 1 in supports[p.joint]) for p in pieces] for pin in pins]
        return np.array([[float(first) - float(second) for first, second in row] for row in pairs])


def _weighted(weights: Mapping[str, Array], values: Mapping[str, Array], start: Array) -> Array:
    """Return a start and weighted sums of tables' values, shape (..., k)."""
    for group, matrix in weights.items():
        start = start + values[group] @ matrix.T
    return start


def _vectors(force: Array, directions: Array, arms: int) -> Array:
    """Return the sum of the forces of every contact as vectors, shape (..., m, 3)."""
    vectors = force[..., None] * directions
    return np.asarray(vectors.reshape(*vectors.shape[:-2], -1, arms, 3).sum(axis=-2))
