"""Cords that stretch within their sheaths, as pieces in series that rub between them; `laws.sheath` has their laws.

A winch or a spool pulls its tendon with the tension at the sheath's entrance, and every place where the cord rubs takes
its part of that, along the cord behind the sheath. Its own speed there follows from the tensions before and behind it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from finger_pin.description.cords import DriveCord
from finger_pin.exceptions import InputError
from finger_pin.laws.capstan import PASSIVE_FRICTION
from finger_pin.laws.sheath import SHEATH_PIECE, SHEATH_PLACE, SHEATH_SLIP, SPOOL_ENTRANCE, WOUND_ENTRANCE
from finger_pin.mechanism.groups import TENDON_LOSSES, WINCHES
from finger_pin.mechanism.rows import Energy, Rows, Source
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

#: The table of the places where sheathed cords rub.
SHEATHS = "tendon_sheaths"
#: What winches supply.
WINCH_ENERGY = Energy("winches", "winches, through their cords")
_PIECES, _SLIPS = "sheath_pieces", "sheath_slips"
# Least viscous coefficient over the cord's stiffness, s: waves of sliding settle within a few times this.
_RELAXATION = 1e-4


def rubbing_shares(number: int) -> Array:
    """Return the parts of a sheath that rub at its places, shape (n,): short at its ends, where waves start."""
    uniform = np.linspace(0.0, 1.0, number + 1)
    return np.diff(0.2 * uniform + 0.4 * (1.0 - np.cos(np.pi * uniform)))


class _Cord(NamedTuple):
    """A sheathed cord.

    Attributes:
        table: The table that pulls it.
        row: Its row there.
        name: Of the tendon.
        whole: Its stiffness, damping and slack.
        shares: Parts of the sheath that rub at its places, shape (n,).
        first: Index of its first place among those of all cords.
    """

    table: Rows
    row: int
    name: str
    whole: DriveCord
    shares: Array
    first: int

    @property
    def compliances(self) -> Array:
        """Parts of the cord's compliance before, between and behind its places, shape (n + 1,)."""
        parts: Array = 0.5 * (np.append(self.shares, 0.0) + np.append(0.0, self.shares))
        return parts


def in_sheaths(tendons: Tendons, drives: Sequence[Rows]) -> tuple[list[Rows], list[Rows]]:
    """Return drives with the entrances of sheathed cords in place of whole cords, then places and pieces, if any.

    Args:
        tendons: Of the finger.
        drives: Tables of winches and of tendons on spools among them.

    Raises:
        InputError: If a sheathed cord has a stiction ratio above 1: where it slips there would be no one speed.
    """
    wound, cords, first = tendons.description.drive_cords, list[_Cord](), 0
    for table in drives:
        for row, name in enumerate(table.pulls):
            if name in wound and (count := wound[name].pieces):
                cords.append(_Cord(table, row, name, wound[name], rubbing_shares(count), first))
                first += count
    if not cords:
        return [*drives], []
    entered = [_entrances(table, wound, [cord for cord in cords if cord.table is table], first) for table in drives]
    places = _places(tendons, entered, cords)
    return entered, [places, _slips(places, cords), _pieces(places, cords)]


def _entrances(table: Rows, wound: Mapping[str, DriveCord], cords: Sequence[_Cord], places: int) -> Rows:
    """Return a table of drives in which some cords end at their first places."""
    if not cords:
        return table
    winch, reading = table.group == WINCHES, np.zeros((table.count, places))
    stiffness, damping = np.array([[wound[name].stiffness, wound[name].damping] for name in table.pulls]).T
    most, offset = table["most"] if winch else np.full(table.count, np.inf), table.offset.copy()
    for cord in cords:
        part = cord.compliances[0]
        # What pretension stretches is shared by all pieces; places have the damping.
        stiffness[cord.row] /= part
        offset[cord.row] *= part
        damping[cord.row] = 0.0
        reading[cord.row, cord.first] = -1.0 / part
    law, parameters = WOUND_ENTRANCE if winch else SPOOL_ENTRANCE, np.array([stiffness, damping, most])
    return replace(table, law=law, parameters=parameters, offset=offset, readings={_SLIPS: reading})


