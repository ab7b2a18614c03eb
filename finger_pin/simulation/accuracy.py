"""What a user should know of a run before trusting it: its own error, what rings in it, whether it fits in memory."""

from __future__ import annotations

import os
from collections.abc import Callable
from itertools import count

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.textbook import Stop, Trajectory
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.laws.contact import CONTACT
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.recorded import Recording

#: Steps between two looks at a compiled simulation.
CHUNK = 256

# A run at tolerance tol is expected to be within so many times tol, rad, and never worse than the second number.
_EXPECTED, _MOST_EXPECTED = 1e3, 1e-2
# The estimate that is carried along is seldom below a third of the error and often far above it: it is checked from so
# many times the expected error on.
_DOUBTED = 3.0
_TIGHTER = 10.0
# Where joint friction is above two thirds of what locks the finger, small forces make large tensions: how far it slips
# is then beyond a linearised flow.
_CLOSE_TO_LOCKING = 1.5
# The repetition stops after so many times the run's looks at it, or so many at most: at a tighter tolerance it may be
# far slower, and a motion that takes so many steps shows early how sensitive it is.
_PATIENCE, _MOST_LOOKS = 2, 600
# The share of the energy exchanged to which an account has to close, and what is too little to count, J.
_OPEN, _NOTHING = 1e-4, 1e-12
# More steps than this, of less than this mean length, s, are slow; a mode rings if it decays by less than a tenth a
# radian, and steps follow it if they are shorter than so many radians.
_MANY, _SHORT, _DECAY, _FOLLOWED = 50_000, 5e-6, 0.1, 6.0
# A contact is too stiff where a newton presses it in by so small a part of what positions are computed to.
_SEEN = 1e-4


def expected_error(scenario: Scenario) -> float:
    """Return the error of the joints' angles that the tolerances let a user expect, rad rms."""
    settings = scenario.simulation
    return min(_EXPECTED * max(settings.rtol, settings.atol_scale), _MOST_EXPECTED)


