"""The start of a simulation: a packed state, or the last saved state of a result; and the names of custom parts."""

from __future__ import annotations

import math
import warnings

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.analysis.path_jumps import path_jump_advice
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.position_drive import LoopMemory
from finger_pin.core.stepping.stepper import TABLEAUS
from finger_pin.description.validation import finite_vector, suggestion
from finger_pin.exceptions import InputError, StartWarning
from finger_pin.laws.limiter import limiter_energy, penetration
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.state import BLOCKS, State
from finger_pin.simulation.contact_variables import last_contact_state
from finger_pin.simulation.netcdf import require_samples
from finger_pin.simulation.variables import LOOP_VARIABLES
from finger_pin.typing import Array

# The rows that guard ranges: what they guard, and the unit of its depth.
_STOPS = {"limiter": "joint", "tendon_limit": "cord"}
# Energy in a stop that a start does not mention, J: 0.4 deg of the default stop; where (20) leads a joint is nearer.
_LEAST_ENERGY = 1e-3
# Part of a joint's range within which a jump of a path is why a motion ends.
_NEAR_JUMP = 0.02
_ADVICE = "smaller inputs, softer contacts, stops and tendons, or another rtol"


def custom_parts(
    controller: object, reference: object, fingertip_force: object, initial: object, finger: object = None
) -> str:
    """Return the custom parts of a simulation, such as ``controller, reference``; empty for none.

    Args:
        controller: As for `simulate`.
        reference: As for `simulate`.
        fingertip_force: As for `simulate`.
        initial: As for `simulate`.
        finger: As for `simulate`.
    """
    arguments = {
        "controller": controller,
        "reference": reference,
        "force": fingertip_force,
        "initial state": initial,
        "finger": finger,
    }
    return ", ".join(name for name, argument in arguments.items() if argument is not None)


def packed_state(initial: ArrayLike | xr.Dataset, finger: Finger) -> Array:
    """Return the packed state at the start, shape (size,).

    Args:
        initial: A packed state, or a result of the same finger, which is continued from its last saved state.
        finger: The finger.
    """
    if not isinstance(initial, xr.Dataset):
        try:
            return finite_vector("initial", np.array(initial, dtype=float), finger.layout.size)
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            allowed = f"must be a result, or a packed state of {finger.layout.size} numbers"
            raise InputError("initial", allowed, type(initial).__name__) from None
    routing = finger.routing
    for dimension, names in (("joint", routing.joints), ("tendon", routing.tendons)):
        if dimension not in initial.coords or tuple(map(str, initial[dimension].values)) != names:
            raise InputError("initial", f"is a result of another finger: its {dimension}s must be {', '.join(names)}")
    require_samples(initial)
    last, blocks = initial.isel(time=-1), {}
    sizes = vars(finger.layout.unpack(np.zeros(finger.layout.size)))
    for block, name in ((block, entry.variable) for block, entry in BLOCKS.items() if entry.variable):
        if name in last:
            blocks[block] = np.atleast_1d(last[name].values)
        elif sizes[block].size:
            raise InputError("initial", f"has no {name}; give what simulate returned")
        else:
            blocks[block] = np.zeros(0)
    x = finger.layout.pack(State(**(blocks | last_contact_state(finger, last))))
    _fill_rows(finger, last, x)
    return finite_vector("initial", x, finger.layout.size)


def _fill_rows(finger: Finger, last: xr.Dataset, x: Array) -> None:
    """Fill the states of canals, actuators of trees, and custom rows and drives from a result's variables."""
    rows, z = {table.group for table in finger.extra_rows}, finger.mechanism.split(x)[2]
    for table, part in zip(finger.mechanism.rows, finger.mechanism.states, strict=True):
        if table.states and table.group in rows:
            name = f"{table.group}_state"
            if name not in last or last[name].size != table.states:
                raise InputError("initial", f"has no {name}; give what simulate returned")
            z[part] = np.ravel(last[name].values)


def with_initial_state(loop: ClosedLoop, initial: ArrayLike | xr.Dataset | None) -> ClosedLoop:
    """Return a loop with an initial state: a packed one, or the last of a result; the loop itself for None."""
    if initial is None:
        return loop
    packed = packed_state(initial, loop.finger)
    return loop.with_start(packed, _last_samples(initial, loop.finger) if isinstance(initial, xr.Dataset) else None)


def _last_samples(initial: xr.Dataset, finger: Finger) -> LoopMemory | None:
    """Return the memory of the loops of motors at the end of a result; None where no loop has run."""
    if not finger.actuators.holds.any() or "spool_angle" not in initial:
        return None
    last = initial.isel(time=-1)
    if missing := [name for name in LOOP_VARIABLES if name not in last]:
        raise InputError("initial", f"has no {missing[0]}; give what simulate returned")
    age, *signals = (last[name].values for name in LOOP_VARIABLES)
    return LoopMemory(float(age), *(signal[finger.actuators.holds] for signal in signals))


