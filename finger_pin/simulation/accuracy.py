"""Warnings about a run: an account that is open, masses that ring in it, and contacts too stiff for it."""

from __future__ import annotations

import numpy as np
import xarray as xr

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import LEAST_ATOL_SCALE, LEAST_RTOL
from finger_pin.laws.contact_law import CONTACT
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.simulation.energy import account_entries
from finger_pin.typing import Array

#: Steps between two looks at a compiled simulation.
CHUNK_STEPS = 128

# The share of the energy exchanged to which an account has to close, and what of the energy stored is rounding.
_OPEN_SHARE, _ROUNDING_SHARE = 1e-4, 1e-13
#: The tolerances, and how tight they can be.
LEAST_TOLERANCES = {"rtol": LEAST_RTOL, "atol_scale": LEAST_ATOL_SCALE}
# More steps than this, of less than this mean length, s, are slow; a mode rings if it decays by less than a tenth a
# radian, and steps follow it if they are shorter than so many radians.
_SLOW_STEPS, _SHORT_STEP, _LEAST_DECAY, _RADIANS_PER_STEP = 50_000, 5e-6, 0.1, 6.0
# Samples, a mean step apart, in which a swing is looked for; fewer cycles in them do not make steps short; and the part
# by which its frequency differs from that of a mode that rings.
_SWING_SAMPLES, _LEAST_CYCLES, _SAME_FREQUENCY = 8192, 20, 0.2
# A contact is too stiff where a newton presses it in by so small a part of what positions are computed to.
_LEAST_DEPTH_SHARE = 1e-4


