"""Warnings about a run: an account that is open, masses that ring in it, and contacts too stiff for it."""

from __future__ import annotations

import numpy as np
import xarray as xr

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import LEAST_ATOL_SCALE, LEAST_RTOL
from finger_pin.laws.contact_law import CONTACT
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.simulation.energy import entries
from finger_pin.typing import Array

#: Steps between two looks at a compiled simulation.
CHUNK = 128

# The share of the energy exchanged to which an account has to close, and what of the energy stored is rounding.
_OPEN, _ROUNDING = 1e-4, 1e-13
#: The tolerances, and how tight they can be.
TOLERANCES = {"rtol": LEAST_RTOL, "atol_scale": LEAST_ATOL_SCALE}
# More steps than this, of less than this mean length, s, are slow; a mode rings if it decays by less than a tenth a
# radian, and steps follow it if they are shorter than so many radians.
_MANY, _SHORT, _DECAY, _FOLLOWED = 50_000, 5e-6, 0.1, 6.0
# A contact is too stiff where a newton presses it in by so small a part of what positions are computed to.
_SEEN = 1e-4


def with_tighter(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with tolerances divided by a factor, within their bounds."""
    settings = scenario.simulation
    tighter = {name: max(getattr(settings, name) / factor, least) for name, least in TOLERANCES.items()}
    return scenario.updated(simulation=tighter)


def left_open(result: xr.Dataset) -> float:
    """Return the largest share of all energy exchanged that the account leaves open; 0 for rounding.

    Of bodies that exchange next to none, such as one that falls freely, it is the share of the most that is stored.
    """
    stored, exchanged = _most(result, STORED), sum(_most(result, SUPPLIED, LOST))
    residual, most = float(np.abs(result.variables["energy_residual"].values).max()), max(*stored, exchanged)
    if not residual > _ROUNDING * most:
        return 0.0
    return residual / (exchanged if _exchanges(result) else most)


def _most(result: xr.Dataset, *kinds: str) -> list[float]:
    return [float(np.abs(each.values).max()) for each in entries(result, *kinds).values()]


def _exchanges(result: xr.Dataset) -> bool:
    """Return whether the energy exchanged is more than the open part that is allowed of the energy stored."""
    return sum(_most(result, SUPPLIED, LOST)) > _OPEN * max(_most(result, STORED))


def open_account(result: xr.Dataset, share: float) -> str:
    """Return the warning if an energy account leaves more than a ten thousandth open; a share from `left_open`."""
    if not share > _OPEN:
        return ""
    compared = "exchanged" if _exchanges(result) else "stored, as next to none is exchanged"
    return (
        f"the energy account closes only to {share:.1g} of the energy {compared}: an impact, a kink or a quick turn "
        "was passed too coarsely; try a smaller simulation.rtol and atol_scale"
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
