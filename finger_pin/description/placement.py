"""A finger in its place on a palm: rotated, to scale, its tables joined with those of the other fingers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, reduce
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.spatial.transform import Rotation

from finger_pin.description.actuators import Actuator
from finger_pin.description.caching import memoised
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.parameters import Joint, Link, PassiveTendon, StrokeLimiterSettings, Tendon
from finger_pin.description.signals import SignalSettings
from finger_pin.description.tables import Series, series
from finger_pin.description.validation import (
    MILLIMETRES,
    Description,
    Name,
    Numbers,
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
    friction = tables.joint_friction
    lengths = {key: tuple((scale * tables.numbers["joint_friction"][key]).tolist()) for key in ("coulomb", "stiction")}
    update = {"joints": joints, "tendons": tendons, "joint_friction": friction.updated(**lengths)}
    return finger.updated(**update)


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
        "tendon_friction": _joined_table(parts, "tendon_friction", TendonFrictionSettings),
        "joint_friction": _joined_table(parts, "joint_friction", JointFrictionSettings),
        "passive_tendon": _joined_table(parts, "passive_tendon", PassiveTendon),
        "stroke_limiter": _joined_table(parts, "stroke_limiter", StrokeLimiterSettings),
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


def _joined_table(parts: Mapping[str, Any], group: str, table: type[Description]) -> Description:
    """Return one table for all fingers, with lists of numbers in the order of the hand."""
    tables = [getattr(part, group) for part in parts.values()]
    return table.model_construct(**_joined_lists(tables, [_kinds(part, group) for part in parts.values()]))


def _kinds(part: Any, group: str) -> tuple[str, ...]:
    """Return the kinds by which the numbers of a table are ordered: actuated tendons of all before passive ones."""
    if group == "tendon_friction":
        return tuple(tendon.kind for tendon in part.tendons.values())
    return ("",) * len(part.passive_names if group == "passive_tendon" else part.joints)


def _joined_lists(tables: Sequence[Description], kinds: Sequence[Sequence[str]]) -> dict[str, Any]:
    of_all = [kind for of_table in kinds for kind in of_table]
    order = sorted(range(len(of_all)), key=of_all.__getitem__)
    lists: dict[str, Any] = {}
    for entry in type(tables[0]).model_fields:
        if entry in ("law", "place"):
            group = "joint_friction" if entry == "law" else "tendon_friction"
            lists[entry] = _common_value(f"{group}.{entry}", [getattr(table, entry) for table in tables])
            continue
        pairs = zip(tables, kinds, strict=True)
        numbers = [
            number for table, kinds_of_table in pairs for number in _numbers(getattr(table, entry), len(kinds_of_table))
        ]
        lists[entry] = tuple([numbers[place] for place in order])
    return lists


def _common_value(key: str, values: Sequence[str]) -> str:
    """Return the value of all fingers."""
    if len({*values}) > 1:
        raise InputError("hand.fingers", f"must have one {key}, not {', '.join(dict.fromkeys(values))}")
    return values[0]


def _numbers(value: Numbers | None, size: int) -> Sequence[float | None]:
    return value if isinstance(value, tuple) else [None if value is None else float(value)] * size


class PathSignal(SignalSettings):
    """A coordinate of the palm over time: m for x, y, z, rad for roll, pitch, yaw."""

    offset: Annotated[float, _COORDINATE] = quantity(
        0.0, unit="m or rad", source="chosen", doc="Added to all of it; the mean of a sinusoid."
    )
    amplitude: Annotated[float, _COORDINATE] = quantity(
        0.0, unit="m or rad", source="chosen", doc="Amplitude of the sinusoid, half its swing."
    )
    height: Annotated[float, _COORDINATE] | None = quantity(
        None, unit="m or rad", source="chosen", doc="Of steps and ramps, which are refused here."
    )
    values: Annotated[tuple[float, ...] | Series, series(-12.5, 12.5)] | None = quantity(
        None, unit="m or rad", source="chosen", doc="At the points or samples."
    )

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
