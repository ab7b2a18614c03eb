"""All signals of many states at once, compiled: the evaluation that the integrator steps with, kept row by row."""

from __future__ import annotations

from typing import Any

from finger_pin.core import dynamics as at
from finger_pin.core.compilation import entry
from finger_pin.core.dynamics import evaluate
from finger_pin.core.rigid_body import MOTION, move

JOINT_ROWS = at.J_LOSS + 1
TENDON_ROWS = at.CURVATURE + 1


@entry
def evaluate_many(
    plant: Any,
    control: Any,
    commands: Any,
    forces: Any,
    states: Any,
    work: Any,
    rates: Any,
    strands: Any,
    tendons: Any,
    joints: Any,
) -> None:
    """Evaluate states under given tensions; ``control`` must hold tensions.

    Args:
        plant: The finger.
        control: A control that holds its tensions.
        commands: f^a, shape (m, a).
        forces: F, shape (m, 3).
        states: Shape (m, size).
        work: Scratch.
        rates: Filled with state rates, shape (m, size).
        strands: Filled with strand forces, shape (m, s).
        tendons: Filled with the rows of work.tendon, shape (rows, m, t).
        joints: Filled with the rows of work.joint, shape (rows, m, n).
    """
    for m in range(states.shape[0]):
        for i in range(commands.shape[1]):
            control.tension[i] = commands[m, i]
        for r in range(3):
            plant.fingertip_force[r] = forces[m, r]
        evaluate(plant, control, 0.0, states[m], work, rates[m])
        for s in range(strands.shape[1]):
            strands[m, s] = work.strand[0, s]
        for row in range(tendons.shape[0]):
            for i in range(tendons.shape[2]):
                tendons[row, m, i] = work.tendon[row, i]
        for row in range(joints.shape[0]):
            for j in range(joints.shape[2]):
                joints[row, m, j] = work.joint[row, j]


@entry
def motion_many(
    plant: Any, positions: Any, velocities: Any, work: Any, tips: Any, kinetic: Any, potential: Any
) -> None:
    """Fill fingertip positions (m, 3) and kinetic and potential energies (m,) at positions and velocities (m, n)."""
    for m in range(positions.shape[0]):
        move(plant, positions[m], velocities[m], work)
        for r in range(3):
            value = plant.tip_offset[r]
            if plant.tip_body >= 0:
                value = work.origin[plant.tip_body, r]
                for c in range(3):
                    value += work.rotation[plant.tip_body, r, c] * plant.tip_offset[c]
            tips[m, r] = value
        moving, lifted = 0.0, 0.0
        for i in range(plant.parents.size):
            inertia, v = work.inertia[i], work.spatial[MOTION, i]
            # v . I v, with I = (mass, first moment, second moment about O).
            moving += inertia[0] * (v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
            moving += inertia[4] * v[0] * v[0] + inertia[7] * v[1] * v[1] + inertia[9] * v[2] * v[2]
            moving += 2.0 * (inertia[5] * v[0] * v[1] + inertia[6] * v[0] * v[2] + inertia[8] * v[1] * v[2])
            moving += 2.0 * v[3] * (v[1] * inertia[3] - v[2] * inertia[2])
            moving += 2.0 * v[4] * (v[2] * inertia[1] - v[0] * inertia[3])
            moving += 2.0 * v[5] * (v[0] * inertia[2] - v[1] * inertia[1])
            for r in range(3):
                lifted -= plant.gravity[r] * inertia[1 + r]
        kinetic[m] = 0.5 * moving
        potential[m] = lifted
