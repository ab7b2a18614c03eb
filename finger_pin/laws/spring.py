"""Springs: of joints, of tendons along paths, of elastic and passive tendons, and what any of them loses in a cycle.

Hysteresis is bristles beside a spring that hold a share of the spring's own force,

    F^s' = s0 (v - F^s |v| / max(h N, floor)),   N the magnitude of the spring's force

Rubber, flexures and braids give back less than was put in, by an amount that grows with the force and hardly depends on
speed: law (9) with the spring's force in place of the normal force says so with one number h. Where a spring k that was
relaxed is stretched by x, F^s = c k x solves the law with c = h / (1 + h k / s0); let go after it has slipped the other
way, it pulls with 1 - h / (1 - h k / s0) of its force.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.bristle import (
    bristle_energy,
    coulomb_loss,
    friction_level,
    stiction_rate,
    stiction_rate_slopes,
    viscous_loss,
)
from finger_pin.laws.law import Law, Row, on_positive_side
from finger_pin.laws.limiter import penetration
from finger_pin.typing import Number, Numbers, Numeric, Parameters


def spring_torque(position: Numeric, velocity: Numeric, stiffness: Numeric, rest: Numeric, damping: Numeric) -> Numeric:
    """Return tau^k = k (theta - theta_0) + c theta', N m.

    It enters (18) as -tau^k, so a positive torque acts against positive rotation.

    Args:
        position: theta, rad.
        velocity: theta', rad/s.
        stiffness: k, N m/rad.
        rest: theta_0, rad.
        damping: c, N m s/rad.
    """
    return stiffness * (position - rest) + damping * velocity


def spring_energy(position: Number, stiffness: Number, rest: Number) -> Number:
    """Return the elastic energy k (theta - theta_0)^2 / 2, J."""
    return 0.5 * stiffness * (position - rest) * (position - rest)


def _value(row: Row, p: Parameters) -> Numbers:
    stiffness, rest, damping = p
    return -spring_torque(row.length, row.speed, stiffness, rest, damping), 0.0 * row.length


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    stiffness, _, damping = p
    return (-stiffness, -damping, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    stiffness, rest, damping = p
    return spring_energy(row.length, stiffness, rest), viscous_loss(row.speed, damping)


#: A torsion spring between the links of a joint.
JOINT_SPRING = Law(
    name="joint spring",
    parameters=("stiffness", "rest", "damping"),
    value=_value,
    slopes=_slopes,
    account=_account,
    losses=("damping",),
)


def _constant(row: Row, p: Parameters) -> Numbers:
    (force,) = p
    return force + 0.0 * row.length, 0.0 * row.length


def _constant_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _constant_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    (constant,) = p
    return (-constant * row.length,)


#: A force that is the same everywhere, such as a weight that is compensated; it stores what it lets down.
CONSTANT_FORCE = Law("constant force", ("force",), _constant, _constant_slopes, _constant_account)


def half_tension(stretch: Number, stiffness: Number) -> Number:
    """Return max(0, K_h stretch), N: one half of a passive tendon, equations (5) and (12)."""
    return np.maximum(0.0, stiffness * stretch)


def _half_value(row: Row, p: Parameters) -> Numbers:
    (stiffness,) = p
    return half_tension(-row.length, stiffness), 0.0 * row.length


def _half_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    (stiffness,) = p
    by_length = -stiffness * (row.length < 0.0)
    return (by_length, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _half_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    (stiffness,) = p
    return (elastic_energy(-row.length, stiffness),)


#: One half of a passive tendon, a spring that only pulls; it is stretched where its length is negative.
TENDON_HALF = Law(
    name="half of a passive tendon (5), (12)",
    parameters=("stiffness",),
    value=_half_value,
    slopes=_half_slopes,
    account=_half_account,
)


def elastic_energy(stretch: Number, stiffness: Number) -> Number:
    """Return the elastic energy K e^2 / 2 of a tendon or of one half of a passive one, J; zero when slack."""
    return 0.5 * stiffness * np.maximum(0.0, stretch) ** 2


def _elastic_value(row: Row, p: Parameters) -> Numbers:
    stiffness, damping = p
    pull = -stiffness * row.length - damping * row.speed
    return pull * on_positive_side(pull, row.side), 0.0 * row.length, pull


def _elastic_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    stiffness, damping = p
    taut = on_positive_side(signals[0], row.side)
    return (-stiffness * taut, -damping * taut, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _elastic_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    (stiffness, _), stretch = p, np.maximum(0.0, -row.length)
    return elastic_energy(stretch, stiffness), (stiffness * stretch - force) * row.speed


#: f^m = max(0, K e + D e'); the stretch e is the length of the row taken negative.
ELASTIC_TENDON = Law(
    name="elastic tendon",
    parameters=("stiffness", "damping"),
    value=_elastic_value,
    slopes=_elastic_slopes,
    account=_elastic_account,
    signals=("pull",),
    losses=("damping",),
    kink="pull",
)


def _dead_band_value(row: Row, p: Parameters) -> Numbers:
    stiffness, lower, upper, damping = p
    stretch = penetration(row.length, lower, upper)
    return -stiffness * stretch - damping * row.speed, 0.0 * row.length, stretch


def _dead_band_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    stiffness, _, _, damping = p
    by_length = -stiffness * np.abs(np.sign(signals[0]))
    return (by_length, -damping, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _dead_band_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    stiffness, _, _, damping = p
    return spring_energy(signals[0], stiffness, 0.0), viscous_loss(row.speed, damping)


#: The spring of a MuJoCo tendon: it pushes below the first and pulls beyond the second of its spring lengths.
DEAD_BAND_SPRING = Law(
    name="spring with a dead band",
    parameters=("stiffness", "lower", "upper", "damping"),
    value=_dead_band_value,
    slopes=_dead_band_slopes,
    account=_dead_band_account,
    signals=("stretch",),
    losses=("damping",),
)


def _hysteresis_value(row: Row, p: Parameters) -> Numbers:
    share, stiffness, floor = p
    level = friction_level(row.load, share, floor)
    return -row.state, stiction_rate(row.state, row.speed, level, stiffness, row.side), level


def _hysteresis_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    share, stiffness, floor = p
    by_stiction, by_speed, by_level = stiction_rate_slopes(row.state, row.speed, signals[0], stiffness, row.side)
    by_load = by_level * share * (signals[0] > floor)
    return (0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0), (0.0, by_speed, by_stiction, by_load, 0.0, 0.0)


def _hysteresis_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    _, stiffness, _ = p
    return bristle_energy(row.state, stiffness), coulomb_loss(row.state, row.speed, signals[0])


#: Rate-independent loss of a spring in a cycle; the load is the spring's force.
HYSTERESIS = Law(
    name="hysteresis of a spring",
    parameters=("share", "stiffness", "floor"),
    value=_hysteresis_value,
    slopes=_hysteresis_slopes,
    account=_hysteresis_account,
    signals=("level",),
    losses=("coulomb",),
    scale=1e-2,
    kink="speed",
)
#: Stiffness of the bristles over the spring's: how sharply the force turns at a reversal.
BRISTLE_RATIO = 10.0
