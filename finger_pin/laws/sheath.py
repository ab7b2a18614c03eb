"""A cord that stretches within its sheath while it rubs there: pieces in series, and the places where they rub.

A place slides, at the speed w, by what the tensions before and behind it differ beyond the Coulomb level of (14), (16),
and holds below it, without creep:

    m w' = F - clip(F, -L, L) - b w,   F = T_(i-1) - T_i,   L = tanh(mu_e phi_i / 2) (T_(i-1) + T_i) + drag_i

How far it is drawn in beyond the cord behind the sheath is y / K, K the stiffness of the whole cord: y' = K (w - l'),
so that a sheath is relaxed with y = 0 in every posture. A piece i of stiffness K_i has the tension
max(0, T_p + (K_i / K) (y_i - y_(i+1))), T_p its pretension, and the entrance K_0 (u - l) - (K_0 / K) y_1, u what is
wound in.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.capstan import capstan_coefficient, capstan_slope
from finger_pin.laws.law import Law, Row, on_positive_side
from finger_pin.laws.spring import elastic_energy
from finger_pin.typing import Number, Numbers, Parameters


def _pull(row: Row, p: Parameters, length: Number) -> Numbers:
    pull = row.reading - p[0] * length - p[1] * row.speed
    return np.minimum(pull * on_positive_side(pull, row.side), p[2]), 0.0 * row.length, pull


def _entrance_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    stiffness, damping, most = p
    free = on_positive_side(signals[0], row.side) * (signals[0] < most)
    force = (-free * stiffness, -free * damping, 0.0, 0.0, 0.0, free * stiffness, 0.0, free)
    return force, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _winch(row: Row, p: Parameters) -> Numbers:
    return _pull(row, p, row.length - row.command)


def _winch_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    return 0.0 * force, force * row.speed


def _spool(row: Row, p: Parameters) -> Numbers:
    return _pull(row, p, row.length)


def _spool_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    by_length, by_speed, _, _, _, _, _, by_reading = _entrance_slopes(row, p, signals)[0]
    return (by_length, by_speed, 0.0, 0.0, 0.0, 0.0, 0.0, by_reading), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _spool_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    stretch = np.maximum(0.0, row.reading / p[0] - row.length)
    return elastic_energy(stretch, p[0]), (p[0] * stretch - force) * row.speed


#: A winch's cord, up to the first place where it rubs; what the winch supplies passes its cord, as without a sheath.
WOUND_ENTRANCE = Law(
    name="winch of a sheathed cord",
    parameters=("stiffness", "damping", "most"),
    value=_winch,
    slopes=_entrance_slopes,
    account=_winch_account,
    signals=("pull",),
    supplies=("winch",),
    kink="pull",
    reads_states=True,
)
#: The same of a cord on a spool.
SPOOL_ENTRANCE = Law(
    name="spool of a sheathed cord",
    parameters=("stiffness", "damping", "most"),
    value=_spool,
    slopes=_spool_slopes,
    account=_spool_account,
    signals=("pull",),
    losses=("damping",),
    kink="pull",
    reads_states=True,
)


def _piece(row: Row, p: Parameters) -> Numbers:
    return np.maximum(0.0, p[1] + row.reading), 0.0 * row.reading


def _piece_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    by_reading = 1.0 * (p[1] + row.reading > 0.0)
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, by_reading), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _piece_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    # Without an arm it has no speed, and no power.
    return 0.5 * p[0] * force * force, force * row.speed


#: A piece behind a place, which its states stretch; it has no arm. The compliance is zero of a winch's cord.
SHEATH_PIECE = Law(
    name="piece of a sheathed cord",
    parameters=("compliance", "pretension"),
    value=_piece,
    slopes=_piece_slopes,
    account=_piece_account,
    supplies=("winch",),
    reads_states=True,
)


def _place(row: Row, p: Parameters) -> Numbers:
    surface, mass, viscous, drag, _ = p
    loss = row.load - row.command
    level = capstan_coefficient(surface, row.curvature) * (row.load + row.command) + drag
    held = np.minimum(np.maximum(loss, -level), level)
    return -loss, (loss - held - viscous * row.state) / mass, loss, held, level


def _place_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    surface, mass, viscous, _, _ = p
    excess = signals[0] - signals[1]
    sign, gain = np.sign(excess), np.abs(np.sign(excess)) / mass
    coefficient = capstan_coefficient(surface, row.curvature)
    by_load, by_command = gain * (1.0 - sign * coefficient), gain * (-1.0 - sign * coefficient)
    by_curvature = -gain * sign * (row.load + row.command) * capstan_slope(surface, coefficient)
    return (0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0), (0.0, 0.0, -viscous / mass, by_load, by_command, by_curvature)


def _place_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    _, mass, viscous, _, wound = p
    speed = row.state
    supplied = wound * signals[0] * (speed - row.speed)
    return 0.5 * mass * speed * speed, supplied, signals[1] * speed, viscous * speed * speed


#: A place where a sheathed cord rubs, along the cord behind the sheath: T_i - T_(i-1). Its load is the tension before
#: it, its input that behind it. What it stretches is stored by pieces, or, wound, supplied by the winch.
SHEATH_PLACE = Law(
    name="place in a sheath (14), (16)",
    parameters=("surface", "mass", "viscous", "drag", "wound"),
    value=_place,
    slopes=_place_slopes,
    account=_place_account,
    signals=("friction", "held", "level"),
    supplies=("winch",),
    losses=("coulomb", "viscous"),
    scale=0.01,
)


def _slip(row: Row, p: Parameters) -> Numbers:
    return 0.0 * row.speed, p[0] * (row.reading - row.speed)


def _slip_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, -p[0], 0.0, 0.0, 0.0, 0.0, p[0])


def _slip_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    return (0.0 * force,)


#: How far a place is drawn in beyond the cord behind the sheath, times K, N.
SHEATH_SLIP = Law(
    name="slip of a sheathed cord",
    parameters=("stiffness",),
    value=_slip,
    slopes=_slip_slopes,
    account=_slip_account,
    scale=1.0,
    reads_states=True,
)
