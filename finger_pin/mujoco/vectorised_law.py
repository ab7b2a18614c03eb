"""Law (9) of several frictions, vectorised by the compiler.

Lane i of field f is number ``WIDTH * f + i`` of a block. Fields up to `DRAG` are those of the table of frictions.
"""

from __future__ import annotations

import math

from finger_pin.core.jit import Pointer, njit_inline
from finger_pin.exchange.mujoco_friction import (
    COULOMB,
    DRAG,
    EXPONENT,
    FLOOR,
    KIND,
    MICRO,
    PIN,
    RATIO,
    STATIC,
    STIFFNESS,
    STRIBECK,
    VISCOUS,
)
from finger_pin.laws.bristle import friction_coefficient, friction_level
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mujoco.vector_functions import angle, compiled_law, exponential

#: How many frictions a block has, and how many numbers it is.
WIDTH = 8
#: What stands beside a friction's parameters: speed, F^s, tension or other load, what presses, the most that it takes,
#: turn, that of a path as a complex number besides, and the number of its row; then what the law gives: level, and what
#: it adds to the three numbers of its row.
SPEED, BRISTLE, BEARS, PRESSES, MOST, BENDS, REAL, IMAGINARY, ROW = range(DRAG + 1, DRAG + 10)
LEVELS, PULLS, DAMPS, LIMITS, FIELDS = range(DRAG + 10, DRAG + 15)
SIZE = WIDTH * FIELDS

_coefficient, _capstan, _least = (
    compiled_law(each) for each in (friction_coefficient, capstan_coefficient, friction_level)
)


@njit_inline
def bent(x: Pointer, count: int) -> None:
    """Add the angles of complex numbers to the turns of as many lanes as are said: none, or `WIDTH`."""
    for i in range(count):
        x[WIDTH * BENDS + i] += angle(x[WIDTH * REAL + i], x[WIDTH * IMAGINARY + i])


@njit_inline
def exerted(x: Pointer, dt: float) -> None:
    """Find the level of each lane by (9b), (16), and its part of a row: F - x, c + b, and the most that it exerts."""
    for i in range(WIDTH):
        of_pin = x[WIDTH * KIND + i] == PIN
        surface, speed, force = x[WIDTH * COULOMB + i], x[WIDTH * SPEED + i], x[WIDTH * BRISTLE + i]
        kinetic = surface if of_pin else _capstan(surface, x[WIDTH * BENDS + i])
        static = x[WIDTH * STATIC + i] * (1.0 if of_pin else kinetic)
        coefficient = _coefficient(speed, kinetic, static, x[WIDTH * STRIBECK + i], x[WIDTH * EXPONENT + i])
        floor, drag = x[WIDTH * FLOOR + i], x[WIDTH * DRAG + i]
        # That of a pin lets go at M^c / M^d of it.
        drag *= coefficient / kinetic if of_pin and kinetic > 0.0 else 1.0
        level = _least(x[WIDTH * PRESSES + i], coefficient, floor, drag)
        stiffness, viscous, micro = x[WIDTH * STIFFNESS + i], x[WIDTH * VISCOUS + i], x[WIDTH * MICRO + i]
        moved = stiffness * dt * speed
        later, decay = slid(force, moved, level)
        # The micro-damping's sigma_1 z', as z goes at this speed; it may help the motion.
        micro *= (later - force) / moved if moved != 0.0 else 1.0
        excess = (force + moved - later) * decay
        limit = max(level, abs(later)) + (viscous + micro) * abs(speed)
        pull, damp = force - excess + min(micro, 0.0) * speed, viscous + max(micro, 0.0)
        if x[WIDTH * BEARS + i] == 0.0 and force == 0.0:
            pull, damp, limit = 0.0, viscous + x[WIDTH * MICRO + i], level + viscous * abs(speed)
        ratio = x[WIDTH * RATIO + i]
        x[WIDTH * LEVELS + i] = level
        x[WIDTH * PULLS + i] = ratio * pull
        x[WIDTH * DAMPS + i] = ratio * ratio * (stiffness * dt + damp)
        x[WIDTH * LIMITS + i] = abs(ratio) * min(limit, x[WIDTH * MOST + i])


@njit_inline
def slid(force: float, moved: float, level: float) -> tuple[float, float]:
    """Return F^s by (9a) after a way s0 v dt at this speed and level, exactly, and the share of it that is left."""
    steady, decay = math.copysign(level, moved), exponential(-abs(moved) / level)
    return steady + (force - steady) * decay, decay


@njit_inline
def moved_on(x: Pointer, count: int) -> None:
    """Move bristles on by (9a): F^s, then levels, then ways s0 v dt, as many as are said, a multiple of `WIDTH`."""
    for i in range(count):
        x[i] = slid(x[i], x[2 * count + i], x[count + i])[0]
