"""Linearisation at a state: A, B, C, D, E of x' = f(x, u, p), y = h(x, u, p), or of the map over a step.

Derivatives are differences of sixth order of the compiled evaluation, whose rounding they come near. At a kink, such as
that of friction at rest, they are the mean of both sides, as the exact slopes of the laws are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.core.compiled_finger import CompiledFinger
from finger_pin.core.inputs import held_control
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.repetition import Steps
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.stepping.tableaus import rodas5p
from finger_pin.description.finger import FingerDescription
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.description.parametrised_scenario import ParametrisedScenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import as_finger, as_inputs, as_packed
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Central differences of sixth order: where to look, in steps, and weights.
_OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
_WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
# Steps: of the scale of a state, of an input in N or V, of the size of a parameter.
_OF_STATES, _OF_INPUTS, _OF_PARAMETERS = 1e-4, 1e-3, 1e-4
# What part of these for a map.
_OF_MAPS = 1e-3
# How far from a state a motion begins that shows which steps its changes need, of its scale.
_NEARBY = 1e-3
# Tolerance of the step whose map is differentiated; it is taken again on the same steps.
_TIGHT = 1e-9

_Map = Callable[[Finger, Array, Array], Array]


def linearise(
    finger_or_scenario: Finger | FingerDescription | ScenarioLike,
    state: ArrayLike,
    inputs: ArrayLike,
    dt: float | None = None,
    parameters: Sequence[str] = (),
) -> xr.Dataset:
    """Return the linearisation of a finger at a state, in open loop.

        lin = fp.linearise("fig6", x, tensions, dt=1e-3)

    Args:
        finger_or_scenario: The finger or its description; or a scenario with one (and objects), its name, or the path
            of its file.
        state: Packed state x, shape (n,), the state by name, or angles of rest, rad.
        inputs: u, shape (m,): tensions of the actuated tendons, N, of a motor in position drive its voltage, V, then
            the inputs of a tree's actuators; or by name, where those left out are 0.
        dt: Without it f is differentiated; with it, s, the map x -> x(dt) with the inputs held.
        parameters: Dotted keys of numbers of the scenario.

    Returns:
        ``A`` (state, by_state), ``B`` (state, input), ``C`` (output, by_state), ``D`` (output, input), ``E`` (state,
        parameter) and ``F`` (output, parameter), in SI; ``rate``, which is x' or x(dt), and ``output_value``. Outputs
        are angles, velocities, tensions, the fingertip's position and the motors' currents at the state.

    Raises:
        InputError: If state or inputs have a wrong size, free objects are among the coordinates, ``dt`` is not
            positive, or parameters are asked of a finger without a scenario or are not single numbers.
    """
    if isinstance(finger_or_scenario, Finger | FingerDescription):
        scenario, finger = None, as_finger(finger_or_scenario)
    else:
        scenario = load_scenario(finger_or_scenario)
        finger = _built(scenario)
    if objects := (finger.scene.free if finger.scene else {}):
        raise InputError("scenario.environment.objects", "a free object has no linear coordinates", tuple(objects))
    if dt is not None and not 0.0 < dt < np.inf:
        raise InputError("dt", "must be above 0", dt)
    if parameters and scenario is None:
        raise InputError("parameters", "are those of a scenario: give one in place of the finger", list(parameters))
    x = as_packed(finger, state, "state")
    u = as_inputs(finger, inputs)
    change = _rate if dt is None else _over(finger, x, u, dt)
    maps: tuple[_Map, _Map] = (change, _outputs)
    # The map is smooth on its steps, but curved where a kink is on the way: there steps are small.
    part = 1.0 if dt is None else _OF_MAPS
    states, given = part * _OF_STATES * finger.layout.scales(), part * np.full(len(u), _OF_INPUTS)
    by_state = [_slopes(partial(_at_state, m, finger, u), x, states) for m in maps]
    by_input = [_slopes(partial(m, finger, x), u, given) for m in maps]
    by_parameter = [np.zeros((len(each), 0)) for each in by_state]
    if parameters:
        assert scenario is not None
        family = ParametrisedScenario(scenario, tuple(parameters))
        for key, value in zip(parameters, family.values, strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise InputError(key, "must be a single number of the scenario", value)
        values = np.array(family.values, dtype=float)
        sizes = part * _OF_PARAMETERS * np.where(values == 0.0, 1.0, np.abs(values))
        by_parameter = [_slopes(partial(_at_values, m, family, x, u), values, sizes, least=values == 0.0) for m in maps]
    return _dataset(finger, maps, (x, u), (by_state, by_input, by_parameter), list(parameters), dt)


def _at_state(map_: _Map, finger: Finger, u: Array, x: Array) -> Array:
    return map_(finger, x, u)


def _at_values(map_: _Map, family: ParametrisedScenario, x: Array, u: Array, values: Array) -> Array:
    return map_(_built(family.with_values(values.tolist())), x, u)


def _built(scenario: Scenario) -> Finger:
    return Finger(scenario.finger, objects=scenario.environment.objects)


def _slopes(of: Callable[[Array], Array], at: Array, steps: Array, least: Array | None = None) -> Array:
    """Return the derivatives of a vector by a vector, shape (k, n); one-sided at the least value allowed."""
    columns = []
    for k, step in enumerate(steps):
        moved = at + np.outer(_OFFSETS, step * (np.arange(len(at)) == k))
        if least is not None and least[k]:
            # Forward, of second order.
            ends = [of(at + way * step * (np.arange(len(at)) == k)) for way in (0.0, 1.0, 2.0)]
            columns.append((-1.5 * ends[0] + 2.0 * ends[1] - 0.5 * ends[2]) / step)
        else:
            columns.append(np.tensordot(_WEIGHTS, np.array([of(each) for each in moved]), axes=1) / step)
    return np.stack(columns, axis=1)


def _rate(finger: Finger, x: Array, u: Array) -> Array:
    return np.asarray(CompiledFinger(finger).evaluate(x, u).rate)


def _over(finger: Finger, x: Array, u: Array, dt: float) -> _Map:
    """Return the map over a step, always on the same steps of the integrator."""

    def stepped(other: Finger, start: Array, inputs: Array, ends: list[Array] | None) -> tuple[Array, list[Array]]:
        mechanism, atol = other.mechanism, _TIGHT * other.layout.scales()
        control = held_control(mechanism.channels, mechanism.coordinates)
        stepper = Stepper(mechanism, control, start, rodas5p(), _TIGHT, atol)
        stepper.hold(inputs)
        if ends is not None:
            stepper.repeat([Steps.whole(each) for each in ends])
        found = integrate_compiled(stepper, dt, other.layout.names)
        if found.failure:
            raise InputError("state", f"cannot be integrated over dt: {found.failure}")
        return stepper.x, [each.ends for each in found.steps]

    # At rest nothing moves, and one step would do: those of a motion nearby follow what a change sets off.
    ends = stepped(finger, x + _NEARBY * finger.layout.scales(), u, None)[1]
    return lambda other, start, inputs: stepped(other, start, inputs, ends)[0]


def _outputs(finger: Finger, x: Array, u: Array) -> Array:
    compiled = CompiledFinger(finger)
    found = compiled.evaluate(x, u)
    state = found.state
    routing, strands = finger.routing, found.tendons.strands
    # Of a passive tendon, the distal half.
    tension = np.concatenate([strands[: routing.actuated], strands[routing.actuated + 1 :: 2]])
    tip = np.ravel(compiled.motion(state.position, state.velocity).tip)
    current = found.motors.current if found.motors is not None else np.zeros(0)
    return np.concatenate([state.position, state.velocity, tension, tip, current])


def _output_names(finger: Finger, count: int) -> list[str]:
    routing, motors = finger.routing, finger.actuators.names
    names = [f"{kind}.{joint}" for kind in ("joint_position", "joint_velocity") for joint in routing.joints]
    names += [f"tendon_tension.{tendon}" for tendon in routing.tendons]
    tips = (count - len(names) - len(motors)) // 3
    for tip in range(tips):
        names += [f"fingertip_position.{axis}" if tips == 1 else f"fingertip_position.{tip}.{axis}" for axis in "xyz"]
    return [*names, *(f"motor_current.{motor}" for motor in motors)]


def _input_names(finger: Finger) -> list[str]:
    routing = finger.routing
    kinds = np.where(routing.winched, "tendon_winding", "tendon_command")
    names = [f"{kind}.{tendon}" for kind, tendon in zip(kinds, routing.tendons, strict=False)]
    for motor, channel in zip(finger.actuators.names, finger.actuators.channels, strict=True):
        if channel in finger.actuators.voltages:
            names[channel] = f"motor_voltage.{motor}"
    return [*names, *(f"input.{k}" for k in range(len(names), finger.mechanism.channels))]


def _dataset(
    finger: Finger,
    maps: tuple[_Map, _Map],
    at: tuple[Array, Array],
    found: tuple[list[Array], list[Array], list[Array]],
    parameters: list[str],
    dt: float | None,
) -> xr.Dataset:
    (a, c), (b, d), (e, f) = found
    whose = {"A": ("state", "by_state"), "B": ("state", "input"), "C": ("output", "by_state"), "D": ("output", "input")}
    whose |= {"E": ("state", "parameter"), "F": ("output", "parameter")}
    blocks = dict(zip(whose, (a, b, c, d, e, f), strict=True))
    variables = {name: (whose[name], blocks[name], {"units": "SI"}) for name in whose}
    values = {"rate": ("state", maps[0](finger, *at)), "output_value": ("output", maps[1](finger, *at))}
    names = list(finger.layout.names)
    coordinates = {
        "state": names,
        "by_state": names,
        "input": _input_names(finger),
        "output": _output_names(finger, len(c)),
        "parameter": parameters,
    }
    kind = "x' = f(x, u, p)" if dt is None else f"x(t + {dt:g} s) with the inputs held"
    return xr.Dataset({**variables, **values}, coordinates, {"of": kind, "finger": finger.description.name})
