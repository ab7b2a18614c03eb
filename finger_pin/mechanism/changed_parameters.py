"""A finger with other parameters on the same wiring: what no parameter touches is not built again."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.objects import Object
from finger_pin.mechanism.joints import JointFriction, StrokeLimiter
from finger_pin.mechanism.object_scene import Scene
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# Entries that change parameters of laws, inertias and motions alone: of a finger, an object and a palm.
_LAWS = {"tendon_friction", "joint_friction", "stroke_limiter"}
_OF_OBJECT, _OF_PALM = {"mass", "path"}, {"path"}


def with_changed_parameters(
    finger: Any, description: FingerDescription, objects: Mapping[str, Object] | None
) -> Any | None:
    """Return the `Finger` of another description and other objects, on the same wiring.

    It is None if more differs than friction and stops, masses of objects, and paths of these and of the palm.
    """
    args = finger.constructor_args
    if not finger.places or (objects is None) != (args.objects is None):
        return None
    if not _same_wiring(finger.description, description):
        return None
    scene, friction = _scene(finger, description, objects), JointFriction(description, finger.routing)
    # Names of custom laws may stand for other ones by now.
    if (scene is None) != (finger.scene is None) or all(each.law is not friction.law for each in finger.mechanism.rows):
        return None
    twin, limiter, tendons = copy.copy(finger), StrokeLimiter(description), Tendons(description, finger.routing)
    # Signals stay, which copies leave out.
    twin.__dict__ |= vars(finger)
    twin.description, twin.constructor_args = description, args._replace(objects=objects)
    twin.tendons, twin.joint_friction, twin.stroke_limiter, twin.scene = tendons, friction, limiter, scene
    old, parameters = finger.description, dict[str, Array]()
    if description.tendon_friction is not old.tendon_friction:
        parameters |= {group: tendons.at(*places) for group, places in finger.places.items()}
    if description.joint_friction is not old.joint_friction:
        parameters["joint_friction"] = friction.parameters
    if description.stroke_limiter is not old.stroke_limiter:
        parameters["limiter"] = limiter.parameters

    def changed(tables: Sequence[Rows]) -> tuple[Rows, ...]:
        return tuple([each.with_parameters(parameters.get(each.group)) for each in tables])

    before, twin.mechanism = finger.mechanism, copy.copy(finger.mechanism)
    twin.mechanism.listed, twin.extra_rows = changed(before.listed), changed(finger.extra_rows)
    by_group = {table.group: table for table in twin.mechanism.listed}
    twin.mechanism.rows = tuple([by_group[table.group] for table in before.rows])
    if scene is not None:
        twin.mechanism.body = scene.body
    return twin


def _scene(finger: Any, description: FingerDescription, objects: Mapping[str, Object] | None) -> Scene | None:
    """Return the scene with other masses and paths; None if more differs."""
    scene: Scene | None = finger.scene
    before, after = (each.hand.palm if each.hand else None for each in (finger.description, description))
    if scene is None:
        return None
    around = {**description.tree.objects, **(objects or {})}
    pairs = list(zip(scene.objects.values(), around.values(), strict=False))
    if [*around] != [*scene.objects] or not all(_same_but(_OF_OBJECT, *pair) for pair in pairs):
        return None
    if all(one.mass == other.mass for one, other in pairs) and before == after:
        return scene.with_objects(around, scene.body)
    return scene.with_masses(around, finger.rigid_body, after if finger.mechanism.moved else None)


def _same_wiring(first: FingerDescription, second: FingerDescription) -> bool:
    """Return whether two descriptions differ in parameters of laws and in the path of a palm alone."""
    if first is second:
        return True
    one, other = first.hand, second.hand
    same = _same_but(_LAWS, first, second) and first.tendon_friction.place == second.tendon_friction.place
    if not same or one is None or other is None:
        return same and one is other
    fingers = list(zip(one.fingers.values(), other.fingers.values(), strict=False))
    return (
        _same_but({"fingers", "palm"}, one, other)
        and _same_but(_OF_PALM, one.palm, other.palm)
        and [*one.fingers] == [*other.fingers]
        and all(_same_but({"finger"}, *pair) and _same_wiring(*(each.finger for each in pair)) for pair in fingers)
    )


def _same_but(changing: Collection[str], first: Any, second: Any) -> bool:
    """Return whether two descriptions of a kind have the same entries; of some only whether they have any."""
    return first is second or all(
        (one := getattr(first, key)) is (other := getattr(second, key))
        or (bool(one) == bool(other) if key in changing else one == other)
        for key in type(first).model_fields
    )
