"""Colours of tensions and forces, the same on the page, in films, in meshcat's window and in the playground."""

from __future__ import annotations

import math

import numpy as np

from finger_pin.typing import Array

#: Below this tension a tendon is drawn loose, wholly at none, N.
SLACK_TENSION = 0.05
# Colours of tensions, red, green and blue, from none to the largest: the upper three quarters of viridis, which is
# perceptually uniform and safe for colour-blind readers; its darkest quarter would vanish on a dark background.
_TENSION_COLOURS = (
    *((0.230, 0.322, 0.546), (0.207, 0.372, 0.553), (0.186, 0.419, 0.557), (0.167, 0.464, 0.558)),
    *((0.149, 0.508, 0.557), (0.132, 0.552, 0.553), (0.121, 0.596, 0.544), (0.125, 0.640, 0.527)),
    *((0.158, 0.684, 0.502), (0.220, 0.726, 0.466), (0.304, 0.765, 0.420), (0.404, 0.800, 0.363)),
    *((0.516, 0.831, 0.294), (0.637, 0.857, 0.217), (0.762, 0.876, 0.137), (0.886, 0.892, 0.095)),
    (0.993, 0.906, 0.144),
)
_SLACK_COLOUR = (0.62, 0.64, 0.67)
# Of a cord without a known tension, which no tension has.
_CORD_COLOUR = (0.93, 0.9, 0.82)
#: The same for the page.
PAGE_COLOURS = {"tension": _TENSION_COLOURS, "slack": _SLACK_COLOUR, "cord": _CORD_COLOUR}
#: Of the arrow of a contact's force, at both ends: that of the page, which no tension has.
FORCE_COLOUR = np.tile(np.array([0xFF, 0x5A, 0x5A]) / 255.0, (2, 1))


def looseness(tension: Array) -> Array:
    """Return how loose a tendon is drawn at a tension, N: 0 if it is taut, 1 at no tension."""
    return np.clip(1.0 - tension / SLACK_TENSION, 0.0, 1.0)


def tension_colours(tension: Array, scale: float) -> Array:
    """Return the colour of tensions, shape (..., 3): the upper part of viridis up to a scale, N; grey when loose."""
    place = np.clip(tension / scale, 0.0, 1.0) * (len(_TENSION_COLOURS) - 1)
    channels = np.array(_TENSION_COLOURS).T
    taut = np.stack([np.interp(place, np.arange(len(channel)), channel) for channel in channels], axis=-1)
    return np.asarray(taut + looseness(tension)[..., None] * (np.array(_SLACK_COLOUR) - taut))


def strand_colours(tension: Array, scale: float) -> Array:
    """Return the colours of strands, shape (s + 1, 3), the last of which is that of cords without a known tension.

    Args:
        tension: Shape (s,), N.
        scale: As for `tension_colours`.
    """
    return np.concatenate([tension_colours(tension, scale), [_CORD_COLOUR]])


def tension_scale(tension: float) -> float:
    """Return the upper end of a legend of tensions, N: its quarters are short numbers."""
    if not tension > 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(tension))
    return float(next(step * decade for step in (1, 2, 4, 6, 8, 10) if step * decade >= tension * (1.0 - 1e-9)))
