"""The packed state vector: the only place that knows its order and sizes.

    | theta | theta' | p | p' | F^s of the tendons | F^s of the joints |
    |   n   |   n    | p | p  |         t          |         n         |

n joints, t tendons, p of them passive: 19 numbers for the paper's finger.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """The state by name; every array may have leading dimensions, such as time.

    Attributes:
        position: theta, shape (..., n), rad.
        velocity: theta', shape (..., n), rad/s.
        passive_position: p_5, shape (..., p), m.
        passive_velocity: p_5', shape (..., p), m/s.
        tendon_stiction: F^s of the tendons, shape (..., t), N.
        joint_stiction: F^s of the joints, shape (..., n), N m.
    """

    position: Array
    velocity: Array
    passive_position: Array
    passive_velocity: Array
    tendon_stiction: Array
    joint_stiction: Array


@dataclass(frozen=True)
class Layout:
    """Sizes and order of the packed state.

    Attributes:
        joints: Names of the joints.
        tendons: Names of the tendons, the passive ones last.
        passive: Number of passive tendons.
    """

    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    passive: int

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the blocks, in order."""
        n, p, t = len(self.joints), self.passive, len(self.tendons)
        return n, n, p, p, t, n

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
        groups = (
            ("joint_position", self.joints),
            ("joint_velocity", self.joints),
            ("passive_position", passive),
            ("passive_velocity", passive),
            ("tendon_stiction", self.tendons),
            ("joint_stiction", self.joints),
        )
        return tuple(f"{kind}[{name}]" for kind, names in groups for name in names)

    def pack(self, state: State) -> Array:
        """Return the packed vector, shape (..., size)."""
        return np.concatenate(
            [
                state.position,
                state.velocity,
                state.passive_position,
                state.passive_velocity,
                state.tendon_stiction,
                state.joint_stiction,
            ],
            axis=-1,
        )

    def unpack(self, x: Array) -> State:
        """Return views of a packed vector, shape (..., size).

        Raises:
            ValueError: If the last dimension has the wrong size.
        """
        if x.shape[-1] != self.size:
            raise ValueError(f"a packed state has {self.size} numbers, not {x.shape[-1]}")
        return State(*[x[..., part] for part in self._parts])

    def scales(self) -> Array:
        """Return one typical magnitude per number of the state, for absolute tolerances; shape (size,).

        Angles 1 rad, velocities 10 rad/s, passive tendon 1 mm and 0.1 m/s, stiction 1 N and 1e-2 N m: the size of
        each in ordinary motion of a finger, so that one factor serves them all.
        """
        return np.repeat([1.0, 10.0, 1e-3, 0.1, 1.0, 1e-2], self.sizes)
