"""Contacts in the linear systems of `condensation`: three rows and two states at once, and what they do to pins."""

from __future__ import annotations

from typing import Any

from finger_pin.core import law_code as at
from finger_pin.core.compilation import compiled
from finger_pin.core.paths import passes


@compiled
def _add_inputs(tables: Any, k: int, weights: Any, linear: Any, out: Any) -> None:
    """Add the change of a contact's gap, speed and slips, with a weight each."""
    width = linear.mass.shape[0]
    for m in range(3):
        by_length, by_speed = (weights[0] if m == 0 else 0.0), weights[m + 1]
        for e in range(tables.arm_start[k + m], tables.arm_start[k + m + 1]):
            j = tables.arm_at[e]
            out[j] += by_length * linear.measure[e] + by_speed * linear.turning[e]
            out[width + j] += by_speed * linear.arm[e]


@compiled
def _contact_gains(tables: Any, g: float, k: int, work: Any, linear: Any) -> None:
    """Fill the gains of the three rows of a contact and of its two states."""
    width, slopes = linear.mass.shape[0], work.slopes
    wide = linear.load.size
    first, second = tables.state[k + 1], tables.state[k + 2]
    # (g - A) dz = r_z + B (what the contact sees): A is two by two.
    a, b = g - slopes[at.R_LENGTH + 4, k + 1], -slopes[at.R_LENGTH + 5, k + 1]
    c, d = -slopes[at.R_LENGTH + 4, k + 2], g - slopes[at.R_LENGTH + 5, k + 2]
    inverse = 1.0 / (a * d - b * c)
    for i in range(2):
        by_first, by_second = (inverse * d, -inverse * b) if i == 0 else (-inverse * c, inverse * a)
        own = linear.state_gain[first if i == 0 else second]
        for column in range(wide):
            own[column] = 0.0
        weights = (
            by_first * slopes[at.R_LENGTH, k + 1] + by_second * slopes[at.R_LENGTH, k + 2],
            by_first * slopes[at.R_LENGTH + 1, k + 1] + by_second * slopes[at.R_LENGTH + 1, k + 2],
            by_first * slopes[at.R_LENGTH + 2, k + 1] + by_second * slopes[at.R_LENGTH + 2, k + 2],
            by_first * slopes[at.R_LENGTH + 3, k + 1] + by_second * slopes[at.R_LENGTH + 3, k + 2],
        )
        _add_inputs(tables, k, weights, linear, own)
        own[2 * width + first] += by_first
        own[2 * width + second] += by_second
    for m in range(3):
        row = linear.gain[k + m]
        of_first, of_second = slopes[4, k + m], slopes[5, k + m]
        for column in range(wide):
            row[column] = of_first * linear.state_gain[first, column] + of_second * linear.state_gain[second, column]
        weights = slopes[0, k + m], slopes[1, k + m], slopes[2, k + m], slopes[3, k + m]
        _add_inputs(tables, k, weights, linear, row)
        for e in range(tables.arm_start[k + m], tables.arm_start[k + m + 1]):
            arm, target = linear.arm[e], linear.force[tables.arm_at[e]]
            if arm != 0.0:
                for column in range(wide):
                    target[column] += arm * row[column]


@compiled
def all_contact_gains(tables: Any, g: float, work: Any, linear: Any) -> None:
    """Fill the gains of all contacts, which depend on no other rows, and add them to A^T d phi."""
    for k in range(tables.touch.size):
        if tables.touch[k] == 1:
            _contact_gains(tables, g, k, work, linear)


@compiled
def add_pushes(tables: Any, work: Any, k: int, gain: Any, load: Any) -> None:
    """Add to the change of a pin's load that of the forces of contacts; ``gain`` is theirs."""
    paths, own = tables.paths, work.paths
    for e in range(paths.columns.size):
        passing = passes(paths, e, tables.pins[k])
        if passing == 0.0 or own.active[e] == 0:
            continue
        size = max(work.rows[at.LOAD, k], 1e-100)
        for m in range(3):
            share = 0.0
            for r in range(3):
                share += passing * work.pull[k, r] * own.wrench[e, m, 3 + r] / size
            for c in range(load.size):
                load[c] += share * gain[paths.row[e] + m, c]
