"""The coupling that passive tendons impose on references (20)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError
from finger_pin.typing import Array


def slack_lengths(finger: FingerDescription) -> Array:
    """Return l_0, how much longer passive tendons are, relaxed, than their way at theta = 0, shape (p,), m."""
    numbers = finger.numbers["passive_tendon"]
    return numbers["slack"] - numbers["pretension"] / numbers["stiffness"]


@dataclass(frozen=True, eq=False)
class PassiveCoupling:
    """Equation (20): the references of the joints that passive tendons drive follow from the others.

    The last joint of every passive tendon that couples two or more joints is a follower: its reference is such that
    the tendon, free of friction, carries its desired tension.

    Attributes:
        matrix: Shape (n, n), the derivative of theta^d by the angles of all joints; zero by those of followers.
        offset: Shape (n,), rad.
        followers: Indices of the follower joints.
    """

    matrix: Array
    offset: Array
    followers: tuple[int, ...]

    @classmethod
    @memoised(lambda _, routing, length, **flags: (routing, length.tobytes(), *flags.items()))
    def from_routing(
        cls, routing: Routing, length: Array, *, needed: bool = True, bands: bool = True
    ) -> PassiveCoupling:
        """Solve H_c theta^d = -l_0 - f_5^d / K_t for the follower joints, (20); without tensions it is (4).

        Args:
            routing: The routing.
            length: l_0 + f_5^d / K_t, shape (p,), m, by which tendons are longer than their way at theta = 0.
            needed: Whether to refuse tendons that determine a joint twice, rather than let no joint follow.
            bands: Whether the last joint of a tendon that pulls all of its joints one way follows, too: a band, which
                stretches.
        """
        size = len(routing.joints)
        rows, followers = [], []
        for index, row in enumerate(routing.coupling[routing.actuated :]):
            crossed = np.flatnonzero(row)
            if len(crossed) > 1 and (bands or row.min() < 0.0 < row.max()):
                rows.append(index)
                followers.append(int(crossed[-1]))
        matrix, offset = np.eye(size), np.zeros(size)
        if not rows:
            return cls(matrix, offset, ())
        coupling = routing.coupling[routing.actuated + np.array(rows)]
        driven = coupling[:, followers]
        if len(set(followers)) < len(followers) or np.linalg.matrix_rank(driven) < len(followers):
            if not needed:
                return cls(matrix, offset, ())
            names = ", ".join(routing.passive_names[index] for index in rows)
            raise InputError("finger.tendons", f"the passive tendons {names} determine the same joint twice")
        matrix[followers] = 0.0
        matrix[followers] = -np.linalg.solve(driven, coupling @ matrix)
        offset[followers] = -np.linalg.solve(driven, length[rows])
        return cls(matrix, offset, tuple(followers))

    def posture(self, angles: Array) -> Array:
        """Return theta^d, shape (..., n), rad, from the angles of the free joints, shape (..., k)."""
        posture: Array = angles @ self.matrix[:, self.free].T + self.offset
        return posture

    @property
    def free(self) -> list[int]:
        """Indices of the joints that are no followers."""
        return [joint for joint in range(len(self.offset)) if joint not in self.followers]
