"""The kinds of argument that stand for a finger: one that is built, a description, a name, a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from finger_pin.description.finger import FingerDescription
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.objects import Object
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger

#: Wherever a finger is taken: itself, its description, the name of one that ships, or the path of a file.
FingerLike: TypeAlias = Finger | DescriptionLike


def as_finger(finger: FingerLike, objects: Mapping[str, Object] | None = None) -> Finger:
    """Return the `Finger` of any form of one; one that is built here gets the objects around it."""
    return finger if isinstance(finger, Finger) else Finger(finger, objects=objects)


def description_of(finger: FingerLike) -> FingerDescription:
    """Return the description of a finger that is given in any way; none is built."""
    return finger.description if isinstance(finger, Finger) else describe(finger)


def resolve_finger(finger: FingerLike | None, scenario: Scenario) -> Finger | None:
    """Return the replacement of a scenario's finger, or None."""
    return None if finger is None else as_finger(finger, scenario.environment.objects)


def with_finger(scenario: Scenario, finger: Finger | None) -> Scenario:
    """Return a scenario with the objects and the description of the finger that replaces its own; a hand's stays."""
    if finger is None:
        return scenario
    own = {} if scenario.hand is not None else {"finger": finger.description}
    return scenario.updated(environment={"objects": finger.constructor_args[2]}, **own)


def is_other_hand(finger: Finger | None, scenario: Scenario) -> bool:
    """Return whether a hand is given that the scenario does not describe."""
    return finger is not None and scenario.hand is not None and finger.description != scenario.finger


def fitted(finger: Finger, known: Scenario, other: Scenario) -> Finger:
    """Return a finger with another scenario's numbers; itself if they are the same.

    Raises:
        InputError: If the other numbers are those of a hand, and the finger is another one.
    """
    objects = other.environment.objects
    if known.finger == other.finger:
        return finger if known.environment.objects == objects else finger.changed(finger.description, objects)
    if is_other_hand(finger, known):
        raise InputError("hand", "does not act: the hand that was given is not the scenario's", known.finger.name)
    return finger.changed(other.finger, objects)
