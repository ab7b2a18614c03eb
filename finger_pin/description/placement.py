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
from finger_pin.description.fields import unit_of
from finger_pin.description.meshes import Mesh
from finger_pin.description.parameters import Tendon, per_item
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


# Parts of fingers whose copies are remembered.
_MOST_PARTS = 256
# Powers of the scale that numbers go with, by their unit.
_POWERS = {"m": 1, "m/rad": 1, "kg": 3, "kg m2": 5}


@lru_cache
def _sized_entries(model: type[Description]) -> dict[str, int]:
    """Return the powers of the entries of a description that have a size, and 0 of those that may have one inside."""
    units = {key: unit_of(field) for key, field in model.model_fields.items()}
    return {key: _POWERS.get(unit, 0) for key, unit in units.items() if unit in _POWERS or not unit}


def _resized(value: Any, scale: float, power: int = 0) -> Any:
    """Return a value in another size: a number by a power of the scale, and what is in it by its units."""
    if isinstance(value, float):
        return value * scale**power
    if isinstance(value, Mesh):
        points, faces = value.unpacked()
        return value.updated(**Mesh.packed(scale * points, faces.astype(np.int32)))
    if isinstance(value, Description):
        powers = _sized_entries(type(value)).items()
        return value.updated(**{key: _resized(getattr(value, key), scale, power) for key, power in powers})
    if isinstance(value, dict):
        return {key: _resized(each, scale, power) for key, each in value.items()}
    return tuple([each * scale**power for each in value]) if power and value else value


# The same parts whenever their numbers are the same: routing, bodies and paths are found again by their parts.
@memoised(lambda part, scale: (part, scale), most=_MOST_PARTS)
def _scaled(part: Any, scale: float) -> Any:
    return _resized(part, scale)


@memoised(lambda tree, scale: (tree, scale))
def _scaled_tree(tree: Any, scale: float) -> Any:
    """Return a tree in another size, whose positions of joints that slide are lengths."""
    scaled, grown = _resized(tree, scale), {}
    for name, described in tree.joints.items():
        grown[name] = scale if described.kind == "slide" else 1.0

    def positions(values: Mapping[str, float]) -> dict[str, float]:
        return {name: grown[name] * value for name, value in values.items()}

    def joint(name: str, each: Any) -> Any:
        size, sizes = grown[name], ("offset", "amplitude", "height", "values")
        path = each.path and each.path.updated(**{key: _resized(getattr(each.path, key), size, 1) for key in sizes})
        return each.updated(reference=size * each.reference, armature=each.armature / size**2, path=path)

    def coupling(each: Any) -> Any:
        # Tendons are as long as the tree is large.
        of_joint, of_other = (scale, scale) if each.tendon else (grown[each.joint], grown.get(each.other, 1.0))
        powers = tuple(value * of_joint / of_other**power for power, value in enumerate(each.higher, 2))
        rolling = each.rolling and (each.rolling[0] * of_other, each.rolling[1] * of_joint)
        linear = {"ratio": each.ratio * of_joint / of_other, "offset": each.offset * of_joint}
        return each.updated(powers=powers, rolling=rolling, **linear)

    return scaled.updated(
        joints={name: joint(name, each) for name, each in scaled.joints.items()},
        tendons={
            name: each.updated(joints=each.joints and {key: gain / grown[key] for key, gain in each.joints.items()})
            for name, each in scaled.tendons.items()
        },
        couplings={name: coupling(each) for name, each in scaled.couplings.items()},
        keyframes={
            name: each.updated(position=positions(each.position), velocity=positions(each.velocity))
            for name, each in tree.keyframes.items()
        },
        # The length of a muscle about a hinge is an angle.
        actuators={
            name: tree.actuators[name] if each.units(tree.joints)[0] == "rad" else each
            for name, each in scaled.actuators.items()
        },
    )


def scaled(finger: _Finger, scale: float) -> _Finger:
    """Return a finger of the same shape and material in another size.

    Lengths and radii go with the scale, masses with its third power and moments of inertia with its fifth; so do the
    friction coefficients of joints, which are lengths (coefficient times pin radius). Springs, tendons, actuators and
    limiters stay as they are, but for lengths of a tree's tendons. Positions and ranges of joints that slide are
    lengths, and their friction coefficients are none.
    """
    if scale == 1.0:
        return finger
    tables: Any = finger
    tree, joints = tables.tree, {name: _scaled(joint, scale) for name, joint in tables.joints.items()}
    tendons = {name: _scaled(tendon, scale) for name, tendon in tables.tendons.items()}
    friction, passive = _scaled(tables.joint_friction, scale), tables.passive_tendon
    passive = passive.updated(slack=_resized(passive.slack, scale, 1))
    couplings = {name: each.updated(offset=scale * each.offset) for name, each in tables.couplings.items()}
    if not tree.bodies:
        grown = {"joint_friction": friction, "passive_tendon": passive, "couplings": couplings}
        return finger.updated(joints=joints, tendons=tendons, **grown)
    for name in (slides := [name for name, joint in tree.joints.items() if joint.kind == "slide"]):
        spring = joints[name].spring
        joints[name] = joints[name].updated(
            range=tuple(scale * end for end in joints[name].range),
            spring=spring and spring.updated(rest=scale * spring.rest),
        )
    if slides:
        numbers, is_slide = per_item(tables.joint_friction, len(joints)), [name in slides for name in joints]
        lengths = {key: np.where(is_slide, 1.0, scale) * numbers[key] for key in ("coulomb", "stiction")}
        friction = friction.updated(**{key: tuple(each.tolist()) for key, each in lengths.items()})
    tree = _scaled_tree(tree, scale)
    grown = {"joint_friction": friction, "passive_tendon": passive, "couplings": couplings}
    return finger.updated(joints=joints, tendons=tendons, tree=tree, **grown)


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
        "couplings": {
            f"{name}.{own}": each.updated(tendon=f"{name}.{each.tendon}", other=each.other and f"{name}.{each.other}")
            for name, part in parts.items()
            for own, each in part.couplings.items()
        },
        "touches_itself": any(part.touches_itself for part in parts.values()),
    }


@memoised(lambda finger, tendon: (finger, tendon), most=_MOST_PARTS)
def _tendon_of_hand(finger: str, tendon: Tendon) -> Tendon:
    """Return a tendon whose joints, or the tendon of a tree that it takes the path of, are those of a hand."""
    crossings = {f"{finger}.{name}": each for name, each in tendon.crossings.items()}
    return tendon.updated(crossings=crossings, along=tendon.along and f"{finger}.{tendon.along}")


def _actuator_of_hand(finger: str, actuator: Actuator) -> Actuator:
    """Return an actuator whose tendons are those of a hand."""
    return actuator.updated(tendons=tuple(f"{finger}.{tendon}" for tendon in actuator.tendons))


def _kinds(part: Any, group: str) -> tuple[str, ...]:
    """Return the kinds that order the numbers of a table: actuated tendons of all, passive ones, cords of trees."""
    if group == "tendon_friction":
        return (*(tendon.kind for tendon in part.tendons.values()), *["tree"] * len(part.canals))
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
