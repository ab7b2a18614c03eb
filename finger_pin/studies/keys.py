"""Keys of a scenario: their values, units and names, and scenarios with other values.

A key is dotted as in `load_scenario`, such as ``finger.joints.distal.link.length``. One number of a list has its index
in brackets: ``environment.fingertip_force[2]``. A star stands for every name: ``finger.actuators.*.motor``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from finger_pin.description.fields import find_field, unit_of
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import Series, split
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, resolve_finger, with_finger, with_parameters_of
from finger_pin.mechanism.finger import Finger

#: What a key may be given: a number, or a name such as that of a method, or yes or no.
Value = float | str | bool
Point = Mapping[str, Value]


@dataclass(frozen=True)
class BaseScenario:
    """Base scenario of a study, with a custom finger if there is one.

    Attributes:
        scenario: The scenario.
        finger: Replaces the finger that it describes; a point's values at keys of a finger change it.
    """

    scenario: Scenario
    finger: Finger | None = None

    @classmethod
    def from_scenario(
        cls, source: ScenarioLike, overrides: Mapping[str, Any] | None = None, finger: FingerLike | None = None
    ) -> BaseScenario:
        """Load a scenario."""
        scenario = load_scenario(source, overrides)
        custom_finger = resolve_finger(finger, scenario)
        return cls(with_finger(scenario, custom_finger), custom_finger)

    def at(self, point: Point) -> Scenario:
        """Return the scenario with other values at some keys.

        Entries left to their defaults, such as a mass centre at half a link's length, follow the values.
        """
        return ParametrisedScenario(self.scenario, tuple(point)).with_values(list(point.values()))

    def finger_at(self, scenario: Scenario) -> Finger | None:
        """Return the replacement of the finger of a point's scenario, or None."""
        return None if self.finger is None else with_parameters_of(self.finger, self.scenario, scenario)

    def check(self, key: str, values: Sequence[Value], *, alone: bool = False) -> None:
        """Raise unless a key can hold values of this kind.

        Single values may still be wrong, or not go with other keys.

        Args:
            key: Key to vary.
            values: Its values.
            alone: Whether no other key is varied, which might make the values fit.
        """
        entry = _look_up(self.scenario, key)
        numbers = _is_number(values[0])
        # A misspelt name in the finger must not create an entry, as an override elsewhere may.
        if (
            key.startswith("finger.")
            and split(key)[1] is None
            and not (_is_number(entry) if numbers else entry is not None)
            and not self._is_omitted(key)
        ):
            raise self._unknown_key(key, numbers)
        problem: InputError | None = None
        for value in values:
            try:
                scenario = self.at({key: value})
            except InputError as error:
                if error.entry.startswith(split(key)[0]):
                    problem = problem or error
                elif alone:
                    problem = problem or InputError(key, f"no value of it can be simulated: {error}")
                else:
                    # The value itself is right.
                    return
                continue
            if numbers and not _is_number(_look_up(scenario, key)):
                raise self._unknown_key(key, numbers)
            return
        if problem is not None:
            raise problem

    def number(self, key: str) -> float:
        """Return the scenario's number at a key."""
        entry = _look_up(self.scenario, key)
        if self._is_omitted(key):
            raise InputError(key, "is left out of the scenario, so that there is no number to start from: state it")
        if not _is_number(entry):
            raise self._unknown_key(key, True)
        return float(entry)

    def _unknown_key(self, key: str, numbers: bool) -> InputError:
        hint = suggestion(key, _leaves(self.scenario.model_dump(mode="python"), "", numbers))
        return InputError(key, f"the scenario has no such {'number' if numbers else 'entry'}{hint}")

    def _is_omitted(self, key: str) -> bool:
        """Return whether a key names an entry that may be left out, and is."""
        parent, _, name = key.rpartition(".")
        table = _look_up(self.scenario, parent)
        return isinstance(table, dict) and table.get(name, 0) is None


def describe(key: str) -> dict[str, str]:
    """Return ``units`` and ``long_name`` of the value at a key, from its description."""
    name, index = split(key)
    root, *path = parts = name.split(".")
    # In a hand, each finger has a table of joints.
    field = find_field(Scenario, parts) or find_field(Scenario, [root, *path[:1], *path[2:]])
    text = (field.description or "").rstrip(".") if field is not None else ""
    suffix = "" if index is None else str([*index])
    return {"units": unit_of(field) or "1", "long_name": f"{text}{suffix}" if text else key}


def _is_number(entry: Any) -> bool:
    return isinstance(entry, int | float) and not isinstance(entry, bool)


def _leaves(entry: Any, key: str, numbers: bool) -> Iterator[str]:
    """Yield the keys below one, those of numbers or all."""
    if isinstance(entry, Mapping):
        for name, child in entry.items():
            yield from _leaves(child, f"{key}.{name}" if key else name, numbers)
    elif isinstance(entry, list | tuple):
        for index, child in enumerate(entry):
            yield from _leaves(child, f"{key}[{index}]", numbers)
    elif _is_number(entry) or not numbers:
        yield key


def _look_up(scenario: Scenario, key: str) -> Any:
    """Return the entry at a key, the first if it stands for several, or None."""
    name, index = split(key)
    entry: Any = scenario.model_dump(mode="python")
    for part in name.split("."):
        table = entry if isinstance(entry, dict) else {}
        child_name = part.strip("{}").split(",")[0]
        entry = next(iter(table.values()), None) if part == "*" else table.get(child_name)
    if index is None:
        return entry
    return entry[index[0]] if isinstance(entry, list | tuple | Series) and max(index) < len(entry) else None
