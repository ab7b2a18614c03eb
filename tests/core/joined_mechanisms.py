"""Several mechanisms on one base, joined table by table, to hold those of hands against."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin

from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.path_elements import PathElement, Paths, PathTerm
from finger_pin.mechanism.rigid_body import RigidBody


def join_mechanisms(parts: Mapping[str, Mechanism]) -> Mechanism:
    """Return several mechanisms on one base, such as the fingers of a hand.

    Coordinates are the joints of all parts, then the lumps of all. Names of joints, tips, lumps and tables begin
    with that of their part and a dot; inputs follow each other.

    """
    body = join_bodies({name: part.body for name, part in parts.items()})
    width = int(body.model.nv) + sum(len(part.lumps) for part in parts.values())
    joint = coordinate = channel = 0
    lump, rows = int(body.model.nv), []
    for name, part in parts.items():
        size = int(part.body.model.nv)
        places = np.append(coordinate + np.arange(size), lump + np.arange(len(part.lumps)))
        for table in part.listed:
            rows.append(
                replace(
                    table.embed_coordinates(places, width),
                    group=f"{name}.{table.group}",
                    channels=np.where(table.channels >= 0, table.channels + channel, -1),
                    pins=np.where(table.pins >= 0, table.pins + joint, -1),
                    paths=_shift_joints(table.paths, joint),
                    inputs={f"{name}.{group}": weights for group, weights in table.inputs.items()},
                    loads={f"{name}.{group}": weights for group, weights in table.loads.items()},
                    readings={f"{name}.{group}": weights for group, weights in table.readings.items()},
                )
            )
        joint, coordinate = joint + part.body.model.njoints - 1, coordinate + size
        lump, channel = lump + len(part.lumps), channel + part.channels
    lumps = [f"{name}.{each}" for name, part in parts.items() for each in part.lumps]
    return Mechanism(body, rows, lumps, np.concatenate([part.inertia for part in parts.values()]), channel)


def _shift_joints(paths: Paths, shift: int) -> tuple[tuple[PathTerm, ...], ...]:
    """Return paths with the indices of all joints but the base shifted by a number."""

    @cache
    def piece_there(piece: PathElement) -> PathElement:
        ends = tuple(replace(end, joint=end.joint and end.joint + shift) for end in piece.ends)
        return replace(piece, ends=ends, joint=piece.joint and piece.joint + shift)

    return tuple(tuple(leg._replace(piece=piece_there(leg.piece)) for leg in legs) for legs in paths)


def join_bodies(parts: Mapping[str, RigidBody], places: Mapping[str, pin.SE3] | None = None) -> RigidBody:
    """Return several bodies on one base; names of joints and tips begin with that of their part and a dot.

    Args:
        parts: By name.
        places: Placements of the parts' base frames on the common base; there itself by default. Gravity is that
            of the common base.

    """
    model, tips = pin.Model(), []
    axes, carriers = [np.array([1.0, 0.0, 0.0])], [0]
    model.gravity = next(iter(parts.values())).model.gravity
    for part, body in parts.items():
        part_model, shift = body.model, model.njoints - 1
        place = (places or {}).get(part, pin.SE3.Identity())
        assert part_model.gravity == model.gravity
        for index in range(1, part_model.njoints):
            parent = int(part_model.parents[index])
            joint, placement = part_model.joints[index], part_model.jointPlacements[index]
            placement = placement if parent else place * placement
            at = model.addJoint(parent and parent + shift, joint, placement, f"{part}.{part_model.names[index]}")
            # Appending bodies, or frames with theirs, would round.
            model.inertias[at] = part_model.inertias[index]
            at, moved = model.joints[at].idx_v, part_model.joints[index]
            model.armature[at : at + moved.nv] = part_model.armature[moved.idx_v : moved.idx_v + moved.nv]
        for tip in body.tips:
            frame = part_model.frames[tip]
            holder = frame.parentJoint and frame.parentJoint + shift
            tips.append(f"{part}.{frame.name}")
            frame_placement = frame.placement if holder else place * frame.placement
            model.addFrame(pin.Frame(tips[-1], holder, 0, frame_placement, pin.FrameType.OP_FRAME), False)
        along = zip(body.proximal_axes[1:], body.parent_links[1:], strict=True)
        axes += [axis if carrier else place.rotation @ axis for axis, carrier in along]
        carriers += [carrier and carrier + shift for carrier in body.parent_links[1:]]
    joined = RigidBody(model, tips)
    joined.proximal_axes, joined.parent_links = axes, carriers
    return joined
