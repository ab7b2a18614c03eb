"""Warnings about a run: its own error, masses that ring in it, and contacts too stiff for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np
import xarray as xr

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.trajectory import Stop, Trajectory
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import LEAST_ATOL_SCALE, LEAST_RTOL
from finger_pin.laws.contact import CONTACT
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.mechanism.scene import POSE, VELOCITY
from finger_pin.simulation.energy import entries
from finger_pin.typing import Array

#: Steps between two looks at a compiled simulation.
CHUNK = 128

# A run at tolerance tol is expected to be within so many times tol, rad, and never worse than the second number.
_EXPECTED, _MOST_EXPECTED = 1e3, 1e-2
# The estimate that is carried along is seldom below a third of the error and sometimes far above it: it is checked
# from so many times the expected error on.
_DOUBTED = 3.0
_TIGHTER = 10.0
_BEYOND = (
    "small errors grow beyond all bounds, as over many impacts or of a body that tumbles; "
    "try a shorter simulation.duration, or a smaller simulation.rtol and atol_scale"
)
# Where joint friction is above two thirds of what locks the finger, small forces make large tensions: how far it slips
# is then beyond a linearised flow.
_CLOSE_TO_LOCKING = 1.5
# The repetition stops after so many times the run's looks at it and a few more, or so many at most: at a tighter
# tolerance it may be far slower, and a motion that takes so many steps shows early how sensitive it is.
_PATIENCE, _FEW, _MOST_LOOKS = 2, 8, 400
# The share of the energy exchanged to which an account has to close, and what of the energy stored is rounding.
_OPEN, _ROUNDING = 1e-4, 1e-13
# A run is repeated if its account does not close to so many times its tolerance, nor to so small a share: so often at
# most, and not if it took more steps. What is repeated counts if it leaves less open than a share of that.
_CLOSED, _WELL_CLOSED, _HELPS = 10.0, 1e-5, 0.5
_MOST_REPETITIONS, _MOST_STEPS = 3, 200_000
#: The tolerances, and how tight they can be.
TOLERANCES = {"rtol": LEAST_RTOL, "atol_scale": LEAST_ATOL_SCALE}
# More steps than this, of less than this mean length, s, are slow; a mode rings if it decays by less than a tenth a
# radian, and steps follow it if they are shorter than so many radians.
_MANY, _SHORT, _DECAY, _FOLLOWED = 50_000, 5e-6, 0.1, 6.0
# A contact is too stiff where a newton presses it in by so small a part of what positions are computed to.
_SEEN = 1e-4


def expected_error(scenario: Scenario) -> float:
    """Return the error of the joints' angles that the tolerances let a user expect, rad rms."""
    settings = scenario.simulation
    return min(_EXPECTED * max(settings.rtol, settings.atol_scale), _MOST_EXPECTED)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A run whose energy account has been seen to.

    Attributes:
        scenario: With the tolerances that it took.
        trajectory: Its solution.
        result: Its Dataset.
        left: Which share of the energy its account leaves open (`left_open`).
        coarser: Run that it replaces, if it is a repetition.
    """

    scenario: Scenario
    trajectory: Trajectory
    result: xr.Dataset
    left: float
    coarser: Trajectory | None = None


def close_account(
    scenario: Scenario,
    trajectory: Trajectory,
    repeated: Callable[[Scenario, Stop], Trajectory],
    recorded: Callable[[Trajectory], xr.Dataset],
) -> Attempt:
    """Record a run, and repeat it at tighter tolerances as long as its energy account does not close to ten times them.

    Small forces and slow drifts are within the tolerances of the state and yet may be all that a run's energy is. The
    result says at which tolerances it ran.

    Args:
        scenario: The scenario of the run.
        trajectory: Its solution.
        repeated: Integrates the scenario with other tolerances until it is asked to stop.
        recorded: Makes the result of a trajectory.
    """
    result, settings = recorded(trajectory), scenario.simulation
    first = run = Attempt(scenario, trajectory, result, left_open(result))
    limit = max(_CLOSED * max(settings.rtol, settings.atol_scale), _WELL_CLOSED)
    whole = not np.isnan(trajectory.estimated_error) and not trajectory.failure and not trajectory.interrupted
    for _ in range(_MOST_REPETITIONS):
        if not whole or run.trajectory.statistics.steps > _MOST_STEPS or not limit < run.left < np.inf:
            break
        tighter = with_tighter(run.scenario, _TIGHTER)
        other = repeated(tighter, _patient(run.trajectory))
        if other.failure or other.interrupted:
            break
        result = recorded(other)
        result.attrs |= {name: getattr(tighter.simulation, name) for name in TOLERANCES}
        result.attrs["repeated"] = (
            f"repeated at rtol {tighter.simulation.rtol:g}: at {settings.rtol:g} the energy account closes only to "
            f"{first.left:.2g} of {_compared(result)}"
        )
        run = Attempt(tighter, other, result, left_open(result), run.trajectory)
    # Of a power that is booked wrong, say, the tolerances know nothing.
    return run if run.left < max(limit, _HELPS * first.left) else first


def estimate_error(
    scenario: Scenario, run: Attempt, repeated: Callable[[Scenario, Stop], Trajectory], *, margin: float
) -> tuple[float, str]:
    """Return a run's error, rad rms over joints and time, and a warning if it is worse than expected; else empty.

    Of objects it is that of their turns and places, rad and m, where that is larger.

    Where the estimate that the integration carried along is large, or the finger is close to self-locking, where the
    linearised flow does not show how far slips go, the run is repeated at a tighter tolerance, and the difference
    counts; or the difference to the coarser one that it replaces. Where the repetition doubts itself by more than that,
    as of a motion that impacts make chaotic, the error is not a number.

    Args:
        scenario: The scenario asked for.
        run: The run of it.
        repeated: Integrates the scenario with other tolerances until it is asked to stop.
        margin: Of the joints' friction to what locks the finger; infinite where not known.
    """
    trajectory, other = run.trajectory, run.coarser
    expected, error = expected_error(scenario), trajectory.estimated_error
    doubted = error > _DOUBTED * expected or (margin < _CLOSE_TO_LOCKING and not np.isnan(error))
    if not doubted or trajectory.failure or trajectory.interrupted:
        return error, ""
    if error == np.inf:
        return np.nan, f"the error of the run cannot be judged: {_BEYOND}"
    rtol = run.scenario.simulation.rtol
    if other is None:
        tighter = with_tighter(run.scenario, _TIGHTER)
        other, rtol = repeated(tighter, _patient(trajectory, _MOST_LOOKS)), tighter.simulation.rtol
    times = scenario.sample_times()
    times = times[times <= other.breakpoints[-1]]
    if len(times) < 2:
        # It was stopped before it could say anything.
        return error, ""
    error = _difference(scenario, trajectory.interpolate(times), other.interpolate(times))
    if error <= expected:
        return error, ""
    if run.coarser is None and other.estimated_error > error:
        return np.nan, (
            f"the error of the run cannot be judged: repeated at rtol {rtol:g} it differs by {error:.1g} rad rms, "
            f"and that one is no more certain: {_BEYOND}"
        )
    return error, (
        f"the run errs by about {error:.1g} rad rms: repeated at rtol {rtol:g} it differs by that. "
        "The motion is sensitive, as close to self-locking, in a loop that hunts or of a body that tumbles; "
        "try a smaller simulation.rtol and atol_scale"
    )


def _difference(scenario: Scenario, one: Array, other: Array) -> float:
    """Return the distance of packed states, shape (m, size): of joints or objects, whichever is more; rad or m rms."""
    joints = len(scenario.finger.joints)
    found = float(np.sqrt(np.mean((one - other)[:, :joints] ** 2)))
    moving = sum(each.moves for each in (scenario.environment.objects or {}).values())
    if not moving:
        return found
    poses, others = (x[:, joints : joints + POSE * moving].reshape(len(x), moving, POSE) for x in (one, other))
    alike = np.abs(np.sum(poses[..., 3:] * others[..., 3:], axis=-1))
    turns = 2.0 * np.arccos(np.minimum(alike, 1.0))
    squares = np.sum((poses - others)[..., :3] ** 2, axis=-1) + turns**2
    return max(found, float(np.sqrt(np.mean(squares) / VELOCITY)))


def with_tighter(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with tolerances divided by a factor, within their bounds."""
    settings = scenario.simulation
    tighter = {name: max(getattr(settings, name) / factor, least) for name, least in TOLERANCES.items()}
    return scenario.updated(simulation=tighter)