def estimate_error(
    scenario: Scenario, trajectory: Trajectory, repeated: Callable[[Scenario, Stop], Trajectory], *, margin: float
) -> tuple[float, str]:
    """Return a run's error, rad rms over joints and time, and what to say if it is worse than expected; else empty.

    Where the estimate that the integration carried along is large, or the finger is close to self-locking, where the
    linearised flow does not show how far slips go, the run is repeated at a tighter tolerance, and the difference
    counts.

    Args:
        scenario: What was simulated.
        trajectory: Its solution.
        repeated: Integrates the scenario with other tolerances until it is asked to stop.
        margin: Of the joints' friction to what locks the finger; infinite where not known.
    """
    expected, error = expected_error(scenario), trajectory.estimated_error
    doubted = error > _DOUBTED * expected or (margin < _CLOSE_TO_LOCKING and np.isfinite(error))
    if not doubted or trajectory.failure or trajectory.interrupted:
        return error, ""
    settings = scenario.simulation
    tighter = {name: max(getattr(settings, name) / _TIGHTER, 1e-12) for name in ("rtol", "atol_scale")}
    looks = count()
    most = min(_PATIENCE * (1 + trajectory.statistics.steps // CHUNK), _MOST_LOOKS)
    tightened = scenario.model_copy(update={"simulation": settings.model_copy(update=tighter)})
    other = repeated(tightened, lambda: next(looks) >= most)
    times = scenario.sample_times()
    times, joints = times[times <= other.breakpoints[-1]], len(scenario.finger.joints)
    difference = (trajectory.interpolate(times) - other.interpolate(times))[:, :joints]
    error = float(np.sqrt(np.mean(difference**2)))
    if error <= expected:
        return error, ""
    return error, (
        f"the run errs by about {error:.1g} rad rms: repeated at rtol {tighter['rtol']:g} it differs by that. "
        "The motion is sensitive, as close to self-locking or in a loop that hunts; "
        "try a smaller simulation.rtol and atol_scale"
    )


def open_account(result: Recording) -> str:
    """Return what to say if a result's energy account does not close to a ten thousandth of all energy exchanged."""
    exchanged = sum(
        float(np.abs(values).max())
        for name, (_, values, _) in result.variables.items()
        if name.startswith("energy_exchanged_")
    )
    residual = float(np.abs(result.variables["energy_residual"][1]).max())
    if not residual > max(_OPEN * exchanged, _NOTHING):
        return ""
    share = residual / exchanged if exchanged else np.inf
    return (
        f"the energy account closes only to {share:.1g} of the energy exchanged: an impact or a kink was passed too "
        "coarsely; try a smaller simulation.rtol and atol_scale"
    )


def ringing(loop: ClosedLoop, trajectory: Trajectory) -> str:
    """Return what rings undamped where a run took many short steps, and at which frequency; else empty.

    The modes are those of the Jacobian of the whole at the last state.
    """
    reached, steps = float(trajectory.breakpoints[-1]), trajectory.statistics.steps
    if steps < _MANY or reached > _SHORT * steps:
        return ""
    x, scales = trajectory.interpolate(np.array([reached]))[0], loop.finger.layout.scales()
    values, modes = np.linalg.eig(_jacobian(loop, reached, x, scales))
    followed = values.imag * reached / steps < _FOLLOWED
    rings = (values.imag > 0.0) & (np.abs(values.real) < _DECAY * values.imag) & followed
    if not rings.any():
        return ""
    fastest = int(np.argmax(np.where(rings, values.imag, 0.0)))
    name = loop.finger.layout.names[int(np.argmax(np.abs(modes[:, fastest])))]
    return (
        f"{name} rings almost undamped at {values[fastest].imag / (2.0 * np.pi):.3g} Hz, and steps of "
        f"{reached / steps:.1g} s on average follow it; more viscous friction, a softer spring or more mass there helps"
    )


def too_stiff(result: Recording, finger: Finger, tolerance: float) -> str:
    """Return what to say if bodies have touched whose contact is too stiff for the tolerance; else empty.

    Args:
        result: What happened.
        finger: The finger.
        tolerance: Of the joints' angles, rad: a tenth of that, m, at what they carry.
    """
    if finger.surroundings is None:
        return ""
    contacts, known = finger.surroundings.contacts, 0.1 * tolerance
    stiffness, exponent = (contacts.parameters[CONTACT.parameters.index(name)] for name in ("stiffness", "exponent"))
    depth = stiffness ** (-1.0 / exponent)
    touched = np.any(result.variables["contact_normal_force"][1] > 0.0, axis=0)
    for index in np.flatnonzero(touched & (depth < _SEEN * known)):
        return (
            f"{contacts.names[index]} is too stiff for the tolerances: 1 N presses it in by {depth[index]:.1g} m, and "
            f"places are computed to about {known:.1g} m; softer surfaces or a smaller simulation.atol_scale help"
        )
    return ""


def _jacobian(loop: ClosedLoop, time: float, x: Array, scales: Array) -> Array:
    """Return df/dx by differences, in units of the scales, shape (size, size)."""
    steps = 1e-7 * np.maximum(np.abs(x), 1e-2 * scales)
    columns = [
        (loop.rhs(time, x + step) - loop.rhs(time, x - step)) / (2.0 * step[i]) for i, step in enumerate(np.diag(steps))
    ]
    return np.array(columns).T / scales[:, None] * scales


def check_memory(scenario: Scenario) -> None:
    """Refuse a result that cannot fit into the machine's memory.

    Raises:
        InputError: Naming the sample rate.
    """
    settings, finger = scenario.simulation, scenario.finger
    samples = settings.duration * settings.sample_rate
    # Every signal of a result, and what it is computed from: measured, 2 kB a sample for 4 joints and 5 tendons.
    needed = samples * 8.0 * (30 * len(finger.joints) + 15 * len(finger.tendons) + 60)
    present = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else np.inf
    if needed > present:
        allowed = (
            f"{samples:.3g} samples need about {needed / 2**30:.3g} GiB of memory, of which there are "
            f"{present / 2**30:.3g}; must be at most {settings.sample_rate * present / needed:.3g}"
        )
        raise InputError("simulation.sample_rate", allowed, settings.sample_rate)
