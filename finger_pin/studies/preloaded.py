"""Imported by the server that processes are copied from: they then have all code loaded from the start."""

from __future__ import annotations

import contextlib

from finger_pin.core.compilation import is_cached
from finger_pin.description.loading import load_scenario
from finger_pin.simulation.simulate import simulate

if is_cached():
    # Should anything be wrong, the processes say so themselves.
    with contextlib.suppress(Exception):
        simulate(load_scenario("fig6", {"simulation.duration": 1e-3}))
