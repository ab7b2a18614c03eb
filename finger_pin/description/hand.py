"""A hand as data: fingers placed on a palm, each with a description of its own, and all of them as one finger.

Names of a hand's joints and tendons begin with that of their finger and a dot: ``index.medial``, ``thumb.T3``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache, partial, reduce
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator

from finger_pin.description.actuators import Actuator
from finger_pin.description.caching import Remembered
from finger_pin.description.effects import OF_HAND, refuse_idle
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.palm import PLACE, Palm
from finger_pin.description.parameters import (
    FingerDescription,
    Joint,
    Link,
    PassiveTendon,
    StrokeLimiterSettings,
    Tendon,
)
from finger_pin.description.routing import Array
from finger_pin.description.validation import (
    IN_RADIANS,
    Description,
    Name,
    Numbers,
    expand,
    problem,
    quantity,
    real,
    vector,
)
from finger_pin.exceptions import InputError

_BUILT: Remembered[FingerDescription] = Remembered()
_JOINED: Remembered[FingerDescription] = Remembered()
# Joints, links, tendons, actuators and tables of numbers of many fingers.
_TABLES: Remembered[Any] = Remembered(1024)
_Table = TypeVar("_Table", bound=Description)


class PlacedFinger(Description):
    """A finger and the place of its base frame on the palm."""

    finger: FingerDescription = Field(description="Name of one that ships, path of a .toml file, or a table.")

    @field_validator("finger")
    @classmethod
    def _made_of_links(cls, value: FingerDescription) -> FingerDescription:
        if value.tree is not None:
            raise problem("tree", "a tree of bodies cannot be placed on a palm; it is a hand of its own")
        return value

    position: Annotated[tuple[float, float, float], PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its base frame, in the palm's frame."
    )
    orientation: Annotated[tuple[float, float, float], vector(3, -2.0 * math.pi, 2.0 * math.pi, IN_RADIANS)] = quantity(
        (0.0, 0.0, 0.0), unit="rad", source="design", doc="Roll, pitch and yaw of its base frame, as in a URDF."
    )
    scale: Annotated[float, real(0.1, 10.0)] = quantity(
        1.0, unit="1", source="design", doc="All lengths times this, masses times its third power."
    )

    @property
    def rotation(self) -> Array:
        """From the finger's base frame to the palm's, shape (3, 3)."""
        return rotation(*self.orientation).copy()


class HandSettings(Description):
    """A palm and the fingers on it, the table ``[hand]``. `joined` describes them all together, as one finger.

    Its gravity, in the world's frame, replaces that of the fingers; a palm at rest has that frame.
    """

    file_keys = ("base",)

    def __repr__(self) -> str:
        """Return its name and fingers in a line; `to_toml` writes all of it."""
        return f"<{type(self).__name__} {self.name}: fingers {', '.join(self.fingers)}>"

    __str__ = __repr__

    name: Name = Field("hand", description="Name of the hand.")
    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    gravity: Annotated[tuple[float, float, float], vector(3, -1e3, 1e3)] = quantity(
        (0.0, 0.0, -9.81), unit="m/s2", source="palm down", doc="In the world's frame."
    )
    palm: Palm = Palm()
    fingers: dict[Name, PlacedFinger] = Field(min_length=1, description="Fingers by name.")
    fingers_touch: bool | None = Field(
        None,
        strict=True,
        description="Whether links of different fingers touch each other; by default where there are objects, too.",
    )

    @field_validator("fingers")
    @classmethod
    def _distinct(cls, value: dict[str, PlacedFinger]) -> dict[str, PlacedFinger]:
        folded: dict[str, str] = {}
        for name in value:
            if name.casefold() in folded:
                raise problem(name, f"another finger is called {folded[name.casefold()]}; names must differ in letters")
            folded[name.casefold()] = name
        return value

    @model_validator(mode="after")
    def _acting(self) -> Self:
        refuse_idle(self, OF_HAND)
        return self

    def parts(self) -> dict[str, HandSettings]:
        """Return hands of one finger each, by name."""
        return {name: self.updated(fingers={name: placed}, name=name) for name, placed in self.fingers.items()}

    def built(self) -> dict[str, FingerDescription]:
        """Return the fingers as they are on the hand, by name: to scale, with gravity in their own base frames."""
        return {
            name: _BUILT.of((name, placed, self.gravity), partial(self._built, name, placed))
            for name, placed in self.fingers.items()
        }

    def joined(self) -> FingerDescription:
        """Return all fingers together: joints finger by finger; the actuated tendons of all, then the passive ones."""
        return _JOINED.of((self,), self._joined)

    def _joined(self) -> FingerDescription:
        # Of hands whose palms differ all else is the same.
        fingers = (self.name, self.title, self.gravity, *self.fingers, *self.fingers.values())
        joined = _JOINED.of(fingers, self._put_together).model_copy()
        joined._hand = self
        return joined

    def _put_together(self) -> FingerDescription:
        parts = self.built()
        tendons, actuators = (
            {f"{name}.{own}": each for name, part in parts.items() for own, each in getattr(part, group).items()}
            for group in ("tendons", "actuators")
        )
        return FingerDescription.model_construct(
            name=self.name,
            title=self.title,
            gravity=self.gravity,
            joints={f"{name}.{own}": joint for name, part in parts.items() for own, joint in part.joints.items()},
            tendons={
                name: _TABLES.of((name, tendon), partial(_of_hand, name.split(".")[0], tendon))
                for name, tendon in sorted(tendons.items(), key=lambda item: item[1].kind)
            },
            tendon_friction=_joined(parts, "tendon_friction", TendonFrictionSettings),
            joint_friction=_joined(parts, "joint_friction", JointFrictionSettings),
            passive_tendon=_joined(parts, "passive_tendon", PassiveTendon),
            stroke_limiter=_joined(parts, "stroke_limiter", StrokeLimiterSettings),
            actuators={
                name: _TABLES.of((name, actuator), partial(_pulling, name.split(".")[0], actuator))
                for name, actuator in actuators.items()
            },
            touches_itself=any(part.touches_itself for part in parts.values()),
        )

    def _built(self, name: str, placed: PlacedFinger) -> FingerDescription:
        own = placed.rotation.T @ np.array(self.gravity)
        finger = scaled(placed.finger, placed.scale)
        return finger.updated(name=name, gravity=tuple(own.tolist()))


def one_finger(description: FingerDescription) -> None:
    """Refuse to give a hand's fingers together for a single one.

    Raises:
        InputError: If it is a hand of several fingers.
    """
    hand = description.hand
    if hand is not None and len(hand.fingers) > 1:
        allowed = f"is a hand; take one of its fingers: scenario.parts()[NAME] with {', '.join(hand.fingers)}"
        raise InputError("finger", allowed, hand.name)


@lru_cache
def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation of fixed angles, about x, then y, then z, shape (3, 3)."""
    (a, b, c), (d, e, f) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about = ([[1, 0, 0], [0, a, -d], [0, d, a]], [[b, 0, e], [0, 1, 0], [-e, 0, b]], [[c, -f, 0], [f, c, 0], [0, 0, 1]])
    turned: Array = reduce(lambda first, then: np.array(then) @ first, about, np.eye(3))
    return turned


