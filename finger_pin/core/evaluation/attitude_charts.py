"""The attitude of free bodies: angles about three axes since the last step, and a unit quaternion at its start.

Within a step a free body turns about its own x, then y, then z by small angles, whose rates are coordinates as any
other. After the step the turn goes into the quaternion and the angles begin anew at zero, where their rates are the
angular velocity in the body's frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.jit import Matrix, Vector, inlined, njit_always_inline, njit_inline
from finger_pin.core.tables.chains import BODY
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.typing import Array


def place(frame: Matrix, q: Vector, body: Vector) -> None:
    """Write a quaternion's attitude into the placement of the first body that turns.

    Args:
        frame: Rotation of the spherical joint in the body before it, shape (3, 3).
        q: Quaternion, shape (4,).
        body: Row of the table of bodies.
    """
    x, y, z, w = q[0], q[1], q[2], q[3]
    along_x = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w))
    along_y = (2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w))
    along_z = (2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y))
    for r in range(3):
        # The frame along x has its axes along -z, y and x.
        body[BODY.rotation + 3 * r] = -(frame[r, 0] * along_z[0] + frame[r, 1] * along_z[1] + frame[r, 2] * along_z[2])
        body[BODY.rotation + 3 * r + 1] = frame[r, 0] * along_y[0] + frame[r, 1] * along_y[1] + frame[r, 2] * along_y[2]
        body[BODY.rotation + 3 * r + 2] = frame[r, 0] * along_x[0] + frame[r, 1] * along_x[1] + frame[r, 2] * along_x[2]


def place_all(structure: Structure, parameters: Parameters, attitude: Matrix) -> None:
    """Place all free bodies by their quaternions, shape (f, 4)."""
    for f in range(structure.charts.size):
        place(parameters.chart_frames[f], attitude[f], parameters.bodies[structure.charts[f]])


_place = inlined(place)
#: `place_all` in compiled code.
place_bodies = inlined(place_all)


@njit_always_inline
def rechart(structure: Structure, parameters: Parameters, x: Vector, attitude: Matrix) -> None:
    """Move the angles of all free bodies into their quaternions (x, y, z, w), and into the bodies' placements."""
    width = structure.parents.size + parameters.lumps.size
    for f in range(structure.charts.size):
        i = structure.charts[f]
        a, b, c = x[i], x[i + 1], x[i + 2]
        da, db, dc = x[width + i], x[width + i + 1], x[width + i + 2]
        x[width + i] = da * np.cos(b) * np.cos(c) + db * np.sin(c)
        x[width + i + 1] = db * np.cos(c) - da * np.cos(b) * np.sin(c)
        x[width + i + 2] = da * np.sin(b) + dc
        x[i], x[i + 1], x[i + 2] = 0.0, 0.0, 0.0
        q = attitude[f]
        _turn(q, 0, a)
        _turn(q, 1, b)
        _turn(q, 2, c)
        size = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for r in range(4):
            q[r] /= size
        _place(parameters.chart_frames[f], q, parameters.bodies[i])


@njit_inline
def _turn(q: Vector, axis: int, angle: float) -> None:
    """Replace a quaternion by its product with a turn about a body axis."""
    cosine, sine = np.cos(0.5 * angle), np.sin(0.5 * angle)
    second, third = (axis + 1) % 3, (axis + 2) % 3
    about, scalar, along, across = q[axis], q[3], q[second], q[third]
    q[axis] = cosine * about + sine * scalar
    q[3] = cosine * scalar - sine * about
    q[second] = cosine * along + sine * across
    q[third] = cosine * across - sine * along


def angular_velocity(angles: Array, rates: Array) -> Array:
    """Return the angular velocity in the body's frame of turns about its x, y and z axes, shape (..., 3), rad/s."""
    (_, b, c), (da, db, dc) = np.moveaxis(angles, -1, 0), np.moveaxis(rates, -1, 0)
    across = da * np.cos(b)
    return np.stack(
        [across * np.cos(c) + db * np.sin(c), db * np.cos(c) - across * np.sin(c), da * np.sin(b) + dc], axis=-1
    )


