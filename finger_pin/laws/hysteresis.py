"""Hysteresis of a spring: bristles beside it that hold a share of the spring's own force.

    F^s' = s0 (v - F^s |v| / max(h N, floor)),   N the magnitude of the spring's force

Rubber, flexures and braids give back less than was put in, by an amount that grows with the force and hardly depends on
speed: law (9) with the spring's force in place of the normal force says so with one number h. Where a spring k that was
relaxed is stretched by x, F^s = c k x solves the law with c = h / (1 + h k / s0); let go after it has slipped the other
way, it pulls with 1 - h / (1 - h k / s0) of its force.
"""

from __future__ import annotations

from typing import Any

from finger_pin.laws.bristle import bristle_energy, coulomb_loss, friction_level, stiction_rate, stiction_rate_slopes
from finger_pin.laws.law import Law, Row


def _value(row: Row, p: Any) -> Any:
    share, stiffness, floor = p
    level = friction_level(row.load, share, floor)
    return -row.state, stiction_rate(row.state, row.speed, level, stiffness, row.side), level


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    share, stiffness, floor = p
    own, by_speed, by_level = stiction_rate_slopes(row.state, row.speed, signals[0], stiffness, row.side)
    by_load = by_level * share * (signals[0] > floor)
    return (0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0), (0.0, by_speed, own, by_load, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    return bristle_energy(row.state, p[1]), coulomb_loss(row.state, row.speed, signals[0])


#: What a spring loses in a cycle whatever its speed; the load is the spring's force.
HYSTERESIS = Law(
    name="hysteresis of a spring",
    parameters=("share", "stiffness", "floor"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("level",),
    losses=("coulomb",),
    scale=1e-2,
    kink="speed",
)
#: The stiffness of its bristles over the spring's own: how sharply the force turns where the motion does.
STIFFER = 10.0
