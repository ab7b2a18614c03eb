"""The reaction force of a joint (17)."""

from __future__ import annotations

from typing import Any

import numpy as np


def joint_reaction(load: Any, along: Any, across: Any) -> Any:
    """Return R = |-e S + F|, N, equation (17) with an external force.

    Args:
        load: S, sum of the tensions that cross the joint, N; they pull along -e.
        along: e . F, N.
        across: |F - (e . F) e|, N.
    """
    return np.hypot(along - load, across)