def _patient(trajectory: Trajectory, most: float = np.inf) -> Stop:
    """Return a `Stop` after more looks than a trajectory took, or so many at most."""
    looks, most = count(), min(_PATIENCE * (_FEW + trajectory.statistics.steps // CHUNK), most)
    return lambda: next(looks) >= most


def left_open(result: xr.Dataset) -> float:
    """Return the largest share of all energy exchanged that the account leaves open; 0 for rounding.

    Of bodies that exchange none, such as one that flies freely, it is the share of the most that is stored.
    """
    stored, exchanged = _most(result, STORED), _most(result, SUPPLIED, LOST)
    residual, most = float(np.abs(result.variables["energy_residual"].values).max()), max(*stored, *exchanged)
    if not residual > _ROUNDING * most:
        return 0.0
    return residual / (sum(exchanged) or most)


def _most(result: xr.Dataset, *kinds: str) -> list[float]:
    return [float(np.abs(each.values).max()) for each in entries(result, *kinds).values()]


def _compared(result: xr.Dataset) -> str:
    """Return the name of the energy of which `left_open` is a share."""
    return "the energy exchanged" if any(_most(result, SUPPLIED, LOST)) else "the energy stored, as none is exchanged"


def open_account(result: xr.Dataset, share: float) -> str:
    """Return the warning if an energy account leaves more than a ten thousandth open; a share from `left_open`."""
    if not share > _OPEN:
        return ""
    return (
        f"the energy account closes only to {share:.1g} of {_compared(result)}: an impact, a kink or a quick turn was "
        "passed too coarsely; try a smaller simulation.rtol and atol_scale"
    )


def ringing(loop: ClosedLoop, trajectory: Trajectory) -> str:
    """Return the warning about a mass that rings undamped and makes steps short, with its frequency, or empty.

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


def too_stiff(result: xr.Dataset, finger: Finger, tolerance: float) -> str:
    """Return the warning if bodies have touched whose contact is too stiff for the tolerance; else empty.

    Args:
        result: Dataset of the run.
        finger: The finger.
        tolerance: Of the joints' angles, rad: a tenth of that, m, at what they carry.
    """
    if finger.scene is None:
        return ""
    contacts, known = finger.scene.contacts, 0.1 * tolerance
    stiffness, exponent = (contacts.parameters[CONTACT.parameters.index(name)] for name in ("stiffness", "exponent"))
    depth = stiffness ** (-1.0 / exponent)
    # Bounces may all fall between samples: what is closer than can be told has touched.
    touched = np.any(result.variables["contact_gap"].values < known, axis=0)
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
