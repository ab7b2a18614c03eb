"""Ideal sources of tension and ideal winches that are rows of their own."""

from __future__ import annotations

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.description.tree_couplings import coupled
from finger_pin.laws.actuator import ACTUATOR
from finger_pin.mechanism.groups import SOURCES, SOURCES_WITH_END, WINCHES
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.sheaths import WINCH_ENERGY


def source_rows(description: FingerDescription, routing: Routing, width: int) -> list[Rows]:
    """Return the tables of ideal winches, and of ideal sources with an end or coupled, none without any."""
    plain, winches, cords = {}, {}, description.drive_cords
    for k, (name, tendon) in enumerate(description.tendons.items()):
        most, end = tendon.maximum_tension, tendon.maximum_tension or np.inf
        if tendon.winch is not None:
            # T = max(0, K (w - l) - D l'), as a position actuator of MuJoCo that only pulls.
            stiffness, damping, *_ = cords[name]
            winches[k] = [stiffness, 0.0, -stiffness, -damping, -np.inf, np.inf, 0.0, end]
        elif most is not None or (name not in cords and coupled(description.couplings, name)):
            plain[k] = [1.0, 0.0, 0.0, 0.0, 0.0, end, 0.0, end]
    tables = []
    for group, numbers, supplied in ((SOURCES_WITH_END, plain, SOURCES), (WINCHES, winches, WINCH_ENERGY)):
        if not numbers:
            continue
        places, arm = np.array(list(numbers), dtype=np.int64), np.zeros((len(numbers), width))
        arm[:, : len(routing.joints)] = routing.coupling[places]
        law, pulls = np.array(list(numbers.values())).T, tuple(routing.tendons[k] for k in places)
        tables.append(Rows(group, ACTUATOR, pulls, law, arm, channels=places, powers=(supplied,), pulls=pulls))
    return tables