def _places(tendons: Tendons, drives: Sequence[Rows], cords: Sequence[_Cord]) -> Rows:
    """Return the table of places where cords rub, along their tendons."""
    count, description, source = sum(len(cord.shares) for cord in cords), tendons.description, partial(_numbers, cords)
    before = {_PIECES: np.zeros((count, count))} | {each.group: np.zeros((count, each.count)) for each in drives}
    arm, turns = np.zeros((count, drives[0].arm.shape[1])), np.zeros(count)
    for cord in cords:
        path = description.cord(cord.name)
        own = np.arange(cord.first, cord.first + len(cord.shares))
        before[cord.table.group][own[0], cord.row] = before[_PIECES][own[1:], own[:-1]] = 1.0
        arm[own, : len(description.joints)] = path.arms(list(description.joints))
        turns[own] = cord.shares * path.curvature_offset
    names = [(cord.name, f"{cord.name}.{number}") for cord in cords for number in range(1, 1 + len(cord.shares))]
    return Rows(
        SHEATHS,
        SHEATH_PLACE,
        tuple(name for _, name in names),
        source(tendons),
        arm,
        inputs={_PIECES: np.eye(count)},
        loads={group: weights for group, weights in before.items() if np.any(weights)},
        curvature_offset=turns,
        stored=_stored(cords),
        powers=(WINCH_ENERGY, *TENDON_LOSSES[:2]),
        pulls=tuple(tendon for tendon, _ in names),
        source=Source("tendons", source),
    )


def _numbers(cords: Sequence[_Cord], tendons: Tendons) -> Array:
    """Return the numbers of `SHEATH_PLACE` at the places of cords, shape (parameters, places)."""
    columns, parameters = [tendons.routing.tendons.index(cord.name) for cord in cords], list[Array]()
    rubbing = dict(zip(PASSIVE_FRICTION.parameters, tendons.friction[:, columns], strict=True))
    for k, cord in enumerate(cords):
        if (ratio := rubbing["ratio"][k]) != 1.0:
            allowed = f"must be 1 where a cord stretches within its sheath, as {cord.name} does by its pieces"
            raise InputError("finger.tendon_friction.stiction_ratio", allowed, float(ratio))
        # The sheath is one of the places that share what has no load.
        sharing = 1 + len(tendons.description.cord(cord.name).wraps)
        viscous, drag = (rubbing[key][k] / sharing for key in ("viscous", "drag"))
        viscous = max(cord.whole.damping + viscous, _RELAXATION * cord.whole.stiffness)
        beside = cord.whole.stiffness * (1.0 / cord.compliances[:-1] + 1.0 / cord.compliances[1:])
        # Places move as fast as they can without ringing.
        mass, wound = 0.25 * (viscous * cord.shares) ** 2 / beside, float(cord.table.group == WINCHES)
        values = rubbing["surface"][k], mass, viscous * cord.shares, drag * cord.shares, wound
        parameters.append(np.array(np.broadcast_arrays(*values)))
    return np.hstack(parameters)


def _slips(places: Rows, cords: Sequence[_Cord]) -> Rows:
    """Return the table of how far places are drawn in."""
    stiffness = np.concatenate([np.full(len(cord.shares), cord.whole.stiffness) for cord in cords])
    reading = {SHEATHS: np.eye(places.count)}
    return replace(
        places,
        group=_SLIPS,
        law=SHEATH_SLIP,
        parameters=stiffness[None],
        inputs={},
        loads={},
        readings=reading,
        curvature_offset=np.zeros(places.count),
        powers=(),
        source=None,
    )


def _pieces(places: Rows, cords: Sequence[_Cord]) -> Rows:
    """Return the table of the pieces behind places."""
    reading, compliance = np.zeros((places.count, places.count)), np.zeros(places.count)
    pretension = np.zeros(places.count)
    for cord in cords:
        own, parts = np.arange(cord.first, cord.first + len(cord.shares)), cord.compliances[1:]
        reading[own, own], reading[own[:-1], own[1:]] = 1.0 / parts, -1.0 / parts[:-1]
        if cord.table.group != WINCHES:
            compliance[own], pretension[own] = parts / cord.whole.stiffness, cord.whole.stiffness * cord.whole.slack
    return Rows(
        _PIECES,
        SHEATH_PIECE,
        places.names,
        np.array([compliance, pretension]),
        np.zeros_like(places.arm),
        readings={_SLIPS: reading},
        stored=_stored(cords),
        powers=(WINCH_ENERGY,),
    )


def _stored(cords: Sequence[_Cord]) -> Energy:
    """Return the energy of cords on spools, which their tables share; of winches none is stored."""
    return next((each.table.stored for each in cords if each.table.group != WINCHES), cords[0].table.stored)
