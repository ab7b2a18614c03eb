"""Cords as sequences of elements: arms of constant length on joints, and legs of paths through space."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.description.actuators import Actuator
from finger_pin.description.parameters import Tendon
from finger_pin.description.validation import expand, problem
from finger_pin.description.waypoints import Waypoint
from finger_pin.typing import Array

_OF_SPOOLS = ("tendon_rigidity", "tendon_length", "tendon_damping", "tendon_pieces", "tendon_hysteresis", "pretension")


class CordElement(NamedTuple):
    """An element of a cord: an arm on a joint, or a leg between two points of a path.

    Attributes:
        name: Of the arm's joint; of a leg its number along its part, from 1.
        crossed: The joints that it crosses.
        radius: Arm about the joint, m, positive where tension turns it positively; None of a leg, whose arms depend on
            the posture.
        turn: Turn of the cord over the joint's rotation (15); of a leg its path shows it.
        curvature_offset: Curvature at theta = 0 that does not show, rad.
        points: The two ends of a leg.
        wrap: Name of what a leg may wrap, and that; None where it is straight.
        follows: Whether it is a leg that begins where another ends: there the path turns.
    """

    name: str
    crossed: frozenset[str]
    radius: float | None = None
    turn: float = 0.0
    curvature_offset: float = 0.0
    points: tuple[Waypoint, ...] = ()
    wrap: tuple[str, Waypoint] | None = None
    follows: bool = False

    @property
    def moves(self) -> bool:
        """Whether the joints that it crosses change the cord's length."""
        return bool(self.crossed) and self.radius != 0.0

    @property
    def bends(self) -> bool:
        """Whether the cord may bend there, and rub."""
        return self.follows or self.wrap is not None or bool(self.turn or self.curvature_offset)


