"""Law of contact: Hunt-Crossley normal force and sticking bristle friction.

Normal, d = -gap: f_n = max(0, k d^p (1 + c d')) (Hunt and Crossley, J. Applied Mechanics 42, 1975).

Tangential: a bristle with spring and damper carries a tip that rubs with Coulomb friction. With z the bend of the
bristle, u the speed at which the tip slides, and v = z' + u,

    F = k_t (z + T z'),     |F| <= mu f_n,     u along F, and zero unless |F| = mu f_n.

Solved for F: w = z + T v is the bend that the bristle would take up if the tip stuck, and F = k_t s w with s = 1
where k_t |w| <= mu f_n, else the length that brings k_t w back to the cone; z' = (s w - z) / T. This is
the element of which the friction model of Xiong, Kikuuwe and Yamamoto (Tribology Letters 51, 2013) consists, here for
two tangents and a load that varies.

Where a contact resists spinning, the bend has a third component: the turn about the normal times a length r, at
which the law above has the moment M = r F_3. So |F|^2 + (M / r)^2 <= (mu f_n)^2, the ellipsoid that is MuJoCo's
elliptic cone (and, as a fair fit, a soft finger's limit surface: Howe and Cutkosky, Int. J. Robotics Research 15,
1996), with r = torsion / mu_k. Without slip along the tangents it begins to spin at r mu f_n.

What follows, whatever the normal force does meanwhile:

- |F| <= mu_s f_n, with the magnitude of both components.
- While the tip sticks, v = z': no creep at constant load, and no drift under vibration of either force.
- F v is k_t z z' (stored) plus k_t T z'^2 plus |F| u (lost): no cycle yields energy.
- With f_n = 0, s = 0: no force, and z is forgotten with the time constant T.

mu falls from mu_s to mu_k by exp(-(x / omega)^2), where x = (|w| - mu_s f_n / k_t) / T is the speed at which the tip
would slide if mu stayed at mu_s. So only sliding lowers mu, vibration of a tip that sticks does not. In steady sliding,
v = x + (mu_s - mu) f_n / (k_t T). A floor, a least level of friction below which the tip gives way gradually, keeps
slopes finite at f_n = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from finger_pin.laws.law import ContactLaw, Touch
from finger_pin.typing import Number, Numbers, Parameters


def _normal(touch: Touch, p: Parameters) -> Numbers:
    """Return d > 0 or 0, the spring force, the damping factor, and 1 for a contact that pushes, else 0."""
    stiffness, damping, exponent = p[:3]
    depth = -touch.gap * ((touch.gap < 0.0) | (touch.side > 0.0))
    factor = 1.0 - damping * touch.speed
    pushes = 1.0 * (factor * (touch.side == 0.0) + touch.side > 0.0)
    return depth, stiffness * np.abs(depth) ** (exponent - 1.0) * depth, factor, pushes


def _cone(touch: Touch, pressing: Number, p: Parameters) -> Numbers:
    """Return w, |w|, the sliding speed x that lowers mu, mu, and its excess over kinetic friction, mu - mu_k."""
    _, _, _, static, kinetic, stiffness, lag, stribeck, _, radius = p
    bend_1, bend_2 = touch.state_1 + lag * touch.slip_1, touch.state_2 + lag * touch.slip_2
    bend_3 = touch.state_3 + lag * (radius * touch.slip_3)
    bend = np.sqrt(bend_1 * bend_1 + bend_2 * bend_2 + bend_3 * bend_3)
    sliding = np.maximum(bend - static * pressing / stiffness, 0.0) / lag
    excess = (static - kinetic) * np.exp(-(sliding / stribeck) * (sliding / stribeck))
    return bend_1, bend_2, bend_3, bend, sliding, kinetic + excess, excess


def _value(touch: Touch, p: Parameters) -> Numbers:
    _, _, _, _, _, stiffness, lag, _, floor, radius = p
    _, spring, factor, pushes = _normal(touch, p)
    normal = spring * factor * pushes
    pressing = np.maximum(normal, 0.0)
    bend_1, bend_2, bend_3, bend, _, friction, _ = _cone(touch, pressing, p)
    level = friction * pressing
    share = level / np.maximum(np.maximum(stiffness * bend, level), floor)
    tip_1, tip_2, tip_3 = share * bend_1, share * bend_2, share * bend_3
    # The force bends sharply where the surfaces meet, and where the contact would begin to pull.
    grip = np.minimum(-touch.gap, factor)
    return (
        normal,
        -stiffness * tip_1,
        -stiffness * tip_2,
        -stiffness * tip_3 * radius,
        (tip_1 - touch.state_1) / lag,
        (tip_2 - touch.state_2) / lag,
        (tip_3 - touch.state_3) / lag,
        level,
        (1.0 - share) * bend / lag,
        grip,
    )


def _slopes(touch: Touch, p: Parameters, signals: Numbers) -> tuple[Numbers, ...]:
    kn, damping, exponent, static, _, stiffness, lag, stribeck, floor, radius = p
    depth, spring, factor, pushes = _normal(touch, p)
    touching = 1.0 * ((touch.gap < 0.0) | (touch.side > 0.0))
    normal = spring * factor * pushes
    by_gap = -kn * exponent * np.abs(depth) ** (exponent - 1.0) * factor * pushes * touching
    by_speed = -damping * spring * pushes
    # A step held in touch must not depend on whether its start is just before or just behind the touch.
    pressing, pressed = np.maximum(normal, 0.0), 1.0 * ((normal > 0.0) | (touch.side > 0.0))
    bend_1, bend_2, bend_3, bend, sliding, friction, excess = _cone(touch, pressing, p)
    level = friction * pressing
    scale_force = np.maximum(np.maximum(stiffness * bend, level), floor)
    share = level / scale_force
    # Of mu by |w|, then of the level and of the share by f_n and by |w|.
    falling = -2.0 * excess * sliding / (stribeck * stribeck * lag)
    level_n = (friction - pressing * falling * static / stiffness) * pressed
    level_b = pressing * falling
    outside = 1.0 * ((stiffness * bend >= level) & (stiffness * bend >= floor))
    inside = 1.0 * ((level > stiffness * bend) & (level >= floor))
    share_n = level_n * (1.0 - inside * share) / scale_force
    share_b = (level_b * (1.0 - inside * share) - outside * share * stiffness) / scale_force
    # |w| by its components; at w = 0 it has no slope, and needs none.
    scale = np.maximum(bend, 1e-300)
    along_1, along_2, along_3 = bend_1 / scale, bend_2 / scale, bend_3 / scale
    # The tip's bend s w by f_n and by w.
    n_1, n_2, n_3 = share_n * bend_1, share_n * bend_2, share_n * bend_3
    b_11, b_22 = share + share_b * along_1 * bend_1, share + share_b * along_2 * bend_2
    b_33, b_12 = share + share_b * along_3 * bend_3, share_b * along_2 * bend_1
    b_13, b_23 = share_b * along_3 * bend_1, share_b * along_3 * bend_2
    by_normal = (by_gap, by_speed)
    first, second, third = (n_1, b_11, b_12, b_13), (n_2, b_12, b_22, b_23), (n_3, b_13, b_23, b_33)
    return (
        (by_gap, by_speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        _force_slopes(-stiffness, first, by_normal, lag, radius),
        _force_slopes(-stiffness, second, by_normal, lag, radius),
        _force_slopes(-stiffness * radius, third, by_normal, lag, radius),
        _rate_slopes((1.0, 0.0, 0.0), first, by_normal, lag, radius),
        _rate_slopes((0.0, 1.0, 0.0), second, by_normal, lag, radius),
        _rate_slopes((0.0, 0.0, 1.0), third, by_normal, lag, radius),
    )


def _force_slopes(factor: Number, bend: Numbers, by_normal: Numbers, lag: Number, radius: Number) -> Numbers:
    """Return the slopes of a multiple of a component of the tip's bend, given by f_n and by w."""
    n, b_1, b_2, b_3 = bend
    by_1, by_2, by_3, (by_gap, by_speed) = factor * b_1, factor * b_2, factor * b_3, by_normal
    return factor * n * by_gap, factor * n * by_speed, lag * by_1, lag * by_2, lag * radius * by_3, by_1, by_2, by_3


