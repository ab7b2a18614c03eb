"""A muscle: activation, force by length and speed, and passive force, as MuJoCo's (Modeling, Muscle actuators).

With L = (l - l_0) / L_0 the length in optimal lengths and V = l' / (L_0 v_max) the speed,

    f = -F (a F_L(L) F_V(V) + F_P(L)),      a' = (u - a) / tau,

F_L a hump of four parabolas from l_min over 1 to l_max, F_V 0 at V = -1, 1 at V = 0 and f_vmax where it is lengthened
fast, F_P f_pmax at l_max. The command u is the excitation, between 0 and 1. tau is tau_1 (1/2 + 3/2 a) while a rises
and tau_2 / (1/2 + 3/2 a) while it falls; with smoothing the one passes into the other over a width of u - a. The
passive part is elastic; what the active part does along the path is supplied, negative where a muscle is lengthened.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.law import Law, Row
from finger_pin.typing import Number, Numbers, Parameters

# Least width or margin, in place of zero.
_LEAST_WIDTH = 1e-15


def _clip01(x: Number) -> Number:
    return np.minimum(np.maximum(x, 0.0), 1.0)


def _length_share(length: Number, shortest: Number, longest: Number) -> tuple[Number, Number]:
    """Return F_L and its slope: 2 s^2 up to s = 1/2 and 1 - 2 (1 - s)^2 from there on either side of L = 1."""
    rising, falling = (_clip01((length - shortest) / (1.0 - shortest)), _clip01((longest - length) / (longest - 1.0)))
    bent, folded = np.maximum(rising - 0.5, 0.0), np.maximum(falling - 0.5, 0.0)
    up, down = 2.0 * rising * rising - 4.0 * bent * bent, 2.0 * falling * falling - 4.0 * folded * folded
    slope_up, slope_down = 4.0 * rising - 8.0 * bent, 4.0 * falling - 8.0 * folded
    return up * down, slope_up / (1.0 - shortest) * down - up * slope_down / (longest - 1.0)


def _work(row: Row, p: Parameters, signals: Numbers) -> Number:
    peak, optimal, origin, shortest, longest = p[:5]
    stretch = (row.length - origin) / optimal
    rising, falling = (_clip01((stretch - shortest) / (1.0 - shortest)), _clip01((longest - stretch) / (longest - 1.0)))
    up, down = ((2.0 * s**3 - 4.0 * np.maximum(s - 0.5, 0.0) ** 3) / 3.0 for s in (rising, falling))
    return -peak * row.state * optimal * ((1.0 - shortest) * up + (longest - 1.0) * (0.5 - down))


def _speed_share(speed: Number, lengthening: Number) -> tuple[Number, Number]:
    """Return F_V and its slope: (1 + V)^2 while it is shortened, a parabola up to f_vmax while it is lengthened."""
    most = np.maximum(lengthening - 1.0, _LEAST_WIDTH)
    shortened = 1.0 + np.minimum(np.maximum(speed, -1.0), 0.0)
    lengthened = np.minimum(np.maximum(speed, 0.0), most)
    share = shortened * shortened + lengthened * (2.0 - lengthened / most)
    return share, 2.0 * shortened * (speed <= 0.0) + 2.0 * (1.0 - lengthened / most) * (speed > 0.0)


def _stretch(length: Number, longest: Number) -> tuple[Number, Number]:
    """Return the excess of L over 1, and over the middle of 1 and l_max, both over half of l_max - 1."""
    stretched = np.maximum(length - 1.0, 0.0) / (0.5 * (longest - 1.0))
    return stretched, np.maximum(stretched - 1.0, 0.0)


def _rising_share(lead: Number, smoothing: Number) -> tuple[Number, Number]:
    """Return the share of the time constant of rising in tau, and its slope by u - a."""
    width = np.maximum(smoothing, _LEAST_WIDTH)
    x = _clip01(lead / width + 0.5)
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0), 30.0 * x * x * (1.0 - x) * (1.0 - x) / width


def _value(row: Row, p: Parameters) -> Numbers:
    peak, optimal, origin, shortest, longest, fastest, passive, lengthening, rising, falling, smoothing, least, most = p
    length, speed = (row.length - origin) / optimal, row.speed / (optimal * fastest)
    stretched, beyond = _stretch(length, longest)
    gain = peak * _length_share(length, shortest, longest)[0] * _speed_share(speed, lengthening)[0]
    active, elastic = gain * row.state, peak * passive * 0.5 * (stretched * stretched - beyond * beyond)
    pace = 0.5 + 1.5 * _clip01(row.state)
    lead = np.minimum(np.maximum(row.command, least), most) - row.state
    slow = falling / pace
    tau = slow + (rising * pace - slow) * _rising_share(lead, smoothing)[0]
    return -active - elastic, lead / tau, active


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    peak, optimal, origin, shortest, longest, fastest, passive, lengthening, rising, falling, smoothing, least, most = p
    length, speed = (row.length - origin) / optimal, row.speed / (optimal * fastest)
    stretched, beyond = _stretch(length, longest)
    length_share, length_slope = _length_share(length, shortest, longest)
    share, share_slope = _speed_share(speed, lengthening)
    stiff = passive * (stretched - beyond) / (0.5 * (longest - 1.0))
    by_length = -peak * (row.state * length_slope * share + stiff) / optimal
    by_speed = -peak * row.state * length_share * share_slope / (optimal * fastest)
    pace, activation_free = 0.5 + 1.5 * _clip01(row.state), 1.5 * (row.state > 0.0) * (row.state < 1.0)
    command_free = 1.0 * (row.command > least) * (row.command < most)
    lead = np.minimum(np.maximum(row.command, least), most) - row.state
    rising_part, rising_slope = _rising_share(lead, smoothing)
    slow = falling / pace
    tau = slow + (rising * pace - slow) * rising_part
    by_lead = 1.0 / tau - lead / tau * rising_slope * (rising * pace - slow) / tau
    by_pace = -lead / tau * (rising * rising_part - slow / pace * (1.0 - rising_part)) / tau
    rate = (0.0, 0.0, by_pace * activation_free - by_lead, 0.0, command_free * by_lead, 0.0)
    return (by_length, by_speed, -peak * length_share * share, 0.0, 0.0, 0.0, 0.0), rate


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    peak, optimal, origin, _, longest, _, passive, _, _, _, _, _, _ = p
    stretched, beyond = _stretch((row.length - origin) / optimal, longest)
    half = 0.5 * (longest - 1.0) * optimal
    stored = peak * passive * half * (stretched * stretched * stretched - beyond * beyond * beyond) / 6.0
    return stored, -signals[0] * row.speed


#: Pulls along a path; its state is the activation.
MUSCLE = Law(
    name="muscle",
    parameters=(
        "peak",
        "optimal",
        "origin",
        "shortest",
        "longest",
        "fastest",
        "passive",
        "lengthening",
        "rising",
        "falling",
        "smoothing",
        "lowest",
        "highest",
    ),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("active",),
    supplies=("actuators",),
    scale=1.0,
    work=_work,
)
