"""The signals of contacts and free objects, part of the table of a finger's signals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import attrgetter, methodcaller

import numpy as np

from finger_pin.mechanism.object_scene import POSE, VELOCITY, rotate
from finger_pin.mechanism.path_elements import SPIN
from finger_pin.mechanism.signals import FingerSignals, Quantity, Section
from finger_pin.typing import Array

_CONTACT, _CONTACT_VECTOR, _OBJECT = ("contact",), ("contact", "axis"), ("object", "axis")


def _contact_friction(signals: FingerSignals) -> Array:
    return np.asarray(np.hypot(signals.contact_force(1), signals.contact_force(2)))


def _split(block: str, size: int, part: slice) -> Callable[[FingerSignals], Array]:
    """Return the function for a part of each object's numbers in a block of the state."""

    def value(signals: FingerSignals) -> Array:
        values: Array = getattr(signals.state, block)
        return values.reshape(*values.shape[:-1], -1, size)[..., part]

    return value


_orientation = _split("object_pose", POSE, slice(3, None))
_own_rotation = _split("object_velocity", VELOCITY, slice(3, None))


def _bend(signals: FingerSignals) -> Array:
    bend, scene = signals.state.contact_bend, signals.finger.scene
    assert scene is not None
    return bend.reshape(*bend.shape[:-1], len(scene.contacts.names), scene.contacts.law.arms - 1)


# What follows from the state alone needs no evaluation.
_of_state = partial(Quantity, of_finger=False)
#: Signals of contacts and of free objects.
CONTACT_SECTIONS = (
    Section(
        "With objects, or links that touch each other",
        lambda finger: finger.scene,
        {
            "contact_gap": Quantity(
                _CONTACT,
                "m",
                "distance of the surfaces, negative where they penetrate; far apart, no more than it",
                methodcaller("of_contacts", "gap"),
            ),
            "contact_slip": Quantity(
                _CONTACT,
                "m/s",
                "speed of sliding",
                lambda signals: signals.of_contacts("sliding_speed") * (_contact_friction(signals) > 0.0),
            ),
            "contact_force": Quantity(
                _CONTACT_VECTOR, "N", "force on the second body of the pair", attrgetter("touching.force")
            ),
            "contact_normal_force": Quantity(_CONTACT, "N", "normal force", methodcaller("contact_force", 0)),
            "contact_friction": Quantity(_CONTACT, "N", "friction force", _contact_friction),
            "contact_level": Quantity(
                _CONTACT, "N", "most friction, mu times the normal force", methodcaller("of_contacts", "level")
            ),
            "contact_point": Quantity(
                _CONTACT_VECTOR,
                "m",
                "midway between the surfaces; zero where they are open",
                attrgetter("touching.point"),
            ),
            "contact_normal": Quantity(
                _CONTACT_VECTOR,
                "1",
                "normal of the second body, shorter deep in an edge; zero where they are open",
                attrgetter("touching.normal"),
            ),
            "contact_bend": Quantity(
                ("contact", "tangent"), "m", "bend of the bristles along the tangents, and by spinning", _bend
            ),
        },
    ),
    Section(
        "With torsional friction of contacts",
        lambda finger: finger.scene and finger.scene.contacts.law.arms > SPIN,
        {
            "contact_moment": Quantity(
                _CONTACT,
                "N m",
                "friction moment about the normal, on the second body of the pair",
                lambda signals: -signals.contact_force(SPIN),
            )
        },
    ),
    Section(
        "With free objects",
        lambda finger: finger.scene and finger.scene.free,
        {
            "object_position": _of_state(
                _OBJECT, "m", "position of a free object", _split("object_pose", POSE, slice(0, 3))
            ),
            "object_orientation": _of_state(
                ("object", "quaternion"), "1", "orientation of a free object, a unit quaternion", _orientation
            ),
            "object_velocity": _of_state(
                _OBJECT, "m/s", "velocity of a free object", _split("object_velocity", VELOCITY, slice(0, 3))
            ),
            "object_angular_velocity": _of_state(
                _OBJECT,
                "rad/s",
                "angular velocity of a free object",
                lambda signals: rotate(_orientation(signals), _own_rotation(signals)),
            ),
        },
    ),
)
