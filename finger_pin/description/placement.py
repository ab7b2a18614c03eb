"""A finger in its place on a palm: rotated, to scale, its tables joined with those of the other fingers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, reduce
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.spatial.transform import Rotation

from finger_pin.description.actuators import Actuator
from finger_pin.description.caching import memoised
from finger_pin.description.friction import JointFrictionSettings
from finger_pin.description.parameters import Joint, Link, Tendon, per_item
from finger_pin.description.signals import Samples, SignalSettings, signal_field
from finger_pin.description.tables import series
from finger_pin.description.validation import (
    MILLIMETRES,
    Description,
    Name,
    problem,
    quantity,
    real,
    suggestion,
    vector,
)
from finger_pin.exceptions import InputError
from finger_pin.typing import Array

#: A place on the palm.
PALM_POINT = vector(3, -2.0, 2.0, MILLIMETRES)
#: The coordinates of a palm's path: place, m, and roll, pitch and yaw, rad, in the world.
PATH = ("x", "y", "z", "roll", "pitch", "yaw")
_COORDINATE = real(-12.5, 12.5)

_Finger = TypeVar("_Finger", bound=Description)


@lru_cache
def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation of fixed angles, about x, then y, then z, shape (3, 3)."""
    (a, b, c), (d, e, f) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about = ([[1, 0, 0], [0, a, -d], [0, d, a]], [[b, 0, e], [0, 1, 0], [-e, 0, b]], [[c, -f, 0], [f, c, 0], [0, 0, 1]])
    turned: Array = reduce(lambda first, then: np.array(then) @ first, about, np.eye(3))
    return turned


@lru_cache
def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the rotation of fixed angles as a unit quaternion x, y, z, w."""
    x, y, z, w = Rotation.from_matrix(rotation(roll, pitch, yaw)).as_quat().tolist()
    return x, y, z, w


# Joints or tendons of hands whose copies are remembered.
_MOST_PARTS = 256
# Powers of the scale that a link's numbers go with.
_POWERS = {"length": 1, "offset": 1, "width": 1, "centre_of_mass": 1, "mass": 3}
_POWERS |= {"transverse_inertia": 5, "axial_inertia": 5}


def _scaled_link(link: Link, scale: float) -> Link:
    return link.model_copy(update={key: getattr(link, key) * scale**power for key, power in _POWERS.items()})


# The same parts whenever their numbers are the same: routing, bodies and paths are found again by their parts.
@memoised(lambda tendon, scale: (tendon, scale), most=_MOST_PARTS)
def _scaled_tendon(tendon: Tendon, scale: float) -> Tendon:
    crossings = {
        joint: crossing.updated(radius=crossing.radius * scale) for joint, crossing in tendon.crossings.items()
    }
    return tendon.updated(crossings=crossings)


@memoised(lambda joint, scale: (joint, scale), most=_MOST_PARTS)
def _scaled_joint(joint: Joint, scale: float) -> Joint:
    return joint.updated(link=joint.link and _scaled_link(joint.link, scale))


@memoised(lambda friction, joints, scale: (friction, joints, scale))
def _scaled_friction(friction: JointFrictionSettings, joints: int, scale: float) -> JointFrictionSettings:
    numbers = per_item(friction, joints)
    return friction.updated(**{key: tuple((scale * numbers[key]).tolist()) for key in ("coulomb", "stiction")})


def scaled(finger: _Finger, scale: float) -> _Finger:
    """Return a finger of the same shape and material in another size.

    Lengths and radii go with the scale, masses with its third power and moments of inertia with its fifth; so do the
    friction coefficients of joints, which are lengths (coefficient times pin radius). Springs, tendons, actuators and
    limiters stay as they are.
    """
    if scale == 1.0:
        return finger
    tables: Any = finger
    joints = {name: _scaled_joint(joint, scale) for name, joint in tables.joints.items()}
    tendons = {name: _scaled_tendon(tendon, scale) for name, tendon in tables.tendons.items()}
    friction = _scaled_friction(tables.joint_friction, len(joints), scale)
    return finger.updated(joints=joints, tendons=tendons, joint_friction=friction)


@memoised(lambda name, placed, gravity: (name, placed, gravity))
def placed_finger(name: str, placed: Any, gravity: tuple[float, float, float]) -> Any:
    """Return a finger as it is on a hand: to scale, with gravity in its own base frame."""
    gravity_of_finger = placed.rotation.T @ np.array(gravity)
    finger = scaled(placed.finger, placed.scale)
    return finger.updated(name=name, gravity=tuple(gravity_of_finger.tolist()))


def joined_entries(hand: Any, parts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of all fingers of a hand as one; the actuated tendons of all precede the passive ones."""
    tendons, actuators, joints = (
        {f"{name}.{own}": each for name, part in parts.items() for own, each in getattr(part, group).items()}
        for group in ("tendons", "actuators", "joints")
    )
    return {
        "name": hand.name,
        "title": hand.title,
        "gravity": hand.gravity,
        "joints": joints,
        "tendons": {
            name: _tendon_of_hand(name.split(".")[0], tendon)
            for name, tendon in sorted(tendons.items(), key=lambda item: item[1].kind)
        },
        **{
            group: _joined_table(
                group,
                tuple(getattr(part, group) for part in parts.values()),
                tuple(_kinds(part, group) for part in parts.values()),
            )
            for group in ("tendon_friction", "joint_friction", "passive_tendon", "stroke_limiter")
        },
        "actuators": {name: _actuator_of_hand(name.split(".")[0], actuator) for name, actuator in actuators.items()},
        "touches_itself": any(part.touches_itself for part in parts.values()),
    }