def scaled(finger: FingerDescription, scale: float) -> FingerDescription:
    """Return a finger of the same shape and material in another size.

    Lengths and radii go with the scale, masses with its third power and moments of inertia with its fifth; so do the
    friction coefficients of joints, which are lengths (coefficient times pin radius). Springs, tendons, actuators and
    limiters stay as they are.
    """
    if scale == 1.0:
        return finger
    powers = {"length": 1, "offset": 1, "width": 1, "centre_of_mass": 1, "mass": 3}
    powers |= {"transverse_inertia": 5, "axial_inertia": 5}

    def scaled_link(link: Link) -> Link:
        return link.model_copy(update={key: getattr(link, key) * scale**power for key, power in powers.items()})

    def scaled_tendon(tendon: Tendon) -> Tendon:
        crossings = {
            joint: crossing.updated(radius=crossing.radius * scale) for joint, crossing in tendon.crossings.items()
        }
        return tendon.updated(crossings=crossings)

    def scaled_joint(joint: Joint) -> Joint:
        link = joint.link and _TABLES.of((joint.link, scale), partial(scaled_link, joint.link))
        return joint.updated(link=link)

    joints = {name: _TABLES.of((joint, scale), partial(scaled_joint, joint)) for name, joint in finger.joints.items()}
    tendons = {
        name: _TABLES.of((tendon, scale), partial(scaled_tendon, tendon)) for name, tendon in finger.tendons.items()
    }
    friction = finger.joint_friction
    lengths = {
        key: tuple((scale * expand(getattr(friction, key), len(joints))).tolist()) for key in ("coulomb", "stiction")
    }
    update = {"joints": joints, "tendons": tendons, "joint_friction": friction.updated(**lengths)}
    return finger.updated(**update)


def _of_hand(finger: str, tendon: Tendon) -> Tendon:
    """Return a tendon whose crossings are of the joints of a hand."""
    return tendon.updated(crossings={f"{finger}.{name}": each for name, each in tendon.crossings.items()})


def _pulling(finger: str, actuator: Actuator) -> Actuator:
    """Return an actuator whose tendons are those of a hand."""
    return actuator.updated(tendons=tuple(f"{finger}.{tendon}" for tendon in actuator.tendons))


def _joined(parts: dict[str, FingerDescription], group: str, table: type[_Table]) -> _Table:
    """Return a table of all fingers, whose entries are lists of numbers in the order of the whole."""
    tables: list[_Table] = [getattr(part, group) for part in parts.values()]
    kinds = [_kinds(part, group) for part in parts.values()]
    found: _Table = _TABLES.of((*tables, *kinds), lambda: table.model_construct(**_lists(tables, kinds)))
    return found


def _kinds(part: FingerDescription, group: str) -> tuple[str, ...]:
    """Return the kinds by which the numbers of a table are ordered: actuated tendons of all before passive ones."""
    if group == "tendon_friction":
        return tuple(tendon.kind for tendon in part.tendons.values())
    return ("",) * len(part.passive_names if group == "passive_tendon" else part.joints)


def _lists(tables: Sequence[Description], kinds: Sequence[Sequence[str]]) -> dict[str, Any]:
    of_all = [kind for each in kinds for kind in each]
    order = sorted(range(len(of_all)), key=of_all.__getitem__)
    found = {}
    for entry in type(tables[0]).model_fields:
        pairs = zip(tables, kinds, strict=True)
        numbers = [number for table, own in pairs for number in _each(getattr(table, entry), len(own))]
        found[entry] = tuple([numbers[place] for place in order])
    return found


def _each(value: Numbers, size: int) -> Sequence[float]:
    return value if isinstance(value, tuple) else [float(value)] * size