def with_tighter_tolerances(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with tolerances divided by a factor, within their bounds."""
    settings = scenario.simulation
    tighter = {name: max(getattr(settings, name) / factor, least) for name, least in LEAST_TOLERANCES.items()}
    return scenario.updated(simulation=tighter)


def residual_share(result: xr.Dataset) -> float:
    """Return the largest share of all energy exchanged that the account leaves open; 0 for rounding.

    Where bodies exchange next to none, as one that falls freely, it is the share of the largest energy stored.
    """
    stored, exchanged = _peaks(result, STORED), sum(_peaks(result, SUPPLIED, LOST))
    residual, largest = float(np.abs(result.variables["energy_residual"].values).max()), max(*stored, exchanged)
    if not residual > _ROUNDING_SHARE * largest:
        return 0.0
    return residual / (exchanged if _exchanges_energy(result) else largest)


def _peaks(result: xr.Dataset, *kinds: str) -> list[float]:
    return [float(np.abs(each.values).max()) for each in account_entries(result, *kinds).values()]


def _exchanges_energy(result: xr.Dataset) -> bool:
    """Return whether the energy exchanged is more than the open part that is allowed of the energy stored."""
    return sum(_peaks(result, SUPPLIED, LOST)) > _OPEN_SHARE * max(_peaks(result, STORED))


def account_warning(result: xr.Dataset, share: float) -> str:
    """Return the warning if an energy account leaves more than a ten thousandth open; a share from `residual_share`."""
    if not share > _OPEN_SHARE:
        return ""
    reference = "exchanged" if _exchanges_energy(result) else "stored, as next to none is exchanged"
    return (
        f"the energy account closes only to {share:.1g} of the energy {reference}: an impact, a kink or a quick turn "
        "was passed too coarsely; try a smaller simulation.rtol and atol_scale"
    )


def ringing_warning(loop: ClosedLoop, trajectory: Trajectory, slow_steps: int | None = None) -> str:
    """Return the warning about what rings or swings and makes steps short, with its frequency, or empty.

    Undamped modes are those of the Jacobian of the whole at the last state. A swing of another frequency is a limit
    cycle of control and friction.

    Args:
        loop: The loop.
        trajectory: Its run.
        slow_steps: Number of steps from which on a run is slow, whatever their length; that of one run without it.
    """
    end, steps = float(trajectory.breakpoints[-1]), trajectory.statistics.steps
    if steps < (slow_steps or _SLOW_STEPS) or (slow_steps is None and end > _SHORT_STEP * steps):
        return ""
    x, layout, step = trajectory.interpolate(np.array([end]))[0], loop.finger.layout, end / steps
    values, modes = np.linalg.eig(_jacobian(loop, end, x, layout.scales()))
    resolved = values.imag * step < _RADIANS_PER_STEP
    undamped = (values.imag > 0.0) & (np.abs(values.real) < _LEAST_DECAY * values.imag) & resolved
    fastest = int(np.argmax(np.where(undamped, values.imag, 0.0)))
    ringing = values[fastest].imag / (2.0 * np.pi) if undamped.any() else 0.0
    name, swinging = _steady_swing(loop, trajectory, step)
    if name and abs(swinging - ringing) > _SAME_FREQUENCY * ringing:
        return (
            f"{name} swings at {swinging:.3g} Hz and does not come to rest, and steps of {step:.1g} s on average "
            "follow it; less gain, more damping or more viscous friction there helps"
        )
    if not ringing:
        return ""
    name = layout.names[int(np.argmax(np.abs(modes[:, fastest])))]
    return (
        f"{name} rings almost undamped at {ringing:.3g} Hz, and steps of {step:.1g} s on average follow it; more "
        "viscous friction, a softer spring or more mass there helps"
    )


def _steady_swing(loop: ClosedLoop, trajectory: Trajectory, step: float) -> tuple[str, float]:
    """Return name and frequency, Hz, of the velocity that swings most in the last steps; no name if none does."""
    # Its import takes a while, and few runs are slow.
    from scipy.signal import detrend

    layout, end = loop.finger.layout, float(trajectory.breakpoints[-1])
    speeds = [k for k, name in enumerate(layout.names) if "velocity[" in name]
    times = np.linspace(end - step * _SWING_SAMPLES, end, _SWING_SAMPLES, endpoint=False)
    motion = trajectory.interpolate(times)[:, speeds] / layout.scales()[speeds]
    spectra = np.abs(np.fft.rfft(detrend(motion, axis=0), axis=0)) ** 2
    largest = int(np.argmax(spectra.sum(axis=0)))
    spectrum = spectra[:, largest]
    cycles = int(np.argmax(spectrum))
    if cycles < _LEAST_CYCLES or spectrum[cycles - 2 : cycles + 3].sum() < 0.5 * spectrum.sum():
        return "", 0.0
    return layout.names[speeds[largest]], cycles / (step * _SWING_SAMPLES)


def stiffness_warning(result: xr.Dataset, finger: Finger, tolerance: float) -> str:
    """Return the warning if bodies have touched whose contact is too stiff for the tolerance; else empty.

    Args:
        result: Dataset of the run.
        finger: The finger.
        tolerance: Of the joints' angles, rad: a tenth of that, m, at what they carry.
    """
    if finger.scene is None:
        return ""
    contacts, accuracy = finger.scene.contacts, 0.1 * tolerance
    stiffness, exponent = (contacts.parameters[CONTACT.parameters.index(name)] for name in ("stiffness", "exponent"))
    depth = stiffness ** (-1.0 / exponent)
    # Bounces may all fall between samples: gaps below the accuracy count as touched.
    touched = np.any(result.variables["contact_gap"].values < accuracy, axis=0)
    for index in np.flatnonzero(touched & (depth < _LEAST_DEPTH_SHARE * accuracy)):
        return (
            f"{contacts.names[index]} is too stiff for the tolerances: 1 N presses it in by {depth[index]:.1g} m, and "
            f"places are computed to about {accuracy:.1g} m; softer surfaces or a smaller simulation.atol_scale help"
        )
    return ""


def _jacobian(loop: ClosedLoop, time: float, x: Array, scales: Array) -> Array:
    """Return df/dx by differences, in units of the scales, shape (size, size)."""
    steps = 1e-7 * np.maximum(np.abs(x), 1e-2 * scales)
    columns = [
        (loop.rhs(time, x + step) - loop.rhs(time, x - step)) / (2.0 * step[i]) for i, step in enumerate(np.diag(steps))
    ]
    return np.array(columns).T / scales[:, None] * scales
