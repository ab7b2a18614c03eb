"""Three-dimensional axes in true proportion, also of flat bodies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from matplotlib.figure import SubFigure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

AXES = "xyz"
# Least extent of a side, in parts of the largest, so that flat things have a box.
_LEAST_EXTENT = 0.2
# Points that labels stand away from their axis, so that they clear the ticks'.
_LABEL_DISTANCE = 8.0


def axes_around(part: SubFigure, corners: Array, unit: str) -> Axes3D:
    """Return oblique axes around points.

    Args:
        part: The part of the figure.
        corners: Points that must be in view, shape (m, 3).
        unit: Of them.
    """
    axes = part.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    low, high = corners.min(axis=0), corners.max(axis=0)
    longest = float(np.max(high - low)) or 1.0
    span = np.maximum(high - low, _LEAST_EXTENT * longest)
    for index, name in enumerate(AXES):
        middle = 0.5 * (low + high)[index]
        getattr(axes, f"set_{name}lim")(middle - 0.52 * span[index], middle + 0.52 * span[index])
        getattr(axes, f"set_{name}label")(f"{name} ({unit})", labelpad=_LABEL_DISTANCE)
        axis = getattr(axes, f"{name}axis")
        if high[index] - low[index] < 1e-6 * longest:
            axis.set_ticks([round(middle, 9) + 0.0])
        else:
            axis.set_major_locator(MaxNLocator(2 if span[index] < 0.5 * longest else 5, steps=[1, 2, 5, 10]))
    axes.set_box_aspect(tuple(span), zoom=0.75)
    # Flat bodies are seen from higher up.
    axes.view_init(elev=20 if span[2] > 1.01 * _LEAST_EXTENT * longest else 40, azim=-55)
    return axes


def flexion_plane(finger: Finger) -> tuple[int, int]:
    """Return the two axes of the base frame that are most nearly across the axis of the last joint, at rest."""
    limiter, model = finger.stroke_limiter, finger.rigid_body.model
    data = model.createData()
    pin.computeJointJacobians(model, data, np.clip(0.0, limiter.lower, limiter.upper))
    twist = pin.getJointJacobian(model, data, model.njoints - 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    # Of a single joint Pinocchio returns a vector.
    normal = int(np.argmax(np.abs(twist.reshape(6, -1)[3:, -1])))
    first, second = (axis for axis in range(3) if axis != normal)
    return first, second