def turned(attitude: Array, angles: Array) -> Array:
    """Return quaternions (x, y, z, w) after turns about the body's x, y and z axes, shape (..., 4)."""
    quaternions = attitude
    for axis in range(3):
        cosine, sine = np.cos(0.5 * angles[..., axis]), np.sin(0.5 * angles[..., axis])
        second, third = (axis + 1) % 3, (axis + 2) % 3
        new = np.empty_like(quaternions)
        new[..., axis] = cosine * quaternions[..., axis] + sine * quaternions[..., 3]
        new[..., 3] = cosine * quaternions[..., 3] - sine * quaternions[..., axis]
        new[..., second] = cosine * quaternions[..., second] + sine * quaternions[..., third]
        new[..., third] = cosine * quaternions[..., third] - sine * quaternions[..., second]
        quaternions = new
    return quaternions


@dataclass(frozen=True, eq=False)
class Charts:
    """The places at which packed states have quaternions and the core has angles.

    Attributes:
        plain: Indices in a packed state of what is the same in both, shape (m,).
        cores: Indices of the same in the core's state, shape (m,).
        quaternions: First index of every quaternion in a packed state.
        angles: First index of its angles in the core's state; their rates stand N further.
        coordinates: N.
        size: Length of the core's state.
    """

    plain: NDArray[np.int64]
    cores: NDArray[np.int64]
    quaternions: tuple[int, ...]
    angles: tuple[int, ...]
    coordinates: int
    size: int

    @classmethod
    def from_mechanism(cls, mechanism: Mechanism) -> Charts:
        """Read a mechanism."""
        model, width = mechanism.body.model, mechanism.coordinates
        spheres = [joint for joint in model.joints[1:] if joint.nq != joint.nv]
        packed, core = np.ones(mechanism.size, dtype=bool), np.ones(2 * width + mechanism.state_count, dtype=bool)
        for joint in spheres:
            packed[joint.idx_q : joint.idx_q + 4] = False
            core[joint.idx_v : joint.idx_v + 3] = False
        return cls(
            np.flatnonzero(packed),
            np.flatnonzero(core),
            tuple(int(joint.idx_q) for joint in spheres),
            tuple(int(joint.idx_v) for joint in spheres),
            width,
            len(core),
        )

    def to_core(self, x: Array) -> tuple[Array, Array]:
        """Return the core's state with angles zero, shape (..., size), and unit quaternions, shape (..., f, 4)."""
        lead = x.shape[:-1]
        core, attitude = np.zeros((*lead, self.size)), np.zeros((*lead, len(self.quaternions), 4))
        core[..., self.cores] = x[..., self.plain]
        for f, at in enumerate(self.quaternions):
            q = x[..., at : at + 4]
            attitude[..., f, :] = q / np.linalg.norm(q, axis=-1, keepdims=True)
        return core, attitude

    def to_packed(self, core: Array, attitude: Array) -> Array:
        """Return packed states from the core's, shape (..., size), and the quaternions from which angles count."""
        packed = np.zeros((*core.shape[:-1], len(self.plain) + 4 * len(self.quaternions)))
        packed[..., self.plain] = core[..., self.cores]
        shift = len(self.quaternions)
        for f, (at, i) in enumerate(zip(self.quaternions, self.angles, strict=True)):
            angles, rates = core[..., i : i + 3], core[..., self.coordinates + i : self.coordinates + i + 3]
            # What is moved along a path does not turn.
            turning = angles.any() or rates.any()
            q = turned(attitude[..., f, :], angles) if turning else attitude[..., f, :]
            packed[..., at : at + 4] = q / np.linalg.norm(q, axis=-1, keepdims=True)
            if turning:
                velocity = self.coordinates + shift + i
                packed[..., velocity : velocity + 3] = angular_velocity(angles, rates)
        return packed

    def packed_places(self, core: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the indices of the core's numbers in a packed state; those of angles are of their quaternion."""
        place = np.zeros(self.size, dtype=np.int64)
        place[self.cores] = self.plain
        for at, i in zip(self.quaternions, self.angles, strict=True):
            place[i : i + 3] = at
        return np.asarray(place[core])
