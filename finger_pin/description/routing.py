"""The routing table and the matrices that follow from it: (3), (10), (15), (17) and force closure.

Forces come in two orders. *Tendons*: one entry per tendon, actuated first. *Strands*: one entry per actuated tendon,
then for each passive tendon its proximal and its distal half, since friction makes their tensions differ (10).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property, memoised
from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.typing import Array, Indices

# Below this share of the largest, an internal tension counts as none.
_SLACK_SHARE = 1e-9


def routing_parts(description: FingerDescription) -> tuple[object, ...]:
    """Return the parts of a description that its routing depends on."""
    joints = (description.hand and tuple(description.hand.fingers), description.tree, *description.joints)
    at_bends = description.tendon_friction.place == "bends"
    return (*joints, at_bends, *description.tendons, *description.tendons.values())


@dataclass(frozen=True, eq=False)
class Routing:
    """Matrices of a tendon network with n joints, t tendons (a actuated, p passive) and s = a + 2 p strands.

    Attributes:
        joints: Names of the n joints.
        cords: The t tendons by name, actuated first.
        canals: The tendons of its tree that something else pulls, by name.
        actuated: Number a of actuated tendons.
        fingers: Of every finger the indices of its joints and of its tendons; of one finger all.
        winched: Which actuated tendons an ideal winch winds: their input is a length, m; shape (a,).
    """

    joints: tuple[str, ...]
    cords: Mapping[str, Cord]
    canals: Mapping[str, Cord]
    actuated: int
    fingers: tuple[tuple[Indices, Indices], ...]
    winched: NDArray[np.bool_]

    @classmethod
    @memoised(lambda _, description: routing_parts(description))
    def from_description(cls, description: FingerDescription) -> Routing:
        """Read the tendons of a finger."""
        joints, groups = tuple(description.joints), (description.tendons, description.canals)
        cords, canals = ({name: description.cord(name) for name in names} for names in groups)
        names = [""] if description.hand is None else [f"{name}." for name in description.hand.fingers]
        fingers = tuple((_beginning(joints, name), _beginning(tuple(cords), name)) for name in names)
        winched = [description.tendons[name].winch is not None for name in description.actuated_names]
        return cls(joints, cords, canals, len(winched), fingers, np.array(winched, bool))

    @cached_property
    def tendons(self) -> tuple[str, ...]:
        """Names of the t tendons, actuated first."""
        return tuple(self.cords)

    @cached_property
    def wraps(self) -> tuple[tuple[Cord, ...], ...]:
        """The places where each tendon, and then each canal of the tree, rubs."""
        return tuple(cord.wraps for cord in (*self.cords.values(), *self.canals.values()))

    @cached_property
    def first_turns(self) -> Array:
        """Turns of the first place where each tendon rubs over the rotation of joints (15), shape (t, n)."""
        return self._rows(places[0].turns(self.joints) for places in self.wraps[: len(self.cords)])

    @cached_property
    def coupling(self) -> Array:
        """H_c, shape (t, n), m; l = H_c theta, equation (3)."""
        return self._rows(cord.arms(self.joints) for cord in self.cords.values())

    @cached_property
    def strand_coupling(self) -> Array:
        """H_c2, shape (s, n), m, equation (10)."""
        return self._rows(strand.arms(self.joints) for cord in self.cords.values() for strand in cord.strands)

    @cached_property
    def curvature_matrix(self) -> Array:
        """Phi, shape (t, n), turn of the path over rotation of the joint, equation (15)."""
        return self._rows(cord.sliding.turns(self.joints) for cord in self.cords.values())

    @cached_property
    def curvature_offset(self) -> Array:
        """phi_off, shape (t,), rad."""
        return np.array([cord.sliding.offset for cord in self.cords.values()])

    @cached_property
    def loads(self) -> Array:
        """Shape (n, s), one where a strand loads a joint, equation (17)."""
        return self._rows(strand.loads(self.joints) for cord in self.cords.values() for strand in cord.strands).T

    @cached_property
    def through_space(self) -> NDArray[np.bool_]:
        """Which tendons have arms that depend on the posture beside those of H_c, shape (t,)."""
        return np.array([cord.through_space for cord in self.cords.values()], bool)

    def _rows(self, values: Iterable[Array]) -> Array:
        return np.array([*values]).reshape(-1, len(self.joints))

    @property
    def passive(self) -> int:
        """Number p of passive tendons."""
        return len(self.tendons) - self.actuated

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Names of the passive tendons."""
        return self.tendons[self.actuated :]

    @property
    def actuated_coupling(self) -> Array:
        """Rows of H_c of the actuated tendons, shape (a, n), m."""
        return self.coupling[: self.actuated]

    @property
    def proximal_coupling(self) -> Array:
        """Rows of H_c2 of the proximal halves of the passive tendons, shape (p, n), m."""
        return self.strand_coupling[self.actuated :: 2]

    @property
    def distal_coupling(self) -> Array:
        """Rows of H_c2 of the distal halves of the passive tendons, shape (p, n), m."""
        return self.strand_coupling[self.actuated + 1 :: 2]

    def strand(self, tendon: str, *, distal: bool = False) -> int:
        """Return the index of a tendon's strand; ``distal`` asks for the distal half of a passive tendon."""
        index = self.tendons.index(tendon)
        return index if index < self.actuated else 2 * index - self.actuated + int(distal)

    def force_closure(self) -> ForceClosure:
        """Report whether tensions exist that are all positive and turn no joint, finger by finger.

        It does not hold where a tendon runs along a path through space: its arms depend on the posture.
        """
        return self._force_closure

    @cached_property
    def pseudo_inverse(self) -> Array:
        """Pseudo-inverse of H_c^T of (21), shape (t, n), 1/m."""
        return np.asarray(np.linalg.pinv(self.coupling.T))

    @cached_property
    def _force_closure(self) -> ForceClosure:
        if self.through_space.any() or not np.any(self.coupling, axis=1).all():
            return ForceClosure(
                np.zeros((len(self.tendons), 0)), np.zeros(len(self.tendons)), self.tendons, posed=False
            )
        closures = [
            ForceClosure.from_coupling(self.coupling[np.ix_(rows, joints)], tuple(self.tendons[row] for row in rows))
            for joints, rows in self.fingers
        ]
        if len(closures) == 1:
            return closures[0]
        tension, basis = np.zeros(len(self.tendons)), []
        for (_, rows), closure in zip(self.fingers, closures, strict=True):
            tension[rows] = closure.tension
            basis.append(np.zeros((len(self.tendons), closure.null_space.shape[1])))
            basis[-1][rows] = closure.null_space
        return ForceClosure(np.hstack(basis), tension, self.tendons)

    def curvature(self, position: Array) -> Array:
        """Return phi(theta) of (15), shape (..., t), rad, at joint positions of shape (..., n)."""
        curvature: Array = np.abs(position) @ self.curvature_matrix.T + self.curvature_offset
        return curvature

    def strand_tension(self, tension: Array) -> Array:
        """Return the tensions of all strands without friction (8), shape (..., s): both halves have their tendon's."""
        halves = np.repeat(tension[..., self.actuated :], 2, axis=-1)
        return np.concatenate([tension[..., : self.actuated], halves], axis=-1)

    def tendon_tension(self, strands: Array) -> Array:
        """Return the delivered tension of every tendon, shape (..., t), of strands (..., s): a passive one's distal."""
        distal = strands[..., self.actuated + 1 :: 2]
        return np.concatenate([strands[..., : self.actuated], distal], axis=-1)


