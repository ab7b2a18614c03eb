"""Set of forces that a fingertip can exert, as a translucent body at the fingertip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from finger_pin.analysis import ForcePolytope
from finger_pin.typing import Array
from finger_pin.views.viewer.solids import ROOT, Command, newton_length, set_object

_PATH = f"{ROOT}/forces"
_COLOUR, _RIM_COLOUR, _OPACITY = 0xFFB347, 0xFFD9A0, 0.22
#: Largest extent of the drawn set, in parts of the finger's length.
_SIZE_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class ForceSet:
    """A force polytope at a scale.

    Attributes:
        polytope: The forces, N.
        scale: Length that stands for a newton, m/N: 1, 2 or 5 times a power of ten.
    """

    polytope: ForcePolytope
    scale: float

    @classmethod
    def from_polytope(cls, polytope: ForcePolytope, length: float) -> ForceSet:
        """Choose a scale at which the set is at most half as large as a finger of some length, m."""
        extent = float(np.max(np.linalg.norm(polytope.vertices, axis=1)))
        return cls(polytope, newton_length(_SIZE_SHARE * length, extent) if extent > 0.0 else 1.0)

    @property
    def corners(self) -> Array:
        """The vertices, shape (v, 3), m, base frame."""
        return np.asarray(self.polytope.tip + self.scale * self.polytope.vertices)

    @property
    def note(self) -> str:
        """The legend of the drawing, for the panel."""
        return f"forces at the tip, {1e3 * self.scale:.4g} mm per N"

    def commands(self) -> Iterator[Command]:
        """Yield meshcat's commands: the body, if there is one, its edges, and its origin, the fingertip."""
        triangles = self.polytope.triangles()
        if len(triangles):
            normals = np.repeat(_normals(self.polytope.vertices[triangles]), 3, axis=0)
            body = {"position": self.corners[triangles].reshape(-1, 3), "normal": normals}
            # Both sides, without hiding what is inside.
            material = {"type": "MeshPhongMaterial", "color": _COLOUR, "opacity": _OPACITY, "side": 2, "shininess": 20}
            yield _object(f"{_PATH}/body", "Mesh", body, material)
        edges = self.corners[np.array(self.polytope.ridges(), dtype=int).reshape(-1, 2)]
        rim = {"type": "LineBasicMaterial", "color": _RIM_COLOUR, "opacity": 0.9}
        yield _object(f"{_PATH}/edges", "LineSegments", {"position": edges.reshape(-1, 3)}, rim)


def _normals(triangles: Array) -> Array:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def _object(path: str, kind: str, attributes: dict[str, Array], material: Command) -> Command:
    buffers = {
        name: {"itemSize": 3, "type": "Float32Array", "array": [float(value) for value in array.ravel()]}
        for name, array in attributes.items()
    }
    shape = {"type": "BufferGeometry", "data": {"attributes": buffers}}
    material = {"transparent": True, "depthWrite": False, **material}
    return set_object(path, kind, shape, material)
