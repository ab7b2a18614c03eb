"""Doors into the compiled core, whose inner functions have no Python face of their own."""

from finger_pin.core import dynamics as at
from finger_pin.core.compilation import entry
from finger_pin.core.dynamics import evaluate
from finger_pin.core.elimination import factorise, solve
from finger_pin.core.linearisation import linearise
from finger_pin.core.rigid_body import (
    MASS_MATRIX,
    factorise_mass,
    inverse_dynamics,
    mass_matrix,
    move,
    solve_mass,
)
from finger_pin.core.rigid_body_derivatives import inverse_dynamics_derivatives
from finger_pin.core.rosenbrock import _worst


@entry
def rigid(plant, q, v, a, torque, work, bias, needed, acceleration):
    """Fill C v + G, the torque that a needs and its derivatives, and the acceleration that a torque gives."""
    move(plant, q, v, work)
    mass_matrix(plant, work)
    factorise_mass(q.size, work)
    inverse_dynamics(plant, v, work.joint[at.ZERO], work, bias)
    for j in range(q.size):
        acceleration[j] = torque[j] - bias[j]
    solve_mass(q.size, work, acceleration)
    inverse_dynamics(plant, v, a, work, needed)
    inverse_dynamics_derivatives(plant, v, work)


@entry
def worst(x, difference, rtol, atol):
    """Return the index of the state that a failure is blamed on."""
    return _worst(x, difference, rtol, atol)


@entry
def linear_solution(plant, control, time, x, g, r, work, linear, scaled, rate, u):
    """Fill the state rate and the solution of (g - J) u = r; return false if the system cannot be solved."""
    joints = plant.parents.size
    evaluate(plant, control, time, x, work, rate)
    linearise(plant, control, time, x, work, linear)
    mass = work.square[MASS_MATRIX]
    if not factorise(plant, g, mass, linear):
        return False
    # The core wants the joints' rows multiplied by the mass matrix.
    for c in range(x.size):
        scaled[c] = r[c]
    for a in range(joints):
        scaled[joints + a] = 0.0
        for b in range(joints):
            scaled[joints + a] += mass[a, b] * r[joints + b]
    solve(plant, g, scaled, linear, u)
    return True
