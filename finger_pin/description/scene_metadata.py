"""The scenario within a result, for its pictures: the finger or hand, and the objects around it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from finger_pin.description.finger import FingerDescription, HandSettings
from finger_pin.description.objects import Object
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, validate
from finger_pin.exceptions import InputError


class Embedded(NamedTuple):
    """The subject of a result.

    Attributes:
        finger: The finger, or all fingers of a hand together.
        objects: Objects around it, by name.
    """

    finger: FingerDescription
    objects: Mapping[str, Object]


def scene_metadata(scenario: Scenario) -> dict[str, str]:
    """Return the attributes of a result of a scenario from which `read_scene` reads."""
    moved, around = scenario.hand or scenario.finger, scenario.environment
    kind = "hand" if isinstance(moved, HandSettings) else "finger"
    objects = {name: _plain(each) for name, each in (around.objects or {}).items()}
    return {kind: json.dumps(_plain(moved)), "objects": json.dumps(objects)}


def read_scene(attributes: Mapping[Any, Any]) -> Embedded:
    """Return the subject of a result, given its attributes.

    Raises:
        InputError: If they do not say.
    """
    for kind in ("finger", "hand"):
        if kind in attributes:
            return _read(kind, str(attributes[kind]), str(attributes.get("objects", "{}")))
    raise InputError("result.attrs.finger", "is missing; give a result of simulate or saved, in this version")


# What reads a result asks for it more than once.
@lru_cache(maxsize=4)
def _read(kind: str, text: str, objects: str) -> Embedded:
    entry = f"result.attrs.{kind}"
    try:
        table, around = json.loads(text), json.loads(objects)
    except ValueError as error:
        raise InputError(entry, "must be a description in JSON") from error
    bodies = {name: validate(Object, each, ("result.attrs.objects", name)) for name, each in around.items()}
    if kind == "hand":
        return Embedded(validate(HandSettings, table, (entry,)).joined(), bodies)
    return Embedded(validate(FingerDescription, table, (entry,)), bodies)


def _plain(description: Description) -> Any:
    return description.model_dump(mode="python", exclude_none=True)
