"""Kinds and sizes of geoms as MuJoCo has them: half of all lengths but radii and semi-axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from finger_pin.description.primitives import KINDS

#: Kinds of this package by MuJoCo's names.
KIND_OF_GEOM = {kind.geom: name for name, kind in KINDS.items() if kind.geom}
_SHARE = {"radius": 1.0, "length": 0.5, "sides": 0.5, "semi_axes": 1.0}


def mujoco_sizes(kind: str, sizes: Sequence[float]) -> list[float]:
    """Return MuJoCo's sizes of a kind of primitive, from those of this package, m."""
    entries = KINDS[kind].entries
    shares = [_SHARE[entry] for entry in entries] if len(entries) == len(sizes) else [_SHARE[entries[0]]] * len(sizes)
    return [share * size for share, size in zip(shares, sizes, strict=True)]


def described_sizes(kind: str, size: Sequence[float]) -> dict[str, Any]:
    """Return the entries of a kind of primitive, from MuJoCo's three numbers."""
    entries, numbers = KINDS[kind].entries, np.asarray(size, dtype=float)
    if entries in (("sides",), ("semi_axes",)):
        return {entries[0]: (numbers / _SHARE[entries[0]]).tolist()}
    return {entry: float(number) / _SHARE[entry] for entry, number in zip(entries, numbers, strict=False)}


def geom_kind(mujoco: Any, model: Any, geom: int) -> str:
    """Return MuJoCo's name of a geom's kind, such as sphere, plane or mesh."""
    name: str = mujoco.mjtGeom(int(model.geom_type[geom])).name
    return name.removeprefix("mjGEOM_").lower()
