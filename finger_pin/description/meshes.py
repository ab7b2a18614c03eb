"""Meshes as data: numbers packed into text, so that a file keeps them and stays readable around them."""

from __future__ import annotations

import base64
import binascii
import zlib
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from finger_pin.description.validation import Description, problem
from finger_pin.typing import Array

_POINT_DTYPE, _FACE_DTYPE = "<f4", "<i4"
# Of scanned surfaces it is 4 % smaller than the highest level, and six times as fast.
_COMPRESSION = 4


class Mesh(Description):
    """A surface of triangles. Its numbers are binary, compressed by zlib, and written in base64."""

    points: str = Field(description="Corners x, y, z, m, as 32-bit floats.")
    faces: str = Field(description="Three corners of every triangle, as 32-bit integers, counted from 0.")

    @classmethod
    def packed(cls, points: Array, faces: NDArray[np.int32]) -> dict[str, str]:
        """Return the table of a mesh with corners, shape (m, 3), m, and triangles, shape (k, 3)."""
        return {"points": _pack(points, _POINT_DTYPE), "faces": _pack(faces, _FACE_DTYPE)}

    @model_validator(mode="after")
    def _whole(self) -> Self:
        points, faces = _unpack("points", self.points, _POINT_DTYPE), _unpack("faces", self.faces, _FACE_DTYPE)
        if not np.all(np.abs(points) <= 10.0):
            raise problem("points", "must be finite and at most 10 m (is it in millimetres?)")
        if faces.min() < 0 or faces.max() >= len(points):
            raise problem("faces", f"must be corners from 0 to {len(points) - 1}", int(faces.max()))
        return self

    def unpacked(self) -> tuple[Array, NDArray[np.int32]]:
        """Return corners, shape (m, 3), m, and triangles, shape (k, 3)."""
        return _unpack("points", self.points, _POINT_DTYPE).astype(float), _unpack("faces", self.faces, _FACE_DTYPE)


def _pack(values: Any, kind: str) -> str:
    content = np.ascontiguousarray(values, dtype=kind).tobytes()
    return base64.b64encode(zlib.compress(content, _COMPRESSION)).decode("ascii")


def _unpack(entry: str, text: str, kind: str) -> NDArray[Any]:
    try:
        triples = np.frombuffer(zlib.decompress(base64.b64decode(text, validate=True)), dtype=kind).reshape(-1, 3)
    except (binascii.Error, zlib.error, ValueError) as error:
        raise problem(entry, f"must be numbers in threes, compressed by zlib, in base64 ({error})") from None
    if not len(triples):
        raise problem(entry, "must not be empty")
    return triples
