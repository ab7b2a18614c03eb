"""Several mechanisms on one base, joined table by table, to hold those of hands against."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.path_elements import PathElement, Paths, PathTerm
from finger_pin.mechanism.urdf import join_bodies


def join_mechanisms(parts: Mapping[str, Mechanism]) -> Mechanism:
    """Return several mechanisms on one base, such as the fingers of a hand.

    Coordinates are the joints of all parts, then the lumps of all. Names of joints, tips, lumps and tables begin
    with that of their part and a dot; inputs follow each other.

    Raises:
        InputError: If gravity is not the same for all.
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

    return tuple(tuple(replace(leg, piece=piece_there(leg.piece)) for leg in legs) for legs in paths)
