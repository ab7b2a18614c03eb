"""Imported by the server that processes are copied from: they then have all code loaded from the start."""

from __future__ import annotations

import contextlib
import os
from multiprocessing import spawn

from finger_pin.description.loading import load_scenario
from finger_pin.simulation.simulate import simulate
from finger_pin.studies import runs as runs
from finger_pin.studies.fingerprint import source_digest
from finger_pin.studies.machine import WARM

# Processes would begin by importing the script that asks, and so run it again where it has no guard. They need nothing
# of it: what it has defined itself is sent to them by value.
spawn._fixup_main_from_path = spawn._fixup_main_from_name = lambda name: None  # type: ignore[attr-defined]

# Of the code that is loaded here and now.
source_digest()
if os.environ.get(WARM) == "1":
    # If anything is wrong, the processes report it.
    with contextlib.suppress(Exception):
        simulate(load_scenario("fig6", {"simulation.duration": 1e-3}))
