"""Contacts that are asleep: open, at rest, and too far apart to close before they are looked at again.

One that falls asleep keeps its gap; what the bodies move since is taken off that, as far as each coordinate could bring
them together. It wakes up before nothing is left, and within a step in time for that step's end to be seen.
"""

from __future__ import annotations

from typing import Any

from finger_pin.core.compilation import compiled
from finger_pin.core.law_code import RATE

# A gap is known so well, m; and a contact wakes up when so many steps as the last one might close it.
_KNOWN, _AHEAD = 1e-9, 3.0
# Bristles bent by less, m, are straight: a ten thousandth of the diameter of an atom.
_STRAIGHT = 1e-14


@compiled
def _moved(paths: Any, e: int, before: Any, after: Any) -> float:
    """Return how far a motion may have brought the bodies of a contact together, m."""
    far = 0.0
    for s in range(paths.start[e], paths.start[e + 1]):
        j = paths.at[s]
        far += paths.levers[s] * abs(after[j] - before[j])
    return far


@compiled
def _set_asleep(k: int, value: int, asleep: Any) -> None:
    for m in range(k, k + 3):
        asleep[m] = value


@compiled
def wake(tables: Any, own: Any, before: Any, after: Any) -> None:
    """Wake the contacts that may close on the way from one state to another."""
    paths = tables.paths
    for e in range(paths.columns.size):
        k = paths.row[e]
        if own.asleep[k] and not _moved(paths, e, before, after) < own.clear[e]:
            _set_asleep(k, 0, own.asleep)


@compiled
def _straighten(tables: Any, rows: Any, k: int, states: Any) -> bool:
    """Return whether the bristles of an open contact are straight; what is left of their bend then is nothing."""
    for m in range(k + 1, k + 3):
        if not abs(states[tables.state[m]]) < _STRAIGHT:
            return False
    for m in range(k + 1, k + 3):
        states[tables.state[m]] = rows[RATE, m] = 0.0
    return True


@compiled
def settle(tables: Any, rows: Any, own: Any, before: Any, after: Any) -> None:
    """Let contacts fall asleep or wake up after a step from one state to another, at whose end they were evaluated."""
    paths, width = tables.paths, tables.parents.size + tables.lumps.size
    for e in range(paths.columns.size):
        k = paths.row[e]
        if paths.columns[e] == 1:
            continue
        moved = _moved(paths, e, before, after)
        if own.asleep[k]:
            own.clear[e] -= moved
            if not own.clear[e] > _AHEAD * moved:
                _set_asleep(k, 0, own.asleep)
        elif own.active[e] == 0 and _straighten(tables, rows, k, after[2 * width :]):
            if own.out[e, 0] > _KNOWN + _AHEAD * moved:
                own.clear[e] = own.out[e, 0] - _KNOWN
                _set_asleep(k, 1, own.asleep)
