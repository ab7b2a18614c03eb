"""Rows that are held on one side of their law's kink during a step, so that what is integrated is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.compilation import compiled
from finger_pin.core.law_code import SIDE
from finger_pin.core.tables import END, FIRST, KINK


@compiled
def release(tables: Any, rows: Any) -> None:
    """Let all rows follow the motion."""
    for g in range(tables.groups.shape[0]):
        if tables.groups[g, KINK] >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                rows[SIDE, k] = 0.0


@compiled
def hold(tables: Any, rows: Any, kinks: Any) -> None:
    """Hold all rows on the side of their kink where they are."""
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                kinks[k] = rows[column, k]
                rows[SIDE, k] = np.sign(rows[column, k])


@compiled
def strayed(tables: Any, rows: Any, kinks: Any) -> Any:
    """Return the least share of the step after which a held row has left its side; 1 if none has."""
    share = 1.0
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                if rows[SIDE, k] * rows[column, k] < 0.0:
                    share = min(share, kinks[k] / (kinks[k] - rows[column, k]))
    return share


@compiled
def turn(tables: Any, rows: Any, kinks: Any) -> None:
    """Turn the held rows that have left their side."""
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                if kinks[k] * rows[column, k] < 0.0:
                    rows[SIDE, k] = -rows[SIDE, k]