@dataclass(frozen=True, eq=False)
class ForceClosure:
    """Whether a tendon network can keep all its tendons taut at zero joint torque.

    Attributes:
        null_space: Basis of the null space of H_c^T, shape (t, k).
        tension: f^k, shape (t,): internal tensions with the largest entry 1 and the smallest as large as possible;
            zero where there are none.
        tendons: Names of the tendons.
        posed: Whether arms are known; those of paths through space depend on the posture.
    """

    null_space: Array
    tension: Array
    tendons: tuple[str, ...]
    posed: bool = True

    @classmethod
    def from_coupling(cls, coupling: Array, tendons: tuple[str, ...]) -> ForceClosure:
        """Find the internal tensions of a coupling matrix H_c, shape (t, n)."""
        # The radii differ by less than a few orders of magnitude, so a relative rank tolerance is safe.
        _, sizes, directions = np.linalg.svd(coupling.T)
        null_space = directions[np.count_nonzero(sizes > 1e-10 * sizes.max(initial=0.0)) :].T
        count = null_space.shape[1]
        tension = np.zeros(len(tendons))
        if count == 1:
            vector = _largest_one(null_space[:, 0])
            # Where signs are mixed, any multiple but zero would make some tendon push.
            tension = vector if vector.min() >= -_SLACK_SHARE else np.zeros(len(tendons))
        elif count > 1:
            tension = _tautest_tensions(null_space)
        return cls(null_space, tension, tendons)

    @property
    def holds(self) -> bool:
        """Whether every internal tension is positive."""
        return len(self.tension) > 0 and bool(np.all(self.tension > _SLACK_SHARE))

    def __str__(self) -> str:
        """Return a sentence: force closure, or the tendons that lack it."""
        if self.holds:
            listed = ", ".join(f"{n} {f:.3g}" for n, f in zip(self.tendons, self.tension, strict=True))
            return f"force closure: internal tensions in the ratio {listed}"
        if not self.posed:
            return "force closure depends on the posture (fp.analysis.posed, fp.analysis.closure_over_range)"
        if self.null_space.shape[1] == 0:
            return "no force closure: no tensions balance each other at zero torque (too few tendons)"
        balance = self.tension
        if self.null_space.shape[1] == 1:
            balance = _largest_one(self.null_space[:, 0])
        worst = [name for name, tension in zip(self.tendons, balance, strict=True) if tension <= _SLACK_SHARE]
        return f"no force closure: {', '.join(worst)} cannot be kept taut at zero joint torque"


