"""Fingers from any argument: built, described, a name or a file; and in place of a scenario's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.objects import Object
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.finger import Finger

#: Wherever a finger is taken: itself, its description, the name of one that ships, or the path of a file.
FingerLike: TypeAlias = Finger | DescriptionLike


def as_finger(finger: FingerLike, objects: Mapping[str, Object] | None = None) -> Finger:
    """Return a finger that is given in any way, with objects around it where it is not built yet."""
    return finger if isinstance(finger, Finger) else Finger(finger, objects=objects)


def description_of(finger: FingerLike) -> FingerDescription:
    """Return the description of a finger that is given in any way; none is built."""
    return finger.description if isinstance(finger, Finger) else describe(finger)


def own_finger(finger: FingerLike | None, scenario: Scenario) -> Finger | None:
    """Return the finger that replaces the one of a scenario; None where none is given."""
    return None if finger is None else as_finger(finger, scenario.environment.objects)


def described_by(scenario: Scenario, finger: Finger | None) -> Scenario:
    """Return a scenario with the description of the finger that replaces its own; of a hand it stays as it is."""
    if finger is None or scenario.hand is not None:
        return scenario
    return scenario.model_copy(update={"finger": finger.description})


def fitted(finger: Finger, known: Scenario, other: Scenario) -> Finger:
    """Return a finger as it is where two scenarios describe theirs alike, else with the numbers of the other one."""
    return finger if known.finger == other.finger else finger.changed(other.finger, finger.made_of[2])