class Cord(NamedTuple):
    """A tendon as a cord, or a piece of one: from its source, a pulley, its mass or a place where it rubs on.

    Attributes:
        elements: From the source, the proximal anchor or the pulley on to the next pulley or the end, all of them.
        branches: What is behind pulleys; none of what is behind one itself.
        divisor: Of the tension: 1 before the first pulley.
        curvature_offset: Beside that of its elements, rad.
        through_space: Whether it runs along a path, so that its arms depend on the posture.
        at_bends: Whether it rubs at each of its bends, past which it slides at a speed of its own.
        mass_after: Number of elements before the lumped mass of a passive tendon.
        first: Index of the piece's first element.
        last: Index behind its last one, where the next piece begins.
        share: The piece's part of the tendon's stiffness, viscous friction, micro-damping and drag.
    """

    elements: tuple[CordElement, ...]
    branches: tuple[Cord, ...] = ()
    divisor: float = 1.0
    curvature_offset: float = 0.0
    through_space: bool = False
    at_bends: bool = False
    mass_after: int | None = None
    first: int = 0
    last: int | None = None
    share: float = 1.0

    @classmethod
    def of_crossings(cls, tendon: Tendon, *, at_bends: bool) -> Cord:
        """Return a tendon that crosses joints: an arm on each."""
        arms = (
            CordElement(joint, frozenset({joint}), each.radius, each.bends, each.curvature_offset)
            for joint, each in tendon.crossings.items()
        )
        mass_after = tendon.proximal_crossings if tendon.kind == "passive" else None
        offset = tendon.curvature_offset
        return cls(tuple(arms), curvature_offset=offset, at_bends=at_bends, mass_after=mass_after)

    @property
    def name(self) -> str:
        """Name of the piece: of the first element that bends, or of the first."""
        bending = [element for element in self.own if element.bends]
        return next((element.name for element in (*bending, *self.own)), "")

    @property
    def own(self) -> tuple[CordElement, ...]:
        """Elements of the piece."""
        return self.elements[self.first : self.last]

    @property
    def parts(self) -> tuple[Cord, ...]:
        """The piece before its first pulley, and then that behind each."""
        return (self, *self.branches)

    @property
    def crossed(self) -> frozenset[str]:
        """The joints that the cord crosses from the piece's beginning on."""
        return _crossed(self.elements[self.first :])

    @property
    def offset(self) -> float:
        """Curvature of the piece that neither its joints nor its path show, rad."""
        return sum(each.curvature_offset for each in self.own) + self.curvature_offset

    @property
    def strands(self) -> tuple[Cord, ...]:
        """The halves of a passive tendon; an actuated one is a strand by itself."""
        if self.mass_after is None:
            return (self,)
        return self._replace(last=self.mass_after), self._replace(first=self.mass_after)

    @property
    def sliding(self) -> Cord:
        """The piece that rubs: at bends, up to the last element that changes the length, as none beyond slides."""
        last = max((number for number, each in enumerate(self.elements, 1) if each.moves), default=None)
        return self._replace(last=last) if self.at_bends else self

    @property
    def wraps(self) -> tuple[Cord, ...]:
        """The pieces at which it rubs, first to last; what is behind its pulleys rubs by itself.

        There is one, unless it rubs at bends: then one for each bend past which it slides at another speed. What they
        have of ``curvature_offset`` is shared by the pieces that bend.
        """
        sliding, starts = self.sliding.own, [0]
        for k, element in enumerate(sliding if self.at_bends else ()):
            if element.bends and any(before.moves for before in sliding[starts[-1] : k]):
                starts.append(k)
        ends = [*starts[1:], len(sliding)]
        pieces = [
            self._replace(first=k, last=end, share=1.0 / len(starts)) for k, end in zip(starts, ends, strict=True)
        ]
        bent = [any(element.bends for element in piece.own) for piece in pieces]
        bent = bent if any(bent) else [True, *bent[1:]]
        shares = [self.curvature_offset * bends / sum(bent) for bends in bent]
        return tuple(each._replace(curvature_offset=share) for each, share in zip(pieces, shares, strict=True))

    def posed(self, joints: Sequence[str], arms: Array, turn: float) -> Cord:
        """Return the cord with constant arms about joints, m, and with a turn of its path, rad, both of one posture."""
        constant = (CordElement(joint, frozenset(), arm) for joint, arm in zip(joints, arms.tolist(), strict=True))
        own = (element if element.points else element._replace(radius=0.0) for element in self.elements)
        offset = self.curvature_offset + turn
        return self._replace(elements=(*constant, *own), curvature_offset=offset, through_space=False)

    def arms(self, joints: Sequence[str]) -> Array:
        """Return the piece's arms of constant length about joints, by their names, shape (n,), m."""
        return self._by_joint(joints, "radius")

    def turns(self, joints: Sequence[str]) -> Array:
        """Return the turn of the piece over the rotation of joints (15), shape (n,)."""
        return self._by_joint(joints, "turn")

    def _by_joint(self, joints: Sequence[str], value: str) -> Array:
        values = dict.fromkeys(joints, 0.0)
        for arm in (element for element in self.own if not element.points):
            values[arm.name] += getattr(arm, value)
        return np.array([*values.values()])

    def loads(self, joints: Sequence[str]) -> Array:
        """Return the share of the piece's tension that loads joints' pins (17), behind pulleys divided, shape (n,)."""
        shares = [(1.0, _crossed(self.own)), *((1.0 / each.divisor, each.crossed) for each in self.branches)]
        return np.array([sum((share for share, crossed in shares if joint in crossed), 0.0) for joint in joints])


def _crossed(elements: Iterable[CordElement]) -> frozenset[str]:
    return frozenset[str]().union(*(element.crossed for element in elements))


class DriveCord(NamedTuple):
    """The cord from a winch or a spool to the finger.

    Attributes:
        stiffness: K, N/m.
        damping: D, N s/m.
        pieces: Number of pieces that stretch in its sheath; 0 for none.
        hysteresis: h.
        slack: e0, by which it is stretched with the spool and all joints at zero, m.
    """

    stiffness: float
    damping: float
    pieces: int
    hysteresis: float = 0.0
    slack: float = 0.0


def drive_cords(tendons: Mapping[str, Tendon], actuators: Mapping[str, Actuator]) -> dict[str, DriveCord]:
    """Return the cords from winches and from spools of motors, by the tendon that they pull."""
    winches = {name: each.winch for name, each in tendons.items() if each.winch}
    cords = {name: DriveCord(winch.stiffness, winch.damping, winch.pieces) for name, winch in winches.items()}
    for each in actuators.values():
        columns = [expand(getattr(each, key), len(each.tendons)).tolist() for key in _OF_SPOOLS]
        for name, rigidity, length, damping, pieces, hysteresis, tension in zip(each.tendons, *columns, strict=True):
            stiffness = rigidity / length
            cords[name] = DriveCord(stiffness, damping, int(pieces), hysteresis, tension / stiffness)
    return cords


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
