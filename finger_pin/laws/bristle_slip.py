"""Slip of bristles that give by a length, so that a tendon that turns often delivers the capstan law.

While a pull changes over a sliding length x, F^s of (9a) lags behind its level by a part delta / (x (1 + mu^d)), with
the length delta over which bristles harden. What arrives is the difference of the pull and F^s. Round many turns it is
small, and that lag is about e^(mu_e phi) / 2 times as large a part of it; of many rows in series, each with its own
bristle at its own tension, it would be mu_e phi times delta / x.

(9a) is F^s' = sigma_0 (v - g |v|) with g = F^s / level = r. Here, for |r| up to 1 and beyond,

    g = r / (s - (s - 1) |r|),    g = sign(r) (1 + s (|r| - 1)),    s = 1 / (1 - mu^d^2),

which settles at the same level, with slope s there: the lag is then at most 2 delta / x of what arrives, at any turn.
As g has the sign of F^s, what slips is lost, and the law stays passive whatever the load does. Round small bends s
nears 1, and g is r. A stated stiffness keeps (9a) as printed.

F^s / g is a level as (9a) has one, ``slip_level``.
"""

from __future__ import annotations

import numpy as np

from finger_pin.typing import Number

# The least 1 - mu^d^2 that counts, that of mu_e phi = 15.
_LEAST_REMAINDER = 1e-6


def slip_steepness(coefficient: Number, hardening: Number) -> Number:
    """Return s, the slope of the slip at the level, of mu^d; 1 without hardening."""
    remainder = np.maximum(1.0 - coefficient * coefficient, _LEAST_REMAINDER)
    return 1.0 + (hardening > 0.0) * (1.0 / remainder - 1.0)


def slip_steepness_slope(coefficient: Number, hardening: Number) -> Number:
    """Return ds / dmu^d."""
    remainder = np.maximum(1.0 - coefficient * coefficient, _LEAST_REMAINDER)
    return (hardening > 0.0) * (remainder > _LEAST_REMAINDER) * (2.0 * coefficient / (remainder * remainder))


def slip_level(stiction: Number, level: Number, steepness: Number) -> Number:
    """Return F^s / g, the level by which bristles slip in (9a); the level itself where s is 1."""
    excess, lack = np.maximum(np.abs(stiction) - level, 0.0), np.maximum(level - np.abs(stiction), 0.0)
    return (level + (steepness - 1.0) * lack) * ((level + excess) / (level + steepness * excess))


def slip_level_slopes(stiction: Number, level: Number, steepness: Number) -> tuple[Number, Number, Number]:
    """Return the derivatives of `slip_level` by F^s, the level and s."""
    excess, lack = np.maximum(np.abs(stiction) - level, 0.0), np.maximum(level - np.abs(stiction), 0.0)
    steep = level + steepness * excess
    share, size = level / steep, (level + excess) / steep
    by_stiction = (1.0 - steepness) * share * share * np.sign(stiction)
    return by_stiction, steepness * size * size, lack - size * share * excess
