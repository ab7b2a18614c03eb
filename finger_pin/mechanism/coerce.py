"""The kinds of argument that stand for a finger, for its state and for its inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.objects import Object
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import finite_vector, suggestion
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.state import State
from finger_pin.typing import Array

#: Wherever a finger is taken: itself, its description, the name of one that ships, or the path of a file.
FingerLike: TypeAlias = Finger | DescriptionLike


def as_finger(finger: FingerLike, objects: Mapping[str, Object] | None = None) -> Finger:
    """Return a `Finger` from a finger, a description, a name or a path; a new one gets the objects around it."""
    return finger if isinstance(finger, Finger) else Finger(finger, objects=objects)


def description_of(finger: FingerLike) -> FingerDescription:
    """Return the description of a finger, from a finger, a description, a name or a path."""
    return finger.description if isinstance(finger, Finger) else describe(finger)


def resolve_finger(finger: FingerLike | None, scenario: Scenario) -> Finger | None:
    """Return the replacement of a scenario's finger, or None."""
    return None if finger is None else as_finger(finger, scenario.environment.objects)


def with_finger(scenario: Scenario, finger: Finger | None) -> Scenario:
    """Return a scenario with the description and objects of a finger in place of its own; a hand is kept."""
    if finger is None:
        return scenario
    replacement = {} if scenario.hand is not None else {"finger": finger.description}
    return scenario.updated(environment={"objects": finger.constructor_args.objects}, **replacement)


def is_other_hand(finger: Finger | None, scenario: Scenario) -> bool:
    """Return whether a hand is given that the scenario does not describe."""
    return finger is not None and scenario.hand is not None and finger.description != scenario.finger


def with_parameters_of(finger: Finger, scenario: Scenario, other: Scenario) -> Finger:
    """Return a finger with another scenario's numbers; itself if they are the same.

    Raises:
        InputError: If the other numbers are those of a hand, and the finger is another one.
    """
    objects = other.environment.objects
    if scenario.finger == other.finger:
        return finger if scenario.environment.objects == objects else finger.changed(finger.description, objects)
    if is_other_hand(finger, scenario):
        raise InputError("hand", "does not act: the hand that was given is not the scenario's", scenario.finger.name)
    return finger.changed(other.finger, objects)


def as_packed(finger: Finger, state: State | Mapping[str, float] | ArrayLike, name: str) -> Array:
    """Return a packed state, shape (size,), from one, from the state by name, or from theta, shape (n,), of rest.

    Numbers may be named as `StateLayout.names` has them; those left out are those of rest at the angles.

    Raises:
        InputError: If it has another size, a name that is none, or a number is not finite; ``name`` names the argument.
    """
    if isinstance(state, Mapping):
        return _packed_by_name(finger, state, name)
    values = finger.layout.pack(state) if isinstance(state, State) else state
    try:
        x = np.array(values, dtype=float)
    except (TypeError, ValueError):
        x = np.array(np.nan)
    joints, size = len(finger.routing.joints), finger.layout.size
    if x.shape not in ((joints,), (size,)) or not np.isfinite(x).all():
        shown = x.tolist() if x.ndim else type(state).__name__
        allowed = f"must be {size} finite numbers, a packed state, or {joints}, angles of rest"
        raise InputError(name, allowed, shown)
    return x if x.shape == (size,) else finger.rest_state(x)


def _packed_by_name(finger: Finger, state: Mapping[str, float], name: str) -> Array:
    names = finger.layout.names
    _refuse_unknown(state, names, name, "state")
    values = finite_vector(name, np.array([*state.values()], dtype=float), len(state))
    angles = [state.get(f"joint_position[{joint}]", 0.0) for joint in finger.routing.joints]
    x = finger.rest_state(np.array(angles, dtype=float))
    x[[names.index(key) for key in state]] = values
    return x


def _refuse_unknown(
    values: Mapping[str, float], names: Sequence[str], name: str, kind: str, others: Sequence[str] = ()
) -> None:
    for key in values:
        if key not in names:
            allowed = f"no such {kind}; there are {', '.join(names)}{suggestion(key, [*names, *others])}"
            raise InputError(f"{name}.{key}", allowed)


def input_names(finger: Finger) -> list[str]:
    """Return the names of inputs with their kinds, as linearisations have them."""
    routing = finger.routing
    kinds = np.where(routing.winched, "tendon_winding", "tendon_command")
    names = [f"{kind}.{tendon}" for kind, tendon in zip(kinds, routing.tendons, strict=False)]
    for motor, channel in zip(finger.actuators.names, finger.actuators.channels, strict=True):
        if channel in finger.actuators.voltages:
            names[channel] = f"motor_voltage.{motor}"
    return [*names, *(f"input.{k}" for k in range(len(names), finger.mechanism.channels))]


def as_inputs(finger: Finger, inputs: Mapping[str, float] | ArrayLike, name: str = "inputs") -> Array:
    """Return inputs u, shape (u,), from a sequence or from a table by name, 0 if left out.

    Raises:
        InputError: If there is no such input, or the numbers are not as many as inputs and finite; ``name`` names
            the argument.
    """
    if not isinstance(inputs, Mapping):
        return np.array(finite_vector(name, np.asarray(inputs, dtype=float), finger.mechanism.channels))
    with_kinds = input_names(finger)
    names = [*finger.input_names, *with_kinds[len(finger.input_names) :]]
    short = dict(zip(with_kinds, names, strict=True))
    named = {short.get(each, each): value for each, value in inputs.items()}
    _refuse_unknown(named, names, name, "input", with_kinds)
    if len(named) < len(inputs):
        raise InputError(name, "must name an input once", list(inputs))
    values = np.array([named.get(each, 0.0) for each in names], dtype=float)
    return np.array(finite_vector(name, values, finger.mechanism.channels))


def at_tip(finger: Finger, tip: str | None) -> Finger:
    """Return a finger with one fingertip of its tree, by name; itself if it has a single one.

    Raises:
        InputError: If there is no such fingertip, or several of which none is named.
    """
    names = finger.description.tree.tip_names
    if tip is None and not names:
        return finger
    if tip not in names:
        allowed = f"must be one of {', '.join(names)}" if names else "is of trees with several; leave it out"
        raise InputError("tip", allowed, tip)
    description = finger.description.updated(tree=finger.description.tree.with_tip(tip))
    return finger.changed(description, finger.constructor_args.objects)


def one_finger(description: FingerDescription) -> None:
    """Refuse a hand of several fingers where one finger is needed.

    Raises:
        InputError: If it is a hand of several fingers.
    """
    hand = description.hand
    if hand is not None and len(hand.fingers) > 1:
        allowed = f"is a hand; take one of its fingers: scenario.parts()[NAME] with {', '.join(hand.fingers)}"
        raise InputError("finger", allowed, hand.name)


def refuse_without_tendons(description: FingerDescription) -> None:
    """Refuse a hand whose cords, if any, servos and muscles of its tree pull: their tensions are not chosen.

    Raises:
        InputError: If it has no actuated tendon.
    """
    if not description.actuated_names:
        allowed = "must have an actuated one for that; servos and muscles of a tree pull its own cords"
        raise InputError("finger.tendons", allowed)
