"""Linearisation at a state: A, B, C, D, E of x' = f(x, u, p), y = h(x, u, p), or of the map over a step.

Derivatives are differences of sixth order of the compiled evaluation, whose rounding they come near. Near a kink, such
as where sliding reverses, they are of third order and from the state's side alone. At a kink, such as that of friction
at rest, they are the mean of both sides, as the exact slopes of the laws are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from finger_pin.core.compiled_finger import CompiledFinger
from finger_pin.core.inputs import held_control
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.repetition import Steps
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.stepping.tableaus import rodas5p
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import as_finger, as_inputs, as_packed, input_names
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Differences: offsets in steps; weights of sixth order, and from 0 on of third and of second order.
_OFFSETS = np.arange(-3.0, 4.0)
_CENTRAL = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
_FORWARD = np.array([-11.0, 18.0, -9.0, 2.0]) / 6.0, np.array([-1.5, 2.0, -0.5, 0.0])
# Relative difference of slopes, and of the value's rounding, above which they disagree; number of steps tried, and the
# divisor from one to the next, until one side has no kink.
_SLOPE_TOLERANCE, _ROUNDING, _MAX_TRIALS, _STEP_DIVISOR = 1e-4, 1e-13, 4, 10.0
# Steps: of the scale of a state, of an input in N or V, of the size of a parameter.
_STATE_STEP, _INPUT_STEP, _PARAMETER_STEP = 1e-4, 1e-3, 1e-4
# Steps of a map over these.
_MAP_STEP_SHARE = 1e-3
# Shift of the state, in its scales, of the motion whose time steps are used for all changes.
_START_SHIFT = 1e-3
# Tolerance of the step whose map is differentiated; it is taken again on the same steps.
_STEP_TOLERANCE = 1e-9

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
        state: Packed state x, shape (n,), the state by name, as `by_state` has it or by blocks, or angles of rest, rad.
        inputs: u, shape (m,): tensions of the actuated tendons, N, of a motor in position drive its voltage, V, then
            the inputs of a tree's actuators; or by name, as `input` has it, where those left out are 0.
        dt: Without it f is differentiated; with it, s, the map x -> x(dt) with the inputs held.
        parameters: Dotted keys of numbers of the scenario.

    Returns:
        ``A`` (state, by_state), ``B`` (state, input), ``C`` (output, by_state), ``D`` (output, input), ``E`` (state,
        parameter) and ``F`` (output, parameter), in SI; ``rate``, which is x' or x(dt), and ``output_value``. Outputs
        are angles, velocities, tensions, the fingertips' positions and the motors' currents at the state. Inputs are
        those that have arrived: ``input_delay``, s, is how long each is on its way.
        ``side_by_state``, ``side_of_input`` and ``side_of_parameter`` say where a kink is near: 1 where derivatives
        hold above the number, -1 where below; 0 elsewhere, and at a kink, where they are the mean of both.

    Raises:
        InputError: If state or inputs have a wrong size, free objects are among the coordinates, ``dt`` is not
            positive, or parameters are asked of a finger without a scenario or are not single numbers.
    """
    if isinstance(finger_or_scenario, Finger | FingerDescription):
        scenario, finger = None, as_finger(finger_or_scenario)
    else:
        scenario = load_scenario(finger_or_scenario)
        finger = _build_finger(scenario)
    if objects := (finger.scene.free if finger.scene else {}):
        raise InputError("scenario.environment.objects", "a free object has no linear coordinates", tuple(objects))
    if dt is not None and not 0.0 < dt < np.inf:
        raise InputError("dt", "must be above 0", dt)
    if parameters and scenario is None:
        raise InputError("parameters", "are those of a scenario: give one in place of the finger", list(parameters))
    x = as_packed(finger, state, "state")
    u = as_inputs(finger, inputs)
    rate_or_map = _rate if dt is None else _step_map(finger, x, u, dt)

    def response(changed_finger: Finger, point: Array, inputs: Array) -> Array:
        return np.concatenate([rate_or_map(changed_finger, point, inputs), _outputs(changed_finger, point, inputs)])

    # The map is smooth on its steps, but curved where a kink is on the way: there steps are small.
    step_share = 1.0 if dt is None else _MAP_STEP_SHARE
    by_state = _slopes(lambda varied: response(finger, varied, u), x, step_share * _STATE_STEP * finger.layout.scales())
    by_input = _slopes(lambda varied: response(finger, x, varied), u, np.full(len(u), step_share * _INPUT_STEP))
    by_parameter = np.zeros((len(by_state[0]), 0)), np.zeros(0, int)
    if parameters:
        assert scenario is not None
        family = ParametrisedScenario(scenario, tuple(parameters))
        for key, value in zip(parameters, family.values, strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise InputError(key, "must be a single number of the scenario", value)
        values = np.array(family.values, dtype=float)
        sizes = step_share * _PARAMETER_STEP * np.where(values == 0.0, 1.0, np.abs(values))

        def changed(varied: Array) -> Array:
            return response(_build_finger(family.with_values(varied.tolist())), x, u)

        by_parameter = _slopes(changed, values, sizes, least=values == 0.0)
    return _dataset(finger, response(finger, x, u), (by_state, by_input, by_parameter), list(parameters), dt)


def _build_finger(scenario: Scenario) -> Finger:
    return Finger(scenario.finger, objects=scenario.environment.objects)


def _slopes(
    function: Callable[[Array], Array], point: Array, steps: Array, least: Array | None = None
) -> tuple[Array, NDArray[np.int_]]:
    """Return the derivatives of a vector by a vector, shape (k, n), and from which sides they are, shape (n,).

    At the least value that is allowed they are from above, and 0 is said.
    """
    value = function(point)
    columns, sides = np.zeros((len(value), len(point))), np.zeros(len(point), int)
    for k, step in enumerate(steps):

        def line(offsets: Array, k: int = k) -> Array:
            unit = np.arange(len(point)) == k
            return np.array([function(point + each * unit) if each else value for each in offsets])

        if least is not None and least[k]:
            columns[:, k] = _FORWARD[0] @ line(step * _OFFSETS[3:]) / step
        else:
            columns[:, k], sides[k] = _slope(line, value, step)
    return columns, sides


def _slope(line: Callable[[Array], Array], value: Array, step: float) -> tuple[Array, int]:
    """Return the derivative along a line, and its side: 1 above, -1 below, 0 for a central difference."""
    centrals = []
    for h in step / _STEP_DIVISOR ** np.arange(_MAX_TRIALS):
        values = line(h * _OFFSETS)
        central = _CENTRAL @ values / h
        above, below = [weights @ values[3:] / h for weights in _FORWARD], [-w @ values[3::-1] / h for w in _FORWARD]

        def agree(first: Array, second: Array, h: float = h) -> bool:
            tolerance = _SLOPE_TOLERANCE * np.maximum(abs(first), abs(second)) + _ROUNDING * np.max(abs(value)) / h
            return bool((abs(first - second) <= tolerance).all())

        centrals.append(central)
        if agree(above[0], below[0]):
            return central, 0
        if (side := agree(*above) - agree(*below)) != 0:
            return (above if side > 0 else below)[0], side
    return centrals[0], 0


def _rate(finger: Finger, x: Array, u: Array) -> Array:
    return np.asarray(CompiledFinger(finger).evaluate(x, u).rate)


def _step_map(finger: Finger, x: Array, u: Array, dt: float) -> _Map:
    """Return the map over a step, always on the same steps of the integrator."""

    def stepped(other: Finger, start: Array, inputs: Array, ends: list[Array] | None) -> tuple[Array, list[Array]]:
        mechanism, atol = other.mechanism, _STEP_TOLERANCE * other.layout.scales()
        control = held_control(mechanism.channels, mechanism.coordinates)
        stepper = Stepper(mechanism, control, start, rodas5p(), _STEP_TOLERANCE, atol)
        stepper.hold(inputs)
        if ends is not None:
            stepper.repeat([Steps.from_ends(each) for each in ends])
        trajectory = integrate_compiled(stepper, dt, other.layout.names)
        if trajectory.failure:
            raise InputError("state", f"cannot be integrated over dt: {trajectory.failure}")
        return stepper.x, [each.ends for each in trajectory.steps]

    # At rest nothing moves, and one step would do: those of a motion nearby follow what a change sets off.
    ends = stepped(finger, x + _START_SHIFT * finger.layout.scales(), u, None)[1]
    return lambda other, start, inputs: stepped(other, start, inputs, ends)[0]


def _outputs(finger: Finger, x: Array, u: Array) -> Array:
    compiled = CompiledFinger(finger)
    signals = compiled.evaluate(x, u)
    state = signals.state
    routing, strands = finger.routing, signals.tendons.strands
    # Of a passive tendon, the distal half.
    tension = np.concatenate([strands[: routing.actuated], strands[routing.actuated + 1 :: 2]])
    tip = np.ravel(compiled.motion(state.position, state.velocity).tip)
    current = signals.motors.current if signals.motors is not None else np.zeros(0)
    return np.concatenate([state.position, state.velocity, tension, tip, current])


def _output_names(finger: Finger, count: int) -> list[str]:
    routing, motors = finger.routing, finger.actuators.names
    names = [f"{kind}.{joint}" for kind in ("joint_position", "joint_velocity") for joint in routing.joints]
    names += [f"tendon_tension.{tendon}" for tendon in routing.tendons]
    tips = (count - len(names) - len(motors)) // 3
    labels = [""] if tips == 1 else [f"{tip}." for tip in finger.description.tree.tip_names or range(tips)]
    names += [f"fingertip_position.{label}{axis}" for label in labels for axis in "xyz"]
    return [*names, *(f"motor_current.{motor}" for motor in motors)]


def _dataset(
    finger: Finger,
    value: Array,
    slopes: Sequence[tuple[Array, NDArray[np.int_]]],
    parameters: list[str],
    dt: float | None,
) -> xr.Dataset:
    names = list(finger.layout.names)
    variables: dict[str, Any] = {
        "rate": ("state", value[: len(names)]),
        "output_value": ("output", value[len(names) :]),
    }
    kinds = (("A", "C", "by_state"), ("B", "D", "input"), ("E", "F", "parameter"))
    for (first, second, dimension), (columns, sides) in zip(kinds, slopes, strict=True):
        variables[first] = (("state", dimension), columns[: len(names)], {"units": "SI"})
        variables[second] = (("output", dimension), columns[len(names) :], {"units": "SI"})
        variables["side_by_state" if dimension == "by_state" else f"side_of_{dimension}"] = (dimension, sides)
    delays = [*[0.0] * finger.routing.actuated, *(each.delay for each in finger.description.tree.actuators.values())]
    variables["input_delay"] = ("input", delays, {"units": "s"})
    coordinates = {
        "state": names,
        "by_state": names,
        "input": input_names(finger),
        "output": _output_names(finger, len(value) - len(names)),
        "parameter": parameters,
    }
    kind = "x' = f(x, u, p)" if dt is None else f"x(t + {dt:g} s) with the inputs held"
    return xr.Dataset(variables, coordinates, {"of": kind, "finger": finger.description.name})
