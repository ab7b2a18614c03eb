"""Linearisation at a state: A, B, C, D, E of x' = f(x, u, p), y = h(x, u, p), or of the map over a step.

A and B of f are the exact derivatives that the integrator has. All others of f and h are differences of sixth order of
the compiled evaluation, whose rounding they come near. Near a kink, such as where sliding reverses, they are of third
order and from the state's side alone. At a kink, such as that of friction at rest, all are the mean of both sides.
Those of the map are taken along on the steps of the motion, over kinks too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.signals.rate_derivatives import rate_derivatives
from finger_pin.core.stepping.period_map import PeriodMap
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
# Relative difference of slopes above which they disagree; number of steps tried, and the divisor from one to the next,
# until one side has no kink.
_SLOPE_TOLERANCE, _MAX_TRIALS, _STEP_DIVISOR = 1e-4, 4, 10.0
# Shifts, in steps, that show how values are rounded; the factor by which slopes may have more of it, and the least.
_ROUNDING_SHIFTS, _ROUNDING_FACTOR, _LEAST_ROUNDING = 1e-9 * np.arange(1.0, 5.0), 10.0, 1e-14
# Steps: of the scale of a state, of an input in N or V, of the size of a parameter.
_STATE_STEP, _INPUT_STEP, _PARAMETER_STEP = 1e-4, 1e-3, 1e-4
# Of the map: tolerance of its motion, the parts of dt that end a step each, which what a change sets off needs where
# the motion itself does not, and the part of a parameter by which it is changed.
_MAP_TOLERANCE, _MAP_PARTS, _PARAMETER_CHANGE = 1e-12, 16, 1e-7

# Maps states, inputs, shapes (m, n) and (m, u), to numbers, shape (m, k).
_Response = Callable[[Array, Array], Array]


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

    def response(changed: Finger) -> _Response:
        compiled = CompiledFinger(changed)
        return lambda states, commands: _rates_and_outputs(compiled, states, commands)

    plain = response(finger)
    steps = _STATE_STEP * finger.layout.scales(), np.full(len(u), _INPUT_STEP)
    value = plain(x[None], u[None])[0]
    by_state = _slopes(lambda states: plain(states, np.tile(u, (len(states), 1))), x, steps[0])
    by_input = _slopes(lambda commands: plain(np.tile(x, (len(commands), 1)), commands), u, steps[1])
    by_parameter = np.zeros((len(value), 0)), np.zeros(0, int)
    values = sizes = np.zeros(0)
    if parameters:
        assert scenario is not None
        changed, values = _single_numbers(scenario, parameters)
        sizes = _PARAMETER_STEP * np.where(values == 0.0, 1.0, np.abs(values))
        by_parameter = _slopes(
            lambda varied: np.array([response(changed(each))(x[None], u[None])[0] for each in varied]),
            values,
            sizes,
            least=values == 0.0,
        )
    size = len(x)
    if dt is None:
        by_state[0][:size], by_input[0][:size] = rate_derivatives(finger.mechanism, x, u)
    else:
        shifts = _PARAMETER_CHANGE * np.where(values == 0.0, 1.0, np.abs(values))
        varied = [(changed(values + shift), shift.sum()) for shift in np.diag(shifts)]
        value[:size], slopes = _map(finger, x, u, dt, varied)
        by_state[0][:size], by_input[0][:size], by_parameter[0][:size] = np.split(slopes, [size, size + len(u)], axis=1)
    return _dataset(finger, value, (by_state, by_input, by_parameter), list(parameters), dt)


def _map(finger: Finger, x: Array, u: Array, dt: float, varied: Sequence[tuple[Finger, float]]) -> tuple[Array, Array]:
    """Return x(dt) and its derivatives by state, inputs and parameters, shapes (n,) and (n, n + u + p)."""
    periods = PeriodMap(finger, x, varied, exact=True, method="Rodas5P", rtol=_MAP_TOLERANCE, atol_scale=_MAP_TOLERANCE)
    periods.inputs[:] = u
    size, first, last = len(x), len(x) + len(u), periods.derivatives.shape[1] - len(varied)
    slopes = np.eye(size, periods.derivatives.shape[1])
    for end in np.linspace(0.0, dt, _MAP_PARTS + 1)[1:]:
        if failed := periods.advance(end):
            raise InputError("state", f"cannot be integrated over dt: {failed}")
        slopes, held = periods.derivatives[:, :size] @ slopes, periods.derivatives[:, size:]
        slopes[:, size:] += held
    return periods.x, np.delete(slopes, np.s_[first:last], axis=1)


def _single_numbers(scenario: Scenario, parameters: Sequence[str]) -> tuple[Callable[[Array], Finger], Array]:
    """Return the finger of a scenario with other numbers, and the numbers that it has; refuse what is no single one."""
    family = ParametrisedScenario(scenario, tuple(parameters))
    for key, value in zip(parameters, family.values, strict=True):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(key, "must be a single number of the scenario", value)
    return lambda values: _build_finger(family.with_values(values.tolist())), np.array(family.values, dtype=float)


def _build_finger(scenario: Scenario) -> Finger:
    return Finger(scenario.finger, objects=scenario.environment.objects)


def _slopes(
    function: Callable[[Array], Array], point: Array, steps: Array, least: NDArray[np.bool_] | None = None
) -> tuple[Array, NDArray[np.int_]]:
    """Return the derivatives of a vector by a vector, shape (k, n), and from which sides they are, shape (n,).

    At the least value that is allowed they are from above, and 0 is said.

    Args:
        function: Maps m points, shape (m, n), to vectors, shape (m, k).
        point: Shape (n,).
        steps: Shape (n,).
        least: Where a number must not be less, shape (n,).
    """
    value, *shifted = function(point + np.append(0.0, _ROUNDING_SHIFTS)[:, None] * steps)
    rounding = _ROUNDING_FACTOR * np.abs(shifted - value).max(axis=0) + _LEAST_ROUNDING * np.abs(value)
    columns, sides = np.zeros((len(value), len(point))), np.zeros(len(point), int)
    bounded: NDArray[np.bool_] = np.zeros(len(point), bool) if least is None else np.asarray(least, dtype=bool)

    def lines(which: NDArray[np.intp], h: Array, offsets: Array) -> Array:
        """Return the values at offsets along some numbers, shape (len(which), offsets, k); 0 is the point itself."""
        moved = np.flatnonzero(offsets)
        points = np.tile(point, (len(which), len(moved), 1))
        points[np.arange(len(which)), :, which] += h[:, None] * offsets[moved]
        values = np.tile(value, (len(which), len(offsets), 1))
        if points.size:
            values[:, moved] = function(points.reshape(-1, len(point))).reshape(len(which), len(moved), -1)
        return values

    above = np.flatnonzero(bounded)
    columns[:, above] = (
        np.einsum("o,cok->ck", _FORWARD[0], lines(above, steps[above], _OFFSETS[3:])) / steps[above, None]
    ).T
    pending = np.flatnonzero(~bounded)
    for trial in range(_MAX_TRIALS):
        h = steps[pending] / _STEP_DIVISOR**trial
        undecided = []
        for k, values, size in zip(pending, lines(pending, h, _OFFSETS), h, strict=True):
            slope, side = _slope(values, rounding, size)
            if trial == 0 or side is not None:
                columns[:, k], sides[k] = slope, side or 0
            if side is None:
                undecided.append(k)
        pending = np.array(undecided, dtype=np.intp)
        if not len(pending):
            break
    return columns, sides


def _slope(values: Array, rounding: Array, h: float) -> tuple[Array, int | None]:
    """Return the derivative along a line of values at `_OFFSETS`, and its side: 1 above, -1 below, 0 central.

    None: both sides have a kink.
    """
    central = _CENTRAL @ values / h
    above, below = [weights @ values[3:] / h for weights in _FORWARD], [-w @ values[3::-1] / h for w in _FORWARD]

    def agree(first: Array, second: Array) -> bool:
        tolerance = _SLOPE_TOLERANCE * np.maximum(abs(first), abs(second)) + rounding / h
        return bool((abs(first - second) <= tolerance).all())

    if agree(above[0], below[0]):
        return central, 0
    if (side := agree(*above) - agree(*below)) != 0:
        return (above if side > 0 else below)[0], side
    return central, None


def _rates_and_outputs(compiled: CompiledFinger, x: Array, u: Array) -> Array:
    """Return rates and outputs at packed states under inputs, shape (m, n + outputs)."""
    signals = compiled.evaluate(x, u)
    state = signals.state
    tip = compiled.motion(state.position, state.velocity).tip.reshape(len(x), -1)
    current = [signals["motor_current"]] if compiled.finger.actuators.names else []
    return np.concatenate(
        [signals.rate, state.position, state.velocity, signals["tendon_tension"], tip, *current], axis=1
    )


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
