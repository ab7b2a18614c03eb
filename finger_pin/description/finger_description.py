"""A finger as data, and a hand: several on a palm.

Every description is frozen and validated; nothing here computes physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, field_validator, model_serializer, model_validator

from finger_pin.description.actuators import Actuator, check_actuators
from finger_pin.description.caching import cached_property, memoised
from finger_pin.description.cords import Cord, DriveCord, check_tendons, drive_cords
from finger_pin.description.effects import OF_FINGER, OF_HAND, refuse_idle
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.links import placed_on_palm, tree_of_links
from finger_pin.description.parameters import Joint, PassiveTendon, PerItem, StrokeLimiterSettings, Tendon, per_item
from finger_pin.description.placement import PALM_POINT, Palm, joined_entries, placed_finger, quaternion, rotation
from finger_pin.description.tree import NO_TREE, Tree
from finger_pin.description.tree_couplings import Coupling, check_tendon_couplings
from finger_pin.description.validation import IN_RADIANS, Description, Name, check_size, problem, quantity, real, vector
from finger_pin.typing import Array


class FingerDescription(Description):
    """A finger of links, all fingers of a hand together, or a tree of bodies. Actuated tendons come first.

    Lists of numbers follow the order of the joints, of all tendons, or of the passive tendons.
    """

    file_keys = ("base",)

    def __repr__(self) -> str:
        """Return its name and size in a line; `to_toml` writes all of it."""
        return f"<{type(self).__name__} {self.name}: {len(self.joints)} joints, {len(self.tendons)} tendons>"

    __str__ = __repr__

    name: Name = Field(description="Name of the finger, and of the robot in the URDF.")
    title: str = Field("", strict=True, max_length=200, description="One line for listings.")
    gravity: Annotated[tuple[float, float, float], vector(3, -1e3, 1e3)] = quantity(
        (0.0, 0.0, -9.81), unit="m/s2", source="flexion lifts the finger", doc="Base frame; in a hand `hand.gravity`."
    )
    joints: dict[Name, Joint] = Field(min_length=1, description="Joints by name, from the base to the tip.")
    tendons: dict[Name, Tendon] = Field(description="Tendons by name; at least one, unless there is a tree.")
    tendon_friction: TendonFrictionSettings = TendonFrictionSettings()
    joint_friction: JointFrictionSettings = JointFrictionSettings()
    passive_tendon: PassiveTendon = PassiveTendon()
    stroke_limiter: StrokeLimiterSettings = StrokeLimiterSettings()
    actuators: dict[Name, Actuator] = Field({}, description="By name; a tendon without one has an ideal source.")
    couplings: dict[Name, Coupling] = Field({}, description="By name, of actuated tendons.")
    touches_itself: bool = Field(
        False,
        strict=True,
        description="Whether links that are not neighbours touch each other, where there are contacts.",
    )
    _hand: HandSettings | None = PrivateAttr(None)
    tree: Tree = Field(NO_TREE, description="Bodies in place of links, with joints, tendons and actuators.")

    @model_serializer(mode="wrap")
    def _written(self, write: Callable[[Self], dict[str, Any]]) -> dict[str, Any]:
        return {key: value for key, value in write(self).items() if key != "tree" or self.tree.bodies}

    @field_validator("tendons")
    @classmethod
    def _actuated_first(cls, value: dict[str, Tendon]) -> dict[str, Tendon]:
        return dict(sorted(value.items(), key=lambda item: item[1].kind))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        joints = tuple(self.joints)
        if not self.tendons and not self.tree.bodies:
            raise problem("tendons", "must have at least one entry")
        if self.tree.bodies and tuple(self.tree.joints) != joints:
            raise problem("tree.joints", f"must be those of the finger, in order: {', '.join(joints)}")
        check_tendons(self.tendons, joints, tuple(self.tree.tendons))
        driven = (*self.actuated_names, *self.tree.actuators)
        for key, keyframe in self.tree.keyframes.items():
            for name in keyframe.inputs:
                if name not in driven:
                    allowed = f"no such actuator or tendon; there are {', '.join(driven)}"
                    raise problem(f"tree.keyframes.{key}.inputs.{name}", allowed)
        check_actuators(self.actuators, self.actuated_names, self.passive_names)
        check_tendon_couplings(self.couplings, self.actuated_names)
        for key, actuator in self.actuators.items():
            for name in actuator.tendons:
                for entry in ("maximum_tension", "winch"):
                    if (value := getattr(self.tendons[name], entry)) is not None:
                        allowed = f"is for tendons without a motor: actuators.{key} pulls it"
                        raise problem(f"tendons.{name}.{entry}", allowed, value if isinstance(value, float) else None)
        _ = self.numbers
        refuse_idle(self, OF_FINGER)
        return self

    @cached_property
    def numbers(self) -> Mapping[str, Mapping[str, Array]]:
        """Numbers of friction, passive tendons and stops as arrays of one per item, by table and entry.

        Lists of another length than their joints or tendons are refused.
        """
        numbers = PerItem()
        for group, names, kind in (
            ("tendon_friction", (*self.tendons, *self.canals), "tendon"),
            ("joint_friction", tuple(self.joints), "joint"),
            ("passive_tendon", self.passive_names, "passive tendon"),
            ("stroke_limiter", tuple(self.joints), "joint"),
        ):
            for field, value in vars(getattr(self, group)).items():
                if isinstance(value, tuple):
                    check_size(value, names, f"{group}.{field}", kind)
            numbers[group] = per_item(getattr(self, group), len(names))
        return numbers

    @cached_property
    def bodies(self) -> Tree:
        """The tree of bodies that it is made of, also where it is given by links.

        Raises:
            InputError: If a joint has neither a body nor a link, or the name of something else of a finger.
        """
        if self.tree.bodies:
            return self.tree
        return tree_of_links(self.joints, self.tendons) if self.hand is None else self.hand.bodies

    def cord(self, name: str) -> Cord:
        """Return one of its tendons as a cord, or else a tendon of its tree that something else pulls."""
        tendon = self.tendons.get(name)
        at_bends = self.tendon_friction.place == "bends" and (tendon is None or tendon.kind == "actuated")
        if tendon is None:
            return self.tree.cord(name, at_bends=at_bends)
        if tendon.along is not None:
            return self.tree.cord(tendon.along, curvature_offset=tendon.curvature_offset, at_bends=at_bends)
        return Cord.of_crossings(tendon, at_bends=at_bends)

    @cached_property
    def drive_cords(self) -> dict[str, DriveCord]:
        """The cords by which winches and spools of motors pull tendons, by tendon."""
        return drive_cords(self.tendons, self.actuators)

    @property
    def through_space(self) -> bool:
        """Whether any of its tendons runs along a path through space, so that its arms depend on the posture."""
        paths = {name for name, each in self.tree.tendons.items() if each.path is not None}
        return any(each.along in paths for each in self.tendons.values())

    @property
    def outline(self) -> str:
        """Name, joints and tendons, in a line."""
        if self.hand is not None:
            sizes = f"{len(self.joints)} joints, {len(self.tendons)} tendons"
            return f"{self.name}: fingers {', '.join(self.hand.fingers)}; {sizes}"
        if self.tree.bodies:
            sizes = f"{len(self.joints)} joints, {len(self.tree.tendons)} tendons ({len(self.tendons)} pulled)"
            return f"{self.name}: a tree of {sizes}, {len(self.tree.actuators)} actuators"
        tendons = ", ".join(f"{name} ({tendon.kind})" for name, tendon in self.tendons.items())
        return f"{self.name}: joints {', '.join(self.joints)}; tendons {tendons}"

    @property
    def hand(self) -> HandSettings | None:
        """The palm and its fingers, None for a finger alone."""
        return self._hand

    def entry(self, table: str, name: str) -> str:
        """Return the key of an entry of a table, as in ``finger.tree.joints.NAME``; in a hand that of its finger."""
        finger, _, own = name.partition(".")
        return f"finger.{table}.{name}" if self.hand is None else f"hand.fingers.{finger}.finger.{table}.{own}"

    @property
    def bearings(self) -> tuple[bool, ...]:
        """Whether each joint is a pin or a guide that rubs."""
        return tuple(name not in self.tree.joints or self.tree.joints[name].bearing for name in self.joints)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the joints that carry links; in place of links a tree has bodies."""
        return tuple(name for name in self.joints if name not in self.tree.joints)

    @property
    def canals(self) -> tuple[str, ...]:
        """Names of the tree's tendons that something else than ideal sources pulls: they rub as all tendons do."""
        return self.tree.rubbing

    @property
    def passive_names(self) -> tuple[str, ...]:
        """Names of the passive tendons."""
        return tuple(name for name, tendon in self.tendons.items() if tendon.kind == "passive")

    @property
    def actuated_names(self) -> tuple[str, ...]:
        """Names of the actuated tendons."""
        return tuple(name for name, tendon in self.tendons.items() if tendon.kind == "actuated")


