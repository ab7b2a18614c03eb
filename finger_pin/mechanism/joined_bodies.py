"""Several rigid bodies as one, on a common base."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from finger_pin.exceptions import InputError
from finger_pin.mechanism.rigid_body import RigidBody


def join_bodies(parts: Mapping[str, RigidBody], places: Mapping[str, pin.SE3] | None = None) -> RigidBody:
    """Return several bodies on one base; names of joints and tips begin with that of their part and a dot.

    Args:
        parts: By name.
        places: Placements of the parts' base frames on the common base; there itself by default. Gravity is that
            of the common base.

    Raises:
        InputError: If gravity is not the same for all.
    """
    model, tips = pin.Model(), []
    axes, carriers = [np.array([1.0, 0.0, 0.0])], [0]
    model.gravity = next(iter(parts.values())).model.gravity
    for part, body in parts.items():
        own, shift = body.model, model.njoints - 1
        place = (places or {}).get(part, pin.SE3.Identity())
        if own.gravity != model.gravity:
            raise InputError(f"{part}.gravity", f"must be {model.gravity.linear}", own.gravity.linear)
        for index in range(1, own.njoints):
            parent = int(own.parents[index])
            joint, placement = own.joints[index], own.jointPlacements[index]
            placement = placement if parent else place * placement
            at = model.addJoint(parent and parent + shift, joint, placement, f"{part}.{own.names[index]}")
            # Appending bodies, or frames with theirs, would round.
            model.inertias[at] = own.inertias[index]
            at, moved = model.joints[at].idx_v, own.joints[index]
            model.armature[at : at + moved.nv] = own.armature[moved.idx_v : moved.idx_v + moved.nv]
        for tip in body.tips:
            frame = own.frames[tip]
            holder = frame.parentJoint and frame.parentJoint + shift
            tips.append(f"{part}.{frame.name}")
            held = frame.placement if holder else place * frame.placement
            model.addFrame(pin.Frame(tips[-1], holder, 0, held, pin.FrameType.OP_FRAME), False)
        along = zip(body.proximal_axes[1:], body.carriers[1:], strict=True)
        axes += [axis if carrier else place.rotation @ axis for axis, carrier in along]
        carriers += [carrier and carrier + shift for carrier in body.carriers[1:]]
    joined = RigidBody(model, tips)
    joined.proximal_axes, joined.carriers = axes, carriers
    return joined
