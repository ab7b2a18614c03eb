"""Directions from a minimum along which recordings leave it open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.identification.intervals import CHI2_95
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.gauss_newton import Fit, fit, information
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

# Standard deviation, part of the range, from which on a direction is free: an interval of 95 % is as wide as the range.
_FREE_DEVIATION = 0.25
# Entries of a direction that are left out of its words, part of the largest.
_SMALL_ENTRY = 0.15
# Parameters that are left out of the words of a step, part of the largest move over its range.
_SMALL_MOVE = 0.01
# Least step that is worth a try, part of that by which a free direction may move.
_LEAST_STEP = 0.1


class OpenDirection(NamedTuple):
    """A combination of parameters that the recordings leave open by slopes.

    Attributes:
        text: The direction in words.
        parameters: Indices of the parameters that it leaves open; none where a refit has shown otherwise.
    """

    text: str
    parameters: tuple[int, ...]


def open_directions(
    objective: Objective[Residuals], minimum: Fit, loss: str = "linear", refits: bool = True
) -> list[OpenDirection]:
    """Return the combinations that the recordings leave open, each with a step along it that a refit has tried.

    Args:
        objective: The objective that was fitted.
        minimum: Of the objective.
        loss: As for `fit`.
        refits: Whether a refit tries it.
    """
    width = objective.width
    values, vectors = np.linalg.eigh(information(objective, minimum) * np.outer(width, width))
    directions = []
    for value, vector in zip(values, vectors.T, strict=True):
        if 1.0 / math.sqrt(max(value, 1e-300)) >= _FREE_DEVIATION:
            direction = vector * width
            # In parts of the ranges: what has little room is moved across it by little.
            size = np.abs(vector) / np.max(np.abs(vector))
            shown = [k for k in range(len(size)) if size[k] > _SMALL_ENTRY]
            directions.append(_describe(objective, minimum, direction, shown, loss, refits))
    return directions


def _describe(
    objective: Objective[Residuals], minimum: Fit, direction: Array, shown: Sequence[int], loss: str, refits: bool
) -> OpenDirection:
    """Return a direction of z in words, after a try if there is no simpler form."""
    size = np.abs(direction) / np.max(np.abs(direction))
    parameters, names = objective.function.parameters, [objective.function.parameters.keys[k] for k in shown]
    if len(shown) == 1:
        return OpenDirection(f"{names[0]} is not determined: the recording hardly feels it", tuple(shown))
    if len(shown) == 2 and all(parameters.logarithmic[shown]) and min(size[shown]) > 0.8:
        same_sign = direction[shown[0]] * direction[shown[1]] > 0.0
        combination = "quotient" if same_sign else "product"
        text = f"of {names[0]} and {names[1]} only the {combination} is determined"
        return OpenDirection(text, tuple(shown))
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    step = _step_within_bounds(objective, minimum.z, direction) if refits else None
    if step is None:
        reason = "the bounds leave no room for a try" if refits else "nothing was tried"
        text = f"by slopes a combination of {listed} is open, along which {reason}"
        return OpenDirection(text, tuple(shown))
    # A step away of the parameter that it moves the most, the others are fitted anew.
    start, k = minimum.z + step, int(np.argmax(np.abs(step) / objective.width))
    fixed = {k: float(start[k])}
    refit = fit(objective, start, fixed=fixed, weights=minimum.weights, scale=minimum.noise, loss=loss)
    rise, example = refit.objective - minimum.objective, _step_text(objective, refit.z - minimum.z)
    if rise < CHI2_95:
        text = f"only a combination of {listed} is determined: with {example} the recordings are met as well"
        return OpenDirection(f"{text} (2 log L falls by {max(rise, 0.0):.2g}; 3.8 ends an interval)", tuple(shown))
    worse = f"2 log L falls by {rise:.3g}" if math.isfinite(rise) else "the motion fails"
    text = f"by slopes a combination of {listed} is open, but with {example} {worse} (3.8 ends an interval)"
    return OpenDirection(text, ())


def _step_within_bounds(objective: Objective[Residuals], z: Array, direction: Array) -> Array | None:
    """Return the longer of the two steps along a direction that stay within the bounds; None if both are short."""
    low, high = objective.box
    full = direction * _FREE_DEVIATION / np.max(np.abs(direction) / (high - low))
    steps = []
    for step in (full, -full):
        room = np.where(step > 0.0, high - z, z - low)
        shares = np.divide(room, np.abs(step), out=np.full(len(z), np.inf), where=step != 0.0)
        # Entries that hardly count are cut at their bounds.
        size = np.abs(step) / (high - low)
        counted = size > _SMALL_ENTRY * np.max(size)
        share = min(1.0, float(np.min(shares[counted])))
        steps.append((share, np.clip(z + share * step, low, high) - z))
    share, longest = max(steps, key=lambda pair: pair[0])
    return longest if share >= _LEAST_STEP else None


def _step_text(objective: Objective[Residuals], step: Array) -> str:
    """Return a step in words: all parameters that it moves."""
    size = np.abs(step) / objective.width
    parameters, parts = objective.function.parameters, []
    for k in np.flatnonzero(size > _SMALL_MOVE * np.max(size)):
        change = f"times {math.exp(step[k]):.3g}" if parameters.logarithmic[k] else f"plus {step[k]:.3g}"
        if change != "times 1":
            parts.append(f"{parameters.keys[k]} {change}")
    return ", ".join(parts)
