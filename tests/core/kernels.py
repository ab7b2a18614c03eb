"""Doors into the compiled core, whose inner functions have no Python face of their own."""

from finger_pin.core.binding import bound_at, call_at
from finger_pin.core.compilation import entry
from finger_pin.core.condensation import solve
from finger_pin.core.model import MODEL
from finger_pin.core.rigid_body import factorise_mass, inverse_dynamics, mass_matrix, move, solve_mass
from finger_pin.core.rigid_body_derivatives import inverse_dynamics_derivatives
from finger_pin.core.rosenbrock import _worst


@entry
def rigid(tables, q, v, a, torque, work, bias, needed, acceleration):
    """Fill C v + G, the torque that a needs and its derivatives, and the acceleration that a torque gives."""
    move(tables, q, v, work)
    mass_matrix(tables, work)
    factorise_mass(tables, q.size, work)
    inverse_dynamics(tables, v, a, work, bias, False)
    for j in range(q.size):
        acceleration[j] = torque[j] - bias[j]
    solve_mass(q.size, work, acceleration)
    inverse_dynamics(tables, v, a, work, needed, True)
    inverse_dynamics_derivatives(tables, v, work)


@entry
def worst(x, difference, rtol, atol):
    """Return the index of the state that a failure is blamed on."""
    return _worst(x, difference, rtol, atol)


@entry
def condensed(address, time, x, g, rate, r, columns):
    """Fill the state rate, and the solutions of (g - J) u = r for unit vectors r; return false if there are none."""
    model = bound_at(address, MODEL)
    for c in range(x.size):
        model.state[c] = x[c]
    call_at(model.evaluate, address, time)
    for c in range(x.size):
        rate[c] = model.rate[c]
    call_at(model.linearise, address, time)
    solved = call_at(model.condense, address, g) == 1
    for c in range(r.size):
        r[c] = 1.0
        solve(model.linear, r, columns[c])
        r[c] = 0.0
    return solved
