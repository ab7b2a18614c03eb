"""A finger with other parameters on the same wiring: what no parameter touches is not built again."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.objects import Object
from finger_pin.mechanism.object_scene import Scene
from finger_pin.mechanism.rows import Rows

# Entries of an object and of a palm that change masses and motions alone.
_OF_OBJECT, _OF_PALM = {"mass", "path"}, {"path"}


def with_changed_parameters(
    finger: Any, description: FingerDescription, objects: Mapping[str, Object] | None
) -> Any | None:
    """Return the `Finger` of another description and other objects, on the same wiring.

    It is None if more differs than numbers of rows that have a `Source`, masses of objects, and paths of these and of
    the palm.
    """
    args, old = finger.constructor_args, finger.description
    own = {name: part for name, part in vars(finger).items() if hasattr(part, "ENTRY")}
    parts = {name: replace(part, description=description) for name, part in own.items()}
    entries = {part.ENTRY for part in parts.values()}
    if args.tables or (objects is None) != (args.objects is None) or not _same_wiring(entries, old, description):
        return None
    scene, law = _scene(finger, description, objects), parts["joint_friction"].law
    # Names of custom laws may stand for other ones by now.
    if (scene is None) != (finger.scene is None) or all(each.law is not law for each in finger.mechanism.rows):
        return None
    twin = copy.copy(finger)
    # Signals stay, which copies leave out.
    twin.__dict__ |= vars(finger) | parts
    twin.description, twin.constructor_args, twin.scene = description, args._replace(objects=objects), scene
    stale = {name for name, part in parts.items() if getattr(old, part.ENTRY) is not getattr(description, part.ENTRY)}
    before, twin.mechanism = finger.mechanism, copy.copy(finger.mechanism)
    # Some stand among both, with more coordinates where there are objects, and share their source.
    sources = {each.source for each in (*before.listed, *finger.extra_rows) if each.source}
    numbers = {each: each.numbers(parts[each.part]) for each in sources if each.part in stale}

    def changed(tables: Sequence[Rows]) -> tuple[Rows, ...]:
        return tuple([each.with_parameters(numbers.get(each.source)) for each in tables])

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


def _same_wiring(entries: Collection[str], first: FingerDescription, second: FingerDescription) -> bool:
    """Return whether two descriptions differ in numbers of some entries and in the path of a palm alone."""
    if first is second:
        return True
    one, other = first.hand, second.hand
    same = _same_but(entries, first, second) and _choices(entries, first) == _choices(entries, second)
    if not same or one is None or other is None:
        return same and one is other
    pairs = list(zip(one.fingers.values(), other.fingers.values(), strict=False))
    return (
        _same_but({"fingers", "palm"}, one, other)
        and _same_but(_OF_PALM, one.palm, other.palm)
        and [*one.fingers] == [*other.fingers]
        and all(_same_but({"finger"}, *pair) for pair in pairs)
        and all(_same_wiring(entries, first.finger, second.finger) for first, second in pairs)
    )


def _choices(entries: Collection[str], description: FingerDescription) -> list[str]:
    """Return what entries choose by words, such as where tendons rub."""
    return [word for key in entries for _, word in getattr(description, key) or () if isinstance(word, str)]


def _same_but(changing: Collection[str], first: Any, second: Any) -> bool:
    """Return whether two descriptions of a kind have the same entries; of some only whether they have any."""
    return first is second or all(
        (one := getattr(first, key)) is (other := getattr(second, key))
        or (bool(one) == bool(other) if key in changing else one == other)
        for key in type(first).model_fields
    )
