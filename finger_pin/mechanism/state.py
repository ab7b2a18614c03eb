"""The packed state vector: the only place that knows its order and sizes.

    | theta | p | theta' | p' | F^s of the tendons | F^s of the joints |
    |   n   | p |   n    | p  |         t          |         n         |

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
        passive_position: p_5, shape (..., p), m.
        velocity: theta', shape (..., n), rad/s.
        passive_velocity: p_5', shape (..., p), m/s.
        tendon_stiction: F^s of the tendons, shape (..., t), N.
        joint_stiction: F^s of the joints, shape (..., n), N m.
        further: States of rows of one's own, shape (..., f); zero if left out.
    """

    position: Array
    passive_position: Array
    velocity: Array
    passive_velocity: Array
    tendon_stiction: Array
    joint_stiction: Array
    further: Array | None = None


@dataclass(frozen=True)
class Layout:
    """Sizes and order of the packed state.

    Attributes:
        joints: Names of the joints.
        tendons: Names of the tendons, the passive ones last.
        passive: Number of passive tendons.
        further: Name and scale of every state of further rows, which follow.
        ringing: Angular frequencies of the lumped masses on their two halves, one for each passive tendon, rad/s.
    """

    joints: tuple[str, ...]
    tendons: tuple[str, ...]
    passive: int
    further: tuple[tuple[str, float], ...] = ()
    ringing: tuple[float, ...] = ()

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes of the blocks, in order."""
        n, p, t = len(self.joints), self.passive, len(self.tendons)
        return n, p, n, p, t, n, len(self.further)

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
            ("passive_position", passive),
            ("joint_velocity", self.joints),
            ("passive_velocity", passive),
            ("tendon_stiction", self.tendons),
            ("joint_stiction", self.joints),
        )
        named = tuple(f"{kind}[{name}]" for kind, names in groups for name in names)
        return named + tuple(name for name, _ in self.further)

    def pack(self, state: State) -> Array:
        """Return the packed vector, shape (..., size)."""
        further = np.zeros((*state.position.shape[:-1], len(self.further))) if state.further is None else state.further
        return np.concatenate(
            [
                state.position,
                state.passive_position,
                state.velocity,
                state.passive_velocity,
                state.tendon_stiction,
                state.joint_stiction,
                further,
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
        each in ordinary motion of a finger, so that one factor serves them all. A lumped mass that rings has the
        velocity that goes with 1 % of its position: an oscillation too small to matter in the one is not followed
        in the other.
        """
        scales = np.concatenate(
            [
                np.repeat([1.0, 1e-3, 10.0, 0.1, 1.0, 1e-2], self.sizes[:-1]),
                [scale for _, scale in self.further],
            ]
        )
        if self.ringing:
            scales[self._parts[3]] = np.maximum(scales[self._parts[3]], 1e-5 * np.array(self.ringing))
        return scales
