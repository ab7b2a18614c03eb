"""Cords as sequences of elements: arms of constant length on joints, and legs of paths through space."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from finger_pin.description.parameters import Tendon
from finger_pin.description.validation import problem


class CordElement(NamedTuple):
    """An element of a cord: an arm on a joint, or a leg between two points of a path.

    Attributes:
        name: Of the arm's joint; of a leg its number along its part, from 1.
        crossed: The joints that it crosses.
        moves: Whether these joints change the cord's length.
        bends: Whether the cord may bend there, and rub.
        radius: Arm about the joint, m, positive where tension turns it positively; None of a leg, whose arms depend on
            the posture.
        turn: Turn of the cord over the joint's rotation (15); of a leg its path shows it.
        curvature_offset: Curvature at theta = 0 that does not show, rad.
    """

    name: str
    crossed: frozenset[str]
    moves: bool
    bends: bool
    radius: float | None = None
    turn: float = 0.0
    curvature_offset: float = 0.0

    @classmethod
    def on_joint(cls, joint: str, radius: float, turn: float, offset: float = 0.0, *, bends: bool) -> CordElement:
        """Return an arm on a joint."""
        return cls(joint, frozenset({joint}), radius != 0.0, bends, radius, turn, offset)


class CordPart(NamedTuple):
    """The part of a cord before its first pulley, or between that pulley and the next.

    Attributes:
        divisor: Of the tension: 1 before the first pulley.
        elements: From the source, or the proximal anchor, on.
    """

    divisor: float
    elements: tuple[CordElement, ...]

    @property
    def crossed(self) -> frozenset[str]:
        """The joints that the cord crosses."""
        return frozenset[str]().union(*(element.crossed for element in self.elements))

    def sliding(self) -> tuple[CordElement, ...]:
        """Return the elements up to the last one that changes its length: what is beyond never slides."""
        last = max((number for number, element in enumerate(self.elements, 1) if element.moves), default=None)
        return self.elements[:last]


class Cord(NamedTuple):
    """A tendon as a cord.

    Attributes:
        parts: The first from its source to its first pulley, then one for every pulley.
        curvature_offset: Of its first part, beside that of the elements, rad.
        through_space: Whether it has legs, so that its arms depend on the posture.
    """

    parts: tuple[CordPart, ...]
    curvature_offset: float
    through_space: bool

    @classmethod
    def of_crossings(cls, tendon: Tendon) -> Cord:
        """Return a tendon that crosses joints: an arm on each."""
        arms = (
            CordElement.on_joint(
                joint, each.radius, each.bends, each.curvature_offset, bends=bool(each.bends or each.curvature_offset)
            )
            for joint, each in tendon.crossings.items()
        )
        return cls((CordPart(1.0, tuple(arms)),), tendon.curvature_offset, through_space=False)

    @property
    def elements(self) -> tuple[CordElement, ...]:
        """Elements before its first pulley."""
        return self.parts[0].elements

    def shares(self, joints: Sequence[str], first: int = 0, last: int | None = None) -> Iterator[float]:
        """Yield for every joint the share of the tension that loads its pin (17): of each part over its divisor.

        Args:
            joints: Names.
            first: Index of the first element of the first part that counts.
            last: Index behind the last one.
        """
        trunk = CordPart(1.0, self.elements[first:last])
        shares = [(1.0 / part.divisor, part.crossed) for part in (trunk, *self.parts[1:])]
        for joint in joints:
            yield sum(share for share, crossed in shares if joint in crossed)


def check_tendons(tendons: Mapping[str, Tendon], joints: tuple[str, ...], paths: tuple[str, ...]) -> None:
    """Refuse tendons that cross joints, or run along tendons of a tree, which are not there."""
    for name, tendon in tendons.items():
        if tendon.along is not None and tendon.along not in paths:
            allowed = f"no such tendon of the tree; there are {', '.join(paths) or 'none'}"
            raise problem(f"tendons.{name}.along", allowed, tendon.along)
        if name in paths and tendon.along != name:
            raise problem(f"tendons.{name}", "a tendon of the tree has this name; choose another")
        for joint in tendon.crossings:
            if joint not in joints:
                allowed = f"no such joint; the joints are {', '.join(joints)}"
                raise problem(f"tendons.{name}.crossings.{joint}", allowed)
