"""Excursions of tendons at a posture: around pulleys by (3), along paths of a tree by their lengths."""

from __future__ import annotations

import numpy as np

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array, Routing
from finger_pin.mechanism.routes import Routes
from finger_pin.mechanism.rows import RowSignals, combined


class Excursions:
    """The excursions of all t tendons, which are zero in the joints' reference posture."""

    def __init__(self, routing: Routing, description: FingerDescription, paths: Routes | None) -> None:
        """Find the tendons that go along paths.

        Args:
            routing: H_c.
            description: Of the finger.
            paths: The paths of its tree; None without a tree.
        """
        self._names, self._coupling, self._paths, self._rest = routing.tendons, routing.coupling, paths, np.zeros(0)
        # Of every tendon that goes along a path, which one.
        self._along: dict[int, int] = {}
        if paths is not None and description.tree is not None:
            self._rest = np.array([joint.reference for joint in description.tree.joints.values()])
            names, tendons = list(paths.routes), enumerate(description.tendons.values())
            self._along = {k: names.index(tendon.along) for k, tendon in tendons if tendon.along is not None}

    def lengths(self, position: Array) -> Array:
        """Return the excursions of the tendons at theta, shape (..., n): shape (..., t), m."""
        drawn = np.asarray(position @ self._coupling.T)
        if self._paths is not None:
            lengths = self._paths.length(self._rest) - self._paths.length(position)
            for k, path in self._along.items():
                drawn[..., k] = lengths[..., path]
        return drawn

    def slopes(self, position: Array) -> Array:
        """Return their derivatives by theta, shape (..., n): shape (..., t, n), m."""
        coupling = np.broadcast_to(self._coupling, (*position.shape[:-1], *self._coupling.shape)).copy()
        if self._paths is not None and self._along:
            coupling[..., [*self._along], :] = -self._paths.arms(position)[..., [*self._along.values()], :]
        return coupling

    def torque(self, x: Array, pulling: RowSignals) -> Array:
        """Return the torque of driven or elastic tendons at packed states, shape (..., size): shape (..., n), N m."""
        joints = self._coupling.shape[1]
        if not pulling.rows.routed:
            return combined(pulling.force, pulling.rows.arm)[..., :joints]
        places = [self._names.index(name) for name in pulling.rows.pulls or pulling.rows.names]
        coupling = self.slopes(x[..., :joints])[..., places, :]
        return np.asarray((pulling.force[..., None, :] @ coupling)[..., 0, :])
