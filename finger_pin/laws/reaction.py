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


def joint_reaction_slopes(load: Any, along: Any, reaction: Any) -> tuple[Any, Any]:
    """Return the derivatives of R with respect to S and to e . F, for a given F.

    |F| is kept, so what e . F gains its component across loses. At R = 0 it has a kink,
    which the floor of the friction level hides.
    """
    safe = np.maximum(reaction, 1e-100)
    return (load - along) / safe, -load / safe