def _beginning(names: tuple[str, ...], start: str) -> Indices:
    return np.flatnonzero([name.startswith(start) for name in names])


def _largest_one(vector: Array) -> Array:
    return np.asarray(vector / vector[np.argmax(np.abs(vector))])


def _tautest_tensions(null_space: Array) -> Array:
    """Return the internal tensions N y whose least entry is largest, or that leave the fewest tendons slack."""
    size, count = null_space.shape
    # The largest least entry e of N y subject to N y <= 1 is a linear programme in (y, e).
    ones = np.ones((size, 1))
    solution = scipy.optimize.linprog(
        np.append(np.zeros(count), -1.0),
        A_ub=np.block([[-null_space, ones], [null_space, 0.0 * ones]]),
        b_ub=np.append(np.zeros(size), np.ones(size)),
        bounds=[(None, None)] * count + [(None, 1.0)],
    )
    if solution.x[-1] <= _SLACK_SHARE:
        # Not all can be taut: most entries e_i in [0, 1] with N y >= e; a tendon that can be taut reaches 1.
        solution = scipy.optimize.linprog(
            np.append(np.zeros(count), -np.ones(size)),
            A_ub=np.hstack([-null_space, np.eye(size)]),
            b_ub=np.zeros(size),
            bounds=[(None, None)] * count + [(0.0, 1.0)] * size,
        )
    tension = np.asarray(null_space @ solution.x[:count])
    return tension / tension.max() if tension.max() > _SLACK_SHARE else np.zeros(size)
