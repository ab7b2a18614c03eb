"""Lateral offsets of the tendons along the joint axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.typing import Array

#: Part of the narrowest link that the lanes may take up, and most that one lane may take.
_ALL_LANES, _ONE_LANE = 0.4, 0.13


@dataclass(frozen=True, eq=False)
class Lanes:
    """Sideways places of the tendons.

    Attributes:
        offset: By tendon and joint index (1 is the first joint), along the joint axis, m.
        spacing: Least distance between lanes, m.
        families: Joint indices with parallel axes at theta = 0, the largest family first.
        lead: Width of the first link, m, in which the length behind the base is measured.
    """

    offset: dict[tuple[str, int], float]
    spacing: float
    families: tuple[tuple[int, ...], ...]
    lead: float


def tendon_lanes(
    arms: Mapping[str, Mapping[int, float]], model: pin.Model, widths: Sequence[float], joints: Sequence[int]
) -> Lanes:
    """Give every tendon a lane at every joint.

    Joints with parallel axes share their lanes. A tendon whose winding at the other joints puts it to one side gets
    a lane on that side, so that it crosses over as little as it can. Two tendons share a lane only where they always
    run on opposite sides of the axis.

    Args:
        arms: Of the tendons, m: by name and index of the joints that they cross.
        model: Pinocchio model whose joints turn about z.
        widths: Of the finger's links, m.
        joints: Indices of its joints, 1 for the model's first.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(model.nq))
    frames: dict[int, Array] = {joint: np.array(data.oMi[joint].rotation) for joint in joints}
    width = min(widths)
    families = _families(frames)
    offset: dict[tuple[str, int], float] = {}
    spacings = [_ONE_LANE * width]
    for family in families:
        axis = frames[family[0]][:, 2]
        sideways = {
            name: sum(float(r * frames[j][:, 1] @ axis) for j, r in sorted(by_joint.items()) if r and j not in family)
            for name, by_joint in arms.items()
        }
        lanes = _allot({name: {j: by_joint.get(j) for j in family} for name, by_joint in arms.items()}, sideways)
        count = max(lanes.values(), default=0)
        spacing = min(_ONE_LANE, _ALL_LANES / max(count, 1)) * width
        spacings.append(spacing)
        for name, lane in lanes.items():
            for joint in family:
                sign = float(np.sign(frames[joint][:, 2] @ axis))
                offset[name, joint] = sign * spacing * (lane - count / 2)
    return Lanes(offset, min(spacings), families, widths[0])


def joint_axes(model: pin.Model) -> Array:
    """Return the axes of the joints at zero, shape (joints, 3), base frame: unit vectors, zero for those that slide."""
    data, reference = model.createData(), pin.ReferenceFrame.WORLD
    pin.computeJointJacobians(model, data, pin.neutral(model))
    twists = [pin.getJointJacobian(model, data, joint, reference) for joint in range(1, model.njoints)]
    columns = [joint.idx_v for joint in model.joints[1:]]
    return np.array([np.reshape(twist, (6, -1))[3:, at] for twist, at in zip(twists, columns, strict=True)])


def _families(frames: dict[int, Array]) -> tuple[tuple[int, ...], ...]:
    families: list[list[int]] = []
    for joint, frame in frames.items():
        for family in families:
            if abs(frame[:, 2] @ frames[family[0]][:, 2]) > 0.9:
                family.append(joint)
                break
        else:
            families.append([joint])
    return tuple(tuple(family) for family in sorted(families, key=len, reverse=True))


def _allot(radii: dict[str, dict[int, float | None]], sideways: dict[str, float]) -> dict[str, int]:
    present = [name for name, by_joint in radii.items() if any(r is not None for r in by_joint.values())]
    present.sort(key=lambda name: round(sideways[name], 9))
    lanes: dict[str, int] = {}
    for previous, name in zip([None, *present], present, strict=False):
        if previous is None:
            lanes[name] = 0
            continue
        shared = [(radii[previous][j], r) for j, r in radii[name].items()]
        opposite = all(a is not None and b is not None and a * b < 0.0 for a, b in shared)
        tied = abs(sideways[previous] - sideways[name]) < 1e-9
        lanes[name] = lanes[previous] + (0 if tied and opposite else 1)
    return {**{name: 0 for name in radii}, **lanes}