@memoised(lambda finger, tendon: (finger, tendon), most=_MOST_PARTS)
def _tendon_of_hand(finger: str, tendon: Tendon) -> Tendon:
    """Return a tendon whose crossings are of the joints of a hand."""
    return tendon.updated(crossings={f"{finger}.{name}": each for name, each in tendon.crossings.items()})


def _actuator_of_hand(finger: str, actuator: Actuator) -> Actuator:
    """Return an actuator whose tendons are those of a hand."""
    return actuator.updated(tendons=tuple(f"{finger}.{tendon}" for tendon in actuator.tendons))


def _kinds(part: Any, group: str) -> tuple[str, ...]:
    """Return the kinds by which the numbers of a table are ordered: actuated tendons of all before passive ones."""
    if group == "tendon_friction":
        return tuple(tendon.kind for tendon in part.tendons.values())
    return ("",) * len(part.passive_names if group == "passive_tendon" else part.joints)


@memoised(lambda group, tables, kinds: (group, *tables, kinds), most=_MOST_PARTS)
def _joined_table(group: str, tables: tuple[Description, ...], kinds: tuple[tuple[str, ...], ...]) -> Description:
    """Return one table for all fingers, with lists of numbers in the order of the hand."""
    of_all = [kind for of_table in kinds for kind in of_table]
    order = sorted(range(len(of_all)), key=of_all.__getitem__)
    joined: dict[str, Any] = {}
    for entry in type(tables[0]).model_fields:
        values = [getattr(table, entry) for table in tables]
        if entry in ("law", "place"):
            if len({*values}) > 1:
                listed = ", ".join(dict.fromkeys(values))
                raise InputError("hand.fingers", f"must have one {group}.{entry}, not {listed}")
            joined[entry] = values[0]
            continue
        numbers = [
            number
            for value, own in zip(values, kinds, strict=True)
            for number in (value if isinstance(value, tuple) else [None if value is None else float(value)] * len(own))
        ]
        joined[entry] = tuple([numbers[place] for place in order])
    return tables[0].model_construct(**joined)


class PathSignal(SignalSettings):
    """A coordinate of the palm over time: m for x, y, z, rad for roll, pitch, yaw."""

    offset: Annotated[float, _COORDINATE] = signal_field("offset", "m or rad")
    amplitude: Annotated[float, _COORDINATE] = signal_field("amplitude", "m or rad")
    height: Annotated[float, _COORDINATE] | None = signal_field(
        "height", "m or rad", "Of steps and ramps, which are refused here."
    )
    values: Annotated[Samples, series(-12.5, 12.5)] | None = signal_field("values", "m or rad")

    @model_validator(mode="after")
    def _accelerates(self) -> Self:
        if self.kind in ("step", "ramp"):
            raise problem("kind", "must be one of sine, points, samples: a palm has an acceleration", self.kind)
        return self


_AT_REST = PathSignal()


class Palm(Description):
    """The palm, on which fingers stand: the base frame of the hand, at rest or moved along a path."""

    size: Annotated[tuple[float, float, float], vector(3, 0.0, 2.0, MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Sides of the box that is drawn; zero for none."
    )
    centre: Annotated[tuple[float, float, float], PALM_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the box, in the palm's frame."
    )
    path: dict[Name, PathSignal] | None = Field(
        None, description="Where the palm is in the world over time, by x, y, z, roll, pitch and yaw; at rest without."
    )

    @field_validator("path")
    @classmethod
    def _coordinates(cls, value: dict[str, PathSignal] | None) -> dict[str, PathSignal] | None:
        for name in value or {}:
            if name not in PATH:
                hint = suggestion(name, PATH)
                raise problem(name, f"no such coordinate; there are {', '.join(PATH)}{hint}")
        return value

    def on_path(self, name: str) -> PathSignal:
        """Return a coordinate of the path, by default zero."""
        return (self.path or {}).get(name, _AT_REST)
