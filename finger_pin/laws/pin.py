"""Other laws for the friction of a joint's pin than the paper's (9), by name: Dahl's, and Coulomb's without bristles.

Dahl's is (9a) without Stribeck's curve, F^s' = sigma_0 (v - F^s |v| / (M^d R)): presliding with one coefficient
(P. Dahl, A Solid Friction Model, Aerospace Corporation TOR-0158(3107-18)-1, 1968). Coulomb's is a function of the speed
alone, M^d R tanh(v / v_r) + b v: it needs no state and cannot stick; below its level it creeps. A drag that no load
makes adds to M^d R in both; where it differs by direction, Coulomb's is drag t (1 + a t) with t = tanh(v / v_r).
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.bristle import (
    PIN_FRICTION,
    bristle_account,
    bristle_stiffness,
    directed_drag,
    friction_force,
    friction_level,
    stiction_rate,
    stiction_rate_slopes,
)
from finger_pin.laws.law import Law, Row, direction
from finger_pin.typing import Number, Numbers, Parameters

#: Signals that any law of a joint's friction gives.
SIGNALS = ("friction", "normal_force", "coefficient", "level")


def _dahl_value(row: Row, p: Parameters) -> Numbers:
    kinetic, base_stiffness, viscous, floor, hardening, drag, asymmetry = p
    drag_level = directed_drag(drag, asymmetry, direction(row.speed, row.side))
    level = friction_level(row.load, kinetic, floor, drag_level)
    rate = stiction_rate(row.state, row.speed, level, bristle_stiffness(row.state, base_stiffness, hardening), row.side)
    loss = friction_force(row.state, row.speed, viscous)
    return -loss, rate, loss, row.load, kinetic + 0.0 * row.load, level


def _dahl_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    kinetic, base_stiffness, viscous, floor, hardening, _, _ = p
    level = signals[3]
    stiffness = bristle_stiffness(row.state, base_stiffness, hardening)
    by_stiction, by_speed, by_level = stiction_rate_slopes(row.state, row.speed, level, stiffness, row.side, hardening)
    by_load = by_level * (level > floor) * kinetic
    return (0.0, -viscous, -1.0, 0.0, 0.0, 0.0, 0.0), (0.0, by_speed, by_stiction, by_load, 0.0, 0.0)


def _dahl_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    _, base_stiffness, viscous, _, hardening, _, _ = p
    return bristle_account(row.speed, row.state, rate, signals[3], base_stiffness, viscous, 0.0, hardening)


def _coulomb_value(row: Row, p: Parameters) -> Numbers:
    kinetic, viscous, reversal_speed, drag, asymmetry = p
    share = np.tanh(row.speed / reversal_speed)
    level = kinetic * row.load + directed_drag(drag, asymmetry, share)
    loss = level * share + viscous * row.speed
    return -loss, 0.0 * row.speed, loss, row.load, kinetic + 0.0 * row.load, level


def _coulomb_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    kinetic, viscous, reversal_speed, drag, asymmetry = p
    share = np.tanh(row.speed / reversal_speed)
    by_share = signals[3] + drag * asymmetry * share
    by_speed = -by_share * (1.0 - share * share) / reversal_speed - viscous
    return (0.0, by_speed, 0.0, 0.0, -kinetic * share, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _coulomb_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    _, viscous, reversal_speed, _, _ = p
    dry = signals[3] * np.tanh(row.speed / reversal_speed) * row.speed
    return 0.0 * row.speed, dry, viscous * row.speed * row.speed, 0.0 * row.speed


DAHL = Law(
    name="Dahl friction of a pin",
    parameters=("kinetic", "stiffness", "viscous", "floor", "hardening", "drag", "drag_asymmetry"),
    value=_dahl_value,
    slopes=_dahl_slopes,
    account=_dahl_account,
    signals=SIGNALS,
    losses=PIN_FRICTION.losses,
    scale=PIN_FRICTION.scale,
    kink="speed",
)
COULOMB = Law(
    name="Coulomb and viscous friction of a pin",
    parameters=("kinetic", "viscous", "reversal_speed", "drag", "drag_asymmetry"),
    value=_coulomb_value,
    slopes=_coulomb_slopes,
    account=_coulomb_account,
    signals=SIGNALS,
    losses=PIN_FRICTION.losses,
)
#: By the names that a description chooses them by.
PIN_LAWS = {"lugre": PIN_FRICTION, "dahl": DAHL, "coulomb": COULOMB}
