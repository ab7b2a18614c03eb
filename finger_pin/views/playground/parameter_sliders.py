"""Parameters that can be changed while a scenario is played."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.control import OpenLoopTensions
from finger_pin.control.interface import LoopController
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError

#: Rooms of keys that a finger which moves can take up, and those of its controller.
FINGER, CONTROLLER_KEY = ("finger", "hand"), "controller"


@dataclass(frozen=True)
class Parameter:
    """A slider of one number, or of a factor for several.

    Attributes:
        label: In words, with its unit.
        keys: Dotted keys, as of `load_scenario`.
        values: Their values in the scenario.
        high: Largest value of the slider; the least is 0.
        factor: Whether the slider multiplies the values.
    """

    label: str
    keys: tuple[str, ...]
    values: tuple[Any, ...]
    high: float
    factor: bool

    @property
    def start(self) -> float:
        """Value of the slider for the scenario as it is."""
        return 1.0 if self.factor else float(self.values[0])

    def entries(self, number: float) -> dict[str, Any]:
        """Return the entries for a value of the slider."""
        if not 0.0 <= number <= self.high:
            raise InputError(self.label, f"must be from 0 to {self.high:.6g}", number)
        scaled = ((number * np.asarray(each, dtype=float)).tolist() if self.factor else number for each in self.values)
        return dict(zip(self.keys, scaled, strict=True))


def parameters(scenario: Scenario, controller: LoopController, extra_keys: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """Return the parameters of a scenario that can be changed as it is played, and those of further keys."""
    sliders = []
    for label, keys, high, factor in _candidates(scenario, controller):
        try:
            values = ParametrisedScenario(scenario, keys).values
        except InputError:
            # The friction law of this finger has other parameters.
            continue
        factor = factor or not all(isinstance(value, int | float) for value in values)
        if any(value is None for value in values) or (
            factor and not np.any(np.concatenate([np.ravel(value) for value in values]))
        ):
            continue
        high = high if not factor else 3.0 if label == "gain" else 2.0 if label == "gravity" else 10.0
        name = f"{label.partition(',')[0]} ×" if factor else label
        sliders.append(Parameter(name, keys, values, max(high, 1.0 if factor else 2.0 * float(values[0])), factor))
    return (*sliders, *(_parameter_of(scenario, key) for key in extra_keys))


def _candidates(scenario: Scenario, controller: LoopController) -> Iterator[tuple[str, tuple[str, ...], float, bool]]:
    """Yield labels, keys, the largest value, and whether it is a factor."""
    hand = scenario.hand is not None
    finger = "hand.fingers.*.finger" if hand else "finger"
    yield "tendon friction μ", (f"{finger}.tendon_friction.coulomb",), 0.5, False
    yield "joint friction", (f"{finger}.joint_friction.coulomb", f"{finger}.joint_friction.stiction"), 0.0, True
    yield "gravity", ("hand.gravity" if hand else "finger.gravity",), 0.0, True
    if isinstance(controller, OpenLoopTensions):
        return
    yield "gain", ("controller.gain",), 0.0, True
    yield "damping, N m s/rad", ("controller.damping",), 0.1, False
    yield "least tension, N", ("controller.minimum_tension",), 10.0, False
    if scenario.finger.passive_names:
        yield "passive tension, N", ("controller.passive_tension",), 10.0, False


def _parameter_of(scenario: Scenario, key: str) -> Parameter:
    if key.partition(".")[0] not in (*FINGER, CONTROLLER_KEY):
        raise InputError(key, "cannot change while it is played; finger., hand. and controller. can")
    value = ParametrisedScenario(scenario, [key]).values[0]
    scalar = isinstance(value, int | float) and not isinstance(value, bool)
    if value is None or not (scalar or np.asarray(value).dtype.kind == "f") or not np.any(value):
        raise InputError(key, "must have a number other than 0 in the scenario for a slider", value)
    return Parameter(key if scalar else f"{key} ×", (key,), (value,), 3.0 * (value if scalar else 1.0), not scalar)
