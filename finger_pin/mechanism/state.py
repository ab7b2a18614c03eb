"""The packed state vector: the only place that knows its order and sizes.

    | theta |  o  | p | theta' |  o' | p' |  z  | F^s of the tendons | F^s of the joints |
    |   n   | 7 f | p |   n    | 6 f | p  | 2 c |         t          |         n         |

n joints, f free objects (o is position and quaternion; o' velocity and angular velocity), t tendons, p of them passive,
c contacts with bristles bent by z: 19 numbers for the paper's finger alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The blocks of the packed state, in order.
_ORDER = (
    "position",
    "object_pose",
    "passive_position",
    "velocity",
    "object_velocity",
    "passive_velocity",
    "contact_bend",
    "tendon_stiction",
    "joint_stiction",
    "further",
)


@dataclass(frozen=True, eq=False)
class State:
    """The state by name; every array may have leading dimensions, such as time.

    Attributes:
        position: theta, shape (..., n), rad.
        passive_position: p_5, shape (..., p), m.
        velocity: theta', shape (..., n), rad/s.
        passive_velocity: p_5', shape (..., p), m/s.
        tendon_stiction: F^s of the tendons, shape (..., t), N.
        joint_stiction: F^s of the joints, shape (..., n), N m.
        further: States of rows of one's own, shape (..., f); zero if left out, as what follows.
        object_pose: Position, m, base frame, and unit quaternion x, y, z, w of every free object, shape (..., 7 f).
        object_velocity: Velocity, m/s, base frame, and angular velocity, rad/s, in its own, shape (..., 6 f).
        contact_bend: z of the contacts, two tangents each, shape (..., 2 c), m.
    """

    position: Array
    passive_position: Array
    velocity: Array
    passive_velocity: Array
    tendon_stiction: Array
    joint_stiction: Array
    further: Array | None = None
    object_pose: Array | None = None
    object_velocity: Array | None = None
    contact_bend: Array | None = None


@dataclass(frozen=True)
class Layout:
    """Sizes and order of the packed state.

    Attributes:
        joints: Names of the joints.
        tendons: Names of the tendons, the passive ones last.
        passive: Number of passive tendons.
        further: Name and scale of every state of further rows, which follow.
        ringing: Angular frequencies of the lumped masses on their two halves, one for each passive tendon, rad/s.
        objects: Names of the free objects.
        contacts: Names of the contacts.
    """

    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    passive: int
    further: tuple[tuple[str, float], ...] = ()
    ringing: tuple[float, ...] = ()
    objects: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the blocks, in order."""
        n, p, t, f = len(self.joints), self.passive, len(self.tendons), len(self.objects)
        return n, 7 * f, p, n, 6 * f, p, 2 * len(self.contacts), t, n, len(self.further)

    @cached_property
    def size(self) -> int:
        """Length of the packed state."""
        return sum(self.sizes)

    @cached_property
    def _parts(self) -> tuple[slice, ...]:
        ends = np.cumsum(self.sizes)
        return tuple(slice(int(end) - size, int(end)) for end, size in zip(ends, self.sizes, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """A name for every number of the packed state."""
        passive = self.tendons[len(self.tendons) - self.passive :]
        poses, rates, bends = (
            tuple(f"{name}.{part}" for name in names for part in parts.split())
            for names, parts in (
                (self.objects, "x y z qx qy qz qw"),
                (self.objects, "vx vy vz wx wy wz"),
                (self.contacts, "1 2"),
            )
        )
        groups = (
            ("joint_position", self.joints),
            ("object_pose", poses),
            ("passive_position", passive),
            ("joint_velocity", self.joints),
            ("object_velocity", rates),
            ("passive_velocity", passive),
            ("contact_bend", bends),
            ("tendon_stiction", self.tendons),
            ("joint_stiction", self.joints),
        )
        named = tuple(f"{kind}[{name}]" for kind, names in groups for name in names)
        return named + tuple(name for name, _ in self.further)

    def pack(self, state: State) -> Array:
        """Return the packed vector, shape (..., size)."""
        lead, blocks = state.position.shape[:-1], []
        for name, size in zip(_ORDER, self.sizes, strict=True):
            given = getattr(state, name)
            blocks.append(np.zeros((*lead, size)) if given is None else given)
        return np.concatenate(blocks, axis=-1)

    def unpack(self, x: Array) -> State:
        """Return views of a packed vector, shape (..., size).

        Raises:
            ValueError: If the last dimension has the wrong size.
        """
        if x.shape[-1] != self.size:
            raise ValueError(f"a packed state has {self.size} numbers, not {x.shape[-1]}")
        return State(**{name: x[..., part] for name, part in zip(_ORDER, self._parts, strict=True)})

    def scales(self) -> Array:
        """Return one typical magnitude per number of the state, for absolute tolerances; shape (size,).

        Angles 1 rad, velocities 10 rad/s, passive tendon 1 mm and 0.1 m/s, stiction 1 N and 1e-2 N m: the size of
        each in ordinary motion of a finger, so that one factor serves them all. A lumped mass that rings has the
        velocity that goes with 1 % of its position: an oscillation too small to matter in the one is not followed
        in the other.
        """
        scales = np.concatenate(
            [
                np.repeat([1.0, 1.0, 1e-3, 10.0, 10.0, 0.1, 1e-5, 1.0, 1e-2], self.sizes[:-1]),
                [scale for _, scale in self.further],
            ]
        )
        if self.ringing:
            passive = self._parts[_ORDER.index("passive_velocity")]
            scales[passive] = np.maximum(scales[passive], 1e-5 * np.array(self.ringing))
        if self.objects:
            # An object moves by centimetres where a joint turns by a radian.
            poses, rates = (self._parts[_ORDER.index(name)] for name in ("object_pose", "object_velocity"))
            scales[poses].reshape(-1, 7)[:, :3] = 1e-2
            scales[rates].reshape(-1, 6)[:, :3] = 0.1
        return scales
