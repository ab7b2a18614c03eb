"""The packed state vector, whose order and sizes only this module knows; kinematics and energies of a motion.

    | theta |  o  | p | theta_m | theta' |  o' | p' | theta_m' |  z  | F^s they hold | tendons | joints | gears |
    |   n   | 7 f | p |    m    |   n    | 6 f | p  |    m     | 2 c |       h       |    t    |   n    |   m   |

n joints, f free objects (o is position and quaternion; o' velocity and angular velocity), t tendons, p of them passive,
m motors, h tendons on spools and halves of passive ones with hysteresis, these first, c contacts with bristles bent by
z: 19 numbers for the paper's finger, which has neither motors nor contacts. States of drives of one's own follow what
tendons hold, those of other rows of one's own follow all. Where objects stand in the world around a palm that moves,
the six joints of the world that it sees follow o and o'. Of a tree, states of its actuators follow z, and F^s of the
tendons that these pull, and of branches behind pulleys, that of the other tendons. Spools of motors whose gears have
play stand before theta_m and theta_m'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.caching import cached_property
from finger_pin.exceptions import InputError
from finger_pin.typing import Array


class Block(NamedTuple):
    """A kind of numbers of the state.

    Attributes:
        unit: Of its numbers.
        scale: Typical magnitudes for absolute tolerances; of several, which take turns, one for each number.
        variable: The variable of a result that has it, from which a start may be read; empty where tables have it.
        long_name: Of that variable.
        dimension: Of that variable, besides time.
        equation: Of the paper.
    """

    unit: str
    scale: tuple[float, ...] = (1.0,)
    variable: str = ""
    long_name: str = ""
    dimension: str = ""
    equation: str = ""


def _of(*entries: Any) -> dict[str, Block]:
    return {"block": Block(*entries)}


# A block that is left out.
_ZEROS: Any = None


def as_floats(name: str, value: ArrayLike, size: int, *, single: bool = False) -> Array:
    """Return an argument as floats of shape (..., size), or (size,) if ``single``.

    Raises:
        InputError: If it is not; ``name`` names the argument.
    """
    try:
        values = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(())
    if values.ndim == 0 or values.shape[-1] != size or (single and values.ndim > 1):
        shape = list(values.shape) if values.ndim else type(value).__name__
        raise InputError(name, f"must be numbers of shape ({'' if single else '..., '}{size}{',' * single})", shape)
    return values


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """The state by name, in the order of the packed vector; blocks may be left out for zeros.

    Every array may have leading dimensions, such as time. This is the one list of all blocks: packing, tolerances,
    starts and the variables of results read it.

    Attributes:
        position: theta, shape (..., n), rad.
        object_pose: Position, m, base frame, and unit quaternion x, y, z, w of every free object, shape (..., 7 f).
        world_position: Of the world that a palm sees: less its roll, pitch, yaw, rad, x, y and z, m, shape (..., 6);
            (..., 0) where nothing stands there.
        passive_position: p_5, shape (..., p), m.
        spool_position: theta_s of motors whose gears have play, shape (..., l), rad.
        motor_position: theta_m, shape (..., m), rad.
        velocity: theta', shape (..., n), rad/s.
        object_velocity: Velocity, m/s, base frame, and angular velocity, rad/s, in its own, shape (..., 6 f).
        world_velocity: Rate of `world_position`, rad/s and m/s.
        passive_velocity: p_5', shape (..., p), m/s.
        spool_velocity: theta_s', shape (..., l), rad/s.
        motor_velocity: theta_m', shape (..., m), rad/s.
        contact_bend: z of the contacts, of two tangents each, and of the spin where there is torsional friction,
            shape (..., 2 c) or (..., 3 c), m.
        actuator_state: States of a tree's actuators that have some, shape (..., k).
        elastic_stiction: F^s that tendons hold against their stretch, halves of passive ones first, shape (..., h), N.
        drives: States of a user's drives, shape (..., d).
        tendon_stiction: F^s of the tendons, shape (..., t), N.
        canal_stiction: F^s of a tree's tendons that no drive pulls, and of branches behind pulleys, shape (..., c), N.
        joint_stiction: F^s of the joints, shape (..., n), N m.
        gearbox_stiction: F^s of the gearboxes, shape (..., m), N m.
        further: States of a user's other rows, shape (..., f).
    """

    position: Array = field(default=_ZEROS, metadata=_of("rad", (1.0,), "joint_position", "joint angle", "joint"))
    # An object moves by centimetres where a joint turns by a radian.
    object_pose: Array = field(default=_ZEROS, metadata=_of("m, 1", (*3 * (1e-2,), *4 * (1.0,))))
    world_position: Array = field(default=_ZEROS, metadata=_of("rad, m", (*3 * (1.0,), *3 * (1e-2,))))
    passive_position: Array = field(
        default=_ZEROS,
        metadata=_of("m", (1e-3,), "passive_position", "position of the lumped mass", "passive_tendon", "13"),
    )
    spool_position: Array = field(
        default=_ZEROS, metadata=_of("rad", (1.0,), "spool_position", "angle of a spool behind play", "spool")
    )
    motor_position: Array = field(
        default=_ZEROS, metadata=_of("rad", (1.0,), "motor_position", "angle of the spool", "motor")
    )
    velocity: Array = field(default=_ZEROS, metadata=_of("rad/s", (10.0,), "joint_velocity", "joint velocity", "joint"))
    object_velocity: Array = field(default=_ZEROS, metadata=_of("m/s, rad/s", (*3 * (0.1,), *3 * (10.0,))))
    world_velocity: Array = field(default=_ZEROS, metadata=_of("rad/s, m/s", (*3 * (10.0,), *3 * (0.1,))))
    passive_velocity: Array = field(
        default=_ZEROS,
        metadata=_of("m/s", (0.1,), "passive_velocity", "velocity of the lumped mass", "passive_tendon", "13"),
    )
    spool_velocity: Array = field(
        default=_ZEROS, metadata=_of("rad/s", (10.0,), "spool_velocity", "velocity of a spool behind play", "spool")
    )
    motor_velocity: Array = field(
        default=_ZEROS, metadata=_of("rad/s", (10.0,), "motor_velocity", "velocity of the spool", "motor")
    )
    contact_bend: Array = field(default=_ZEROS, metadata=_of("m", (1e-5,)))
    actuator_state: Array = field(default=_ZEROS, metadata=_of("1"))
    elastic_stiction: Array = field(
        default=_ZEROS,
        metadata=_of("N", (1.0,), "elastic_stiction", "force held against a tendon's stretch", "elastic_tendon"),
    )
    drives: Array = field(default=_ZEROS, metadata=_of("1"))
    tendon_stiction: Array = field(
        default=_ZEROS, metadata=_of("N", (1.0,), "tendon_stiction", "tendon stiction force", "tendon", "9a")
    )
    canal_stiction: Array = field(default=_ZEROS, metadata=_of("N"))
    joint_stiction: Array = field(
        default=_ZEROS, metadata=_of("N m", (1e-2,), "joint_stiction", "joint stiction torque", "joint", "9a")
    )
    gearbox_stiction: Array = field(
        default=_ZEROS,
        metadata=_of("N m", (1e-2,), "gearbox_stiction", "stiction torque of the gearbox", "motor", "9a"),
    )
    further: Array = field(default=_ZEROS, metadata=_of("1"))

    @property
    def q(self) -> Array:
        """The position, as Pinocchio calls it."""
        return self.position

    @property
    def v(self) -> Array:
        """The velocity, as Pinocchio calls it."""
        return self.velocity


#: Every block of the state, in the order of the packed vector.
BLOCKS: dict[str, Block] = {each.name: each.metadata["block"] for each in fields(State)}
# Blocks whose numbers have the names of the user's rows.
_BLOCKS_OF_USERS_ROWS = ("drives", "further")


@dataclass(frozen=True)
class Layout:
    """Sizes and order of the packed state.

    Attributes:
        labels: Of every block, in order, the names of its numbers.
        scaled: Blocks with other scales than their own: the block, and a scale for each number.
    """

    labels: tuple[tuple[str, ...], ...]
    scaled: tuple[tuple[str, tuple[float, ...]], ...] = ()

    @classmethod
    def from_labels(
        cls, labels: Mapping[str, Sequence[str]], scaled: Mapping[str, Sequence[float]] | None = None
    ) -> Layout:
        """Return the layout of some blocks' names; blocks that are left out are empty."""
        return cls(
            tuple(tuple(labels.get(name, ())) for name in BLOCKS),
            tuple((name, tuple(map(float, scales))) for name, scales in (scaled or {}).items()),
        )

    def names_of(self, block: str) -> tuple[str, ...]:
        """Return the names of a block's numbers."""
        return self.labels[tuple(BLOCKS).index(block)]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the blocks, in order."""
        return tuple(map(len, self.labels))

    @cached_property
    def size(self) -> int:
        """Length of the packed state."""
        return sum(self.sizes)

    @cached_property
    def _parts(self) -> dict[str, slice]:
        ends = np.cumsum(self.sizes)
        parts = (slice(int(end) - size, int(end)) for end, size in zip(ends, self.sizes, strict=True))
        return dict(zip(BLOCKS, parts, strict=True))

    @cached_property
    def _filled(self) -> list[tuple[str, slice]]:
        return [(name, part) for name, part in self._parts.items() if part.stop > part.start]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name for every number of the packed state."""
        return tuple(
            name if kind in _BLOCKS_OF_USERS_ROWS else f"{block.variable or kind}[{name}]"
            for (kind, block), names in zip(BLOCKS.items(), self.labels, strict=True)
            for name in names
        )

    def pack(self, state: State) -> Array:
        """Return the packed vector, shape (..., size)."""
        lead, blocks = state.position.shape[:-1], []
        for kind, size in zip(BLOCKS, self.sizes, strict=True):
            block = getattr(state, kind)
            blocks.append(np.zeros((*lead, size)) if block is None else block)
        return np.concatenate(blocks, axis=-1)

    def unpack(self, x: Array) -> State:
        """Return views of a packed vector, shape (..., size).

        Raises:
            ValueError: If the last dimension has the wrong size.
        """
        if x.shape[-1] != self.size:
            raise ValueError(f"a packed state has {self.size} numbers, not {x.shape[-1]}")
        # Of a frozen class the constructor takes longer than all else in a step's answer.
        state, nothing = object.__new__(State), x[..., :0]
        vars(state).update(dict.fromkeys(self._parts, nothing))
        vars(state).update([(name, x[..., part]) for name, part in self._filled])
        return state

    def scales(self) -> Array:
        """Return one typical magnitude per number of the state, for absolute tolerances; shape (size,).

        Angles 1 rad and 10 rad/s, joints that slide 1 cm and 0.1 m/s, passive tendon 1 mm and 0.1 m/s, stiction 1 N
        and 1e-2 N m: the size of each in ordinary motion of a finger, so that one factor serves them all. A lumped
        mass that rings has the velocity that goes with 1 % of its position: an oscillation too small to matter in the
        one is not followed in the other.
        """
        return self._scales.copy()

    @cached_property
    def _scales(self) -> Array:
        scales, scaled = np.zeros(self.size), dict(self.scaled)
        for kind, part in self._filled:
            scales[part] = scaled.get(kind) or np.resize(BLOCKS[kind].scale, part.stop - part.start)
        return scales


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Positions and velocities of the rigid body; leading dimensions such as time are kept.

    Attributes:
        tip: p, fingertip position, shape (..., 3), m; of several shape (..., t, 3).
        tip_velocity: p', m/s, of the same shape.
        jacobian: J of (6), shape (..., 3, n); of several (..., t, 3, n).
        directions: e_j, unit vectors along the link proximal to each joint, base frame, shape (..., n, 3).
        kinetic_energy: Shape (...,), J.
        potential_energy: Of gravity, shape (...,), J.
    """

    tip: Array
    tip_velocity: Array
    jacobian: Array
    directions: Array
    kinetic_energy: Array
    potential_energy: Array


class Motion(NamedTuple):
    """Place of the fingertip and energies of the rigid body; leading dimensions are kept.

    Attributes:
        tip: p, shape (..., 3), m; of several shape (..., t, 3).
        kinetic_energy: Shape (...,), J.
        potential_energy: Of gravity, shape (...,), J.
        objects: Both energies of free objects around it; None without surroundings.
    """

    tip: Array
    kinetic_energy: Array
    potential_energy: Array
    objects: tuple[Array, Array] | None = None