def _rate_slopes(unit: Numbers, bend: Numbers, by_normal: Numbers, lag: Number, radius: Number) -> Numbers:
    """Return the slopes of z' = (tip - z) / T of a component."""
    (n, b_1, b_2, b_3), (u_1, u_2, u_3), (by_gap, by_speed) = bend, unit, by_normal
    by_states = (b_1 - u_1) / lag, (b_2 - u_2) / lag, (b_3 - u_3) / lag
    return n * by_gap / lag, n * by_speed / lag, b_1, b_2, radius * b_3, *by_states


def _account(
    touch: Touch, p: Parameters, forces: Sequence[Number], rates: Sequence[Number], signals: Numbers
) -> Numbers:
    _, _, exponent, _, _, stiffness, lag, _, _, _ = p
    depth, spring, _, _ = _normal(touch, p)
    bent = touch.state_1 * touch.state_1 + touch.state_2 * touch.state_2 + touch.state_3 * touch.state_3
    # Of the spin, at the length r: from the tip's bend, as r may be zero.
    third = stiffness * (touch.state_3 + lag * rates[2])
    rubbing = np.sqrt(forces[1] * forces[1] + forces[2] * forces[2] + third * third)
    return (
        spring * depth / (exponent + 1.0) + 0.5 * stiffness * bent,
        (spring - forces[0]) * touch.speed,
        rubbing * signals[1],
        stiffness * lag * (rates[0] * rates[0] + rates[1] * rates[1] + rates[2] * rates[2]),
    )


#: Contact of two surfaces that resists no spinning.
CONTACT = ContactLaw(
    name="contact",
    parameters=(
        "stiffness",
        "damping",
        "exponent",
        "static",
        "kinetic",
        "tangential_stiffness",
        "lag",
        "stribeck_velocity",
        "floor",
        "torsion_radius",
    ),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("level", "sliding_speed", "grip"),
    losses=("impact", "sliding", "micro_damping"),
    scale=1e-5,
    kink="grip",
)
#: Contact of two surfaces with torsional friction.
TORSIONAL_CONTACT = replace(CONTACT, name="contact with torsion", arms=4)