def as_finite_array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return an argument as finite numbers of a shape; a copy."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(name, _size_message(shape), value) from None
    if array.shape != shape:
        raise InputError(name, f"{_size_message(shape)}, not an array of shape {array.shape}")
    # Plain Python is faster than NumPy for a few values.
    if not all(map(math.isfinite, array.ravel().tolist())):
        raise InputError(name, "must be finite", array.tolist())
    return array


def _size_message(shape: tuple[int, ...]) -> str:
    return f"must be {' times '.join(map(str, shape))} numbers"


def check_motors(finger: Finger, x: Array, name: str = "initial") -> None:
    """Refuse a packed state in which a motor turns faster than its supply and its current limit allow.

    Its induced voltage is then above the supply voltage plus the drop of the greatest current at its resistance.

    Args:
        finger: With motors or without.
        x: The packed state, shape (size,).
        name: Of the argument, for messages.
    """
    if not finger.actuators.names:
        return
    speed, actuators = finger.layout.unpack(x).motor_velocity, finger.actuators
    constant, resistance, supply, limit = actuators.motor[:4]
    greatest_speeds = (supply + resistance * limit) / constant
    for motor, motor_speed, greatest in zip(actuators.names, speed, greatest_speeds, strict=True):
        if abs(motor_speed) > greatest:
            allowed = f"motor {motor} must turn by at most {greatest:.4g} rad/s at its spool, which its supply can hold"
            raise InputError(name, allowed, float(motor_speed))


def check_settings(table: str, method: str, rtol: float, atol_scale: float) -> None:
    """Refuse methods that do not step, and tolerances that no step can keep; `table` is what entries begin with."""
    if method not in TABLEAUS:
        raise InputError(
            f"{table}method", f"must be one of {', '.join(TABLEAUS)}{suggestion(method, TABLEAUS)}", method
        )
    for name, value in (("rtol", rtol), ("atol_scale", atol_scale)):
        if not 0.0 < value <= 0.1:
            raise InputError(f"{table}{name}", "must be above 0 and at most 0.1", value)


def beyond_ranges(finger: Finger, x: Array) -> str:
    """Return which joints and cords lie beyond their ranges at a packed state, how deep, and the energy there.

    Args:
        finger: The finger.
        x: The packed state, shape (size,).

    Returns:
        Text; empty where their stops hold less than 1 mJ each.
    """
    stops, position = finger.stroke_limiter, finger.layout.unpack(x).position
    outside = np.any(stops.limited & (penetration(position, stops.lower, stops.upper) != 0.0))
    if not outside and all(table.group != "tendon_limit" for table in finger.mechanism.rows):
        return ""
    rows, parts = finger.mechanism.evaluate(x, np.zeros(finger.mechanism.channels)).rows, list[str]()
    slides = dict(zip(finger.routing.joints, finger.rigid_body.slides, strict=False))
    for group, kind in _STOPS.items():
        if group not in rows:
            continue
        table, depths = rows[group].rows, np.ravel(rows[group]["depth"])
        lower, upper, stiffness = table.parameters[:3]
        for row, energy in enumerate(np.ravel(limiter_energy(depths, stiffness))):
            if energy > _LEAST_ENERGY:
                name = table.names[row]
                unit = "m" if kind == "cord" or slides.get(name, False) else "rad"
                ends = f"{lower[row]:.4g} to {upper[row]:.4g}"
                parts.append(f"{kind} {name}: {abs(depths[row]):.3g} {unit} beyond {ends}, {energy:.2g} J in its stop")
    return "; ".join(parts)


def warn_beyond_ranges(finger: Finger, x: Array) -> None:
    """Warn of joints and cords that start beyond their ranges, before their stops throw them back."""
    if beyond := beyond_ranges(finger, x):
        warnings.warn(StartWarning(f"{finger.description.name} starts beyond its ranges: {beyond}"), stacklevel=3)


def failure_advice(finger: Finger, reason: str, x: Array, otherwise: str = _ADVICE) -> str:
    """Return advice for a motion that has ended at a packed state, shape (size,), for a reason."""
    if jumps := path_jump_advice(finger, finger.layout.unpack(x).position, _NEAR_JUMP):
        return f"another path: {jumps}"
    if "physical range" in reason:
        return "smaller inputs or gains, heavier links, or a start within the joints' ranges"
    if beyond := beyond_ranges(finger, x):
        return f"a start within the ranges, smaller inputs, or softer stops: {beyond}"
    return otherwise
