"""A base that moves, compiled: its motion, the power that it supplies, and its part in the linearisation."""

from __future__ import annotations

from finger_pin.core.addresses.spatial import add_force_cross, apply_inertia, dot, motion_cross, sine_cosine
from finger_pin.core.addresses.time_functions import SignalTable, signal_derivative
from finger_pin.core.evaluation.rigid_body_dynamics import inverse_dynamics
from finger_pin.core.jit import CompiledFunction, inlined, njit_inline, scratch, types, unpack, view
from finger_pin.core.tables.model import MODEL
from finger_pin.laws import input_functions as palm_laws

_base_motion, _numbers_at = inlined(palm_laws.base_motion), view(types.float64)


@njit_inline
def _coordinates(signal: SignalTable, time: float, order: int) -> tuple[float, float, float, float, float, float]:
    # Called with a literal index each, the function would be compiled once for every one.
    values = _numbers_at(scratch(6))
    for j in range(6):
        values[j] = signal_derivative(signal, j, time, order)
    return values[0], values[1], values[2], values[3], values[4], values[5]


@CompiledFunction
def move_base(address: int, time: float) -> int:
    """Fill velocity and acceleration of a moving base, and their rates."""
    model = unpack(address, MODEL)
    control, parameters, work = model.control, model.parameters, model.work
    if control.palm.harmonics.shape[0] == 0:
        return 1
    place = _coordinates(control.palm, time, 0)
    turns = sine_cosine(place[3]) + sine_cosine(place[4]) + sine_cosine(place[5])
    motion = _base_motion(
        _coordinates(control.palm, time, 1),
        _coordinates(control.palm, time, 2),
        _coordinates(control.palm, time, 3),
        turns,
        (parameters.gravity[0], parameters.gravity[1], parameters.gravity[2]),
    )
    for k in range(6):
        work.base_velocity[k] = motion[k]
        work.base_acceleration[k] = motion[6 + k]
        work.base_rate[0, k] = motion[15 + k]
        work.base_rate[1, k] = motion[21 + k]
    # The world that the base sees goes back as the base goes on: first its angles, then its place.
    for i in range(work.guide.size):
        work.guide[i] = -signal_derivative(control.palm, (i + 3) % 6, time, 2)
        work.guide_rate[i] = -signal_derivative(control.palm, (i + 3) % 6, time, 3)
    return 1


@CompiledFunction
def base_power(address: int, _time: float) -> int:
    """Fill the power that a moving base supplies, W, after an evaluation: its velocity times its wrench."""
    model = unpack(address, MODEL)
    structure, parameters, work, width = model.structure, model.parameters, model.work, model.work.torque.size
    velocity = model.state[width : 2 * width]
    inverse_dynamics(structure, parameters, velocity, work.acceleration, work, work.bias, True)
    power = 0.0
    for i in range(structure.parents.size):
        if structure.parents[i] < 0:
            power += dot(work.base_velocity, work.spatial.force[i])
    work.base_power[0] = power
    return 1


@CompiledFunction
def bias_rate(address: int, _time: float) -> int:
    """Fill the time derivative of inverse dynamics at a given motion on a moving base, shape (n,).

    All velocities change alike, by dV; accelerations by that of the base and by dV x S v of every joint before. What
    an evaluation has left in two layers is overwritten.
    """
    model = unpack(address, MODEL)
    structure, work, width, out = model.structure, model.work, model.work.torque.size, model.linear.bias_rate
    velocity, size, change = model.state[width : 2 * width], structure.parents.size, work.base_rate[0]
    for i in range(size):
        parent = structure.parents[i]
        rate, force = work.spatial.axis_curve[i], work.spatial.force[i]
        above = work.base_rate[1] if parent < 0 else work.spatial.axis_curve[parent]
        motion_cross(change, work.spatial.axis[i], work.vectors[0])
        for k in range(6):
            rate[k] = above[k] + work.vectors[0][k] * velocity[i]
        apply_inertia(work.inertia[i], rate, force)
        apply_inertia(work.inertia[i], work.spatial.motion[i], work.vectors[0])
        add_force_cross(change, work.vectors[0], force)
        apply_inertia(work.inertia[i], change, work.vectors[0])
        add_force_cross(work.spatial.motion[i], work.vectors[0], force)
    for i in range(size - 1, -1, -1):
        out[i] = dot(work.spatial.axis[i], work.spatial.force[i])
        if structure.parents[i] >= 0:
            for k in range(6):
                work.spatial.force[structure.parents[i], k] += work.spatial.force[i, k]
    return 1