class PlacedFinger(Description):
    """A finger and the place of its base frame on the palm."""

    finger: FingerDescription = Field(description="Name of one that ships, path of a file, or a table: links or tree.")
    position: Annotated[tuple[float, float, float], PALM_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of its base frame, in the palm's frame."
    )
    orientation: Annotated[tuple[float, float, float], vector(3, -2.0 * math.pi, 2.0 * math.pi, IN_RADIANS)] = quantity(
        (0.0, 0.0, 0.0), unit="rad", source="design", doc="Roll, pitch and yaw of its base frame, as in a URDF."
    )
    scale: Annotated[float, real(0.1, 10.0)] = quantity(
        1.0, unit="1", source="design", doc="All lengths times this, masses times its third power."
    )

    @model_validator(mode="after")
    def _fits_palm(self) -> Self:
        for name in self.finger.tree.objects:
            raise problem(f"finger.tree.objects.{name}", "is no part of a finger: put it into environment.objects")
        return self

    @property
    def rotation(self) -> Array:
        """Rotation from the finger's base frame to the palm's, shape (3, 3)."""
        return rotation(*self.orientation).copy()


class HandSettings(Description):
    """Palm with its fingers, the table ``[hand]``; `joined` describes all of them as one finger.

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
    couplings: dict[Name, Coupling] = Field({}, description="By name, of tendons FINGER.TENDON.")
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
            if (other := folded.setdefault(name.casefold(), name)) != name:
                raise problem(name, f"another finger is called {other}; names must differ in letters")
        return value

    @model_validator(mode="after")
    def _acting(self) -> Self:
        refuse_idle(self, OF_HAND)
        tendons = [f"{name}.{own}" for name, placed in self.fingers.items() for own in placed.finger.actuated_names]
        check_tendon_couplings(self.couplings, tendons)
        for name, placed in self.fingers.items() if self.palm.path else ():
            for joint in placed.finger.tree.on_paths:
                entry = f"fingers.{name}.finger.tree.joints.{joint}.path"
                raise problem(entry, "is for a palm at rest; leave out hand.palm.path")
        return self

    def built(self) -> dict[str, FingerDescription]:
        """Return the fingers as they are on the hand, by name: to scale, with gravity in their own base frames."""
        return {name: placed_finger(name, placed, self.gravity) for name, placed in self.fingers.items()}

    @cached_property
    def bodies(self) -> Tree:
        """Bodies of all fingers, and the palm's, as one tree in the palm's frame."""
        places = {name: (placed.position, quaternion(*placed.orientation)) for name, placed in self.fingers.items()}
        trees = {name: finger.bodies for name, finger in self.built().items()}
        return placed_on_palm(trees, places, self.palm.size, self.palm.centre)

    def joined(self) -> FingerDescription:
        """Return all fingers together: joints finger by finger; the actuated tendons of all, then the passive ones."""
        is_tree = any(placed.finger.tree.bodies for placed in self.fingers.values())
        together = self._put_together()
        joined = together.updated(couplings=together.couplings | self.couplings)
        if is_tree:
            joined = joined.updated(tree=self.bodies)
        else:
            # Nothing that was put on top has a share in them.
            vars(joined)["numbers"] = together.numbers
        joined._hand = self
        return joined

    # Of hands whose palms differ all else is the same.
    @memoised(lambda self: (self.name, self.title, self.gravity, *self.fingers, *self.fingers.values()))
    def _put_together(self) -> FingerDescription:
        return FingerDescription.model_construct(**joined_entries(self, self.built()))
