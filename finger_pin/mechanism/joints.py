"""Friction, springs and stroke limiters of the joints: (9) with the reaction (17), and (2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.friction import bristles
from finger_pin.description.parameters import Spring
from finger_pin.description.routing import Routing
from finger_pin.exceptions import InputError
from finger_pin.laws.bristle import directed_drag
from finger_pin.laws.law import Law
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.spring import BRISTLE_RATIO, HYSTERESIS, JOINT_SPRING, spring_torque
from finger_pin.mechanism.groups import JOINT_LOSSES
from finger_pin.mechanism.joint_laws import joint_law
from finger_pin.mechanism.rows import Energy, Rows, Source, energy
from finger_pin.typing import Array

#: Least levels of what tendons, N, and joints' springs, N m, hold, as those of their friction.
OF_TENDONS, OF_JOINTS = 1e-4, 1e-7

_SPRINGS = Energy("joint_springs", "joints' springs")

_LIMITERS = Energy("limiter", "stroke limiters")
_NO_SPRING = Spring(stiffness=0.0)
# Farther than any joint gets, rad or m.
_BEYOND_ANY_JOINT = 1e9

_POWERS = {each.name.removeprefix("joint_"): each for each in JOINT_LOSSES}


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Friction of all joints, by the numbers of its description.

    Attributes:
        description: The finger.
        routing: Its routing.
    """

    ENTRY: ClassVar = "joint_friction"

    description: FingerDescription
    routing: Routing

    @property
    def _numbers(self) -> Mapping[str, Array]:
        return self.description.numbers["joint_friction"]

    @property
    def law(self) -> Law:
        """The law."""
        return joint_law(self.description.joint_friction.law)

    @cached_property
    def bearing(self) -> NDArray[np.bool_]:
        """Whether each joint has a pin that rubs, shape (n,)."""
        return np.array(self.description.bearings)

    @cached_property
    def loads(self) -> Array:
        """Shape (n, s), one where a strand loads a joint."""
        return self.bearing[:, None] * self.routing.loads

    @property
    def kinetic(self) -> Array:
        """M^d, shape (n,), m."""
        return self._numbers["coulomb"]

    @property
    def static(self) -> Array:
        """M^c, shape (n,), m."""
        return self._numbers[self.description.joint_friction.break_away_entry]

    @property
    def viscous(self) -> Array:
        """Coefficient b, shape (n,), N m s/rad."""
        return self.bearing * self._numbers["viscous"]

    @property
    def drag(self) -> Array:
        """Level without load while sliding, shape (n,), N m; the mean of both directions."""
        return self.bearing * self._numbers["drag"]

    @property
    def drag_asymmetry(self) -> Array:
        """a, shape (n,): drag (1 + a) hinders motion to greater angles, drag (1 - a) to smaller ones."""
        return self._numbers["drag_asymmetry"]

    @property
    def stribeck(self) -> tuple[Array, Array]:
        """Stribeck's velocity, rad/s, and the exponent of his curve, 1 or 2, shape (n,) each."""
        return self._numbers["stribeck_velocity"], self._numbers["stribeck_exponent"]

    @property
    def parameters(self) -> Array:
        """Numbers of the law, shape (parameters, n).

        Raises:
            InputError: If there is drag that the law lacks.
        """
        settings, law = self.description.joint_friction, self.law
        for key in ("drag", "drag_asymmetry"):
            if np.any(self._numbers[key]) and key not in law.parameters:
                allowed = f"has no effect with law = {settings.law!r}, which lacks it"
                raise InputError(f"finger.joint_friction.{key}", allowed)
        values = {**self._numbers, **bristles(settings, self._numbers)}
        values |= {name: getattr(self, name) for name in ("kinetic", "static", "viscous", "drag")}
        values["static_drag"] = static_drag(self.drag, self.kinetic, self.static)
        return np.array([values[name] for name in law.parameters])

    def break_away_drag(self, direction: Array) -> Array:
        """Return the level without load at which joints let go in directions of 1 or -1, shape (..., n), N m."""
        level: Array = directed_drag(static_drag(self.drag, self.kinetic, self.static), self.drag_asymmetry, direction)
        return level

    def rows(self, drives: Mapping[str, Array], width: int, canals: Mapping[str, Array]) -> Rows:
        """Return the table of the joints' friction.

        Args:
            drives: Weights with which further tables pull the strands, `Tendons.drive_matrices`; all of it adds up.
            width: Number of coordinates.
            canals: Weights with which canals of a tree, and what pulls through them, load the pins, shape (n, rows).
        """
        law, bearing, pressing = self.law, self.bearing, self.loads
        # Strands beyond the actuated ones are halves of passive tendons.
        actuated = self.routing.actuated
        loads = {"driven_tendons": pressing[:, :actuated], "passive_halves": pressing[:, actuated:]}
        loads |= {group: pressing @ weights for group, weights in drives.items()} | dict(canals)
        return Rows(
            group="joint_friction",
            law=law,
            names=self.routing.joints,
            parameters=self.parameters,
            arm=np.eye(len(bearing), width) * bearing[:, None],
            loads=loads,
            pins=np.where(bearing, np.arange(len(bearing)), -1),
            stored=Energy("joint_bristles", "joint bristles"),
            powers=tuple(_POWERS.get(name) or energy(f"joint_{name}") for name in (*law.supplies, *law.losses)),
            source=Source("joint_friction", attrgetter("parameters")),
        )


def static_drag(drag: Array, kinetic: Array, static: Array) -> Array:
    """Return the level without load at which each joint lets go, shape (n,), N m: M^c / M^d of the drag, or all."""
    loaded = kinetic > 0.0
    return drag * np.where(loaded, static / np.where(loaded, kinetic, 1.0), 1.0)


@dataclass(frozen=True, eq=False)
class StrokeLimiter:
    """Stroke limiters of all joints, by the numbers of a description."""

    ENTRY: ClassVar = "stroke_limiter"

    description: FingerDescription

    @cached_property
    def _ranges(self) -> Array:
        return np.array([joint.range for joint in self.description.joints.values()]).reshape(-1, 2)

    @property
    def lower(self) -> Array:
        """Lower ends of the ranges, shape (n,), rad."""
        return self._ranges[:, 0]

    @property
    def upper(self) -> Array:
        """Upper ends of the ranges, shape (n,), rad."""
        return self._ranges[:, 1]

    @property
    def limited(self) -> NDArray[np.bool_]:
        """Whether each joint has limits, shape (n,)."""
        return np.array([joint.limited for joint in self.description.joints.values()])

    @property
    def parameters(self) -> Array:
        """Numbers of `STROKE_LIMITER`, shape (parameters, n)."""
        numbers, limited = self.description.numbers["stroke_limiter"], self.limited
        lower = np.where(limited, self.lower, -_BEYOND_ANY_JOINT)
        upper = np.where(limited, self.upper, _BEYOND_ANY_JOINT)
        return np.array([lower, upper, *(numbers[name] for name in STROKE_LIMITER.parameters[2:])])

    def rows(self, width: int) -> Rows:
        """Return the table of the limiters."""
        return Rows(
            group="limiter",
            law=STROKE_LIMITER,
            names=tuple(self.description.joints),
            parameters=self.parameters,
            arm=np.eye(len(self.description.joints), width),
            stored=_LIMITERS,
            powers=(_LIMITERS,),
            source=Source("stroke_limiter", attrgetter("parameters")),
        )


@dataclass(frozen=True, eq=False)
class JointSprings:
    """The springs of all joints, by the numbers of a description; all zero at a joint that has none."""

    description: FingerDescription

    # Controllers ask for the torque at every sample.
    @cached_property
    def _numbers(self) -> dict[str, Array]:
        springs = [joint.spring or _NO_SPRING for joint in self.description.joints.values()]
        names = (*JOINT_SPRING.parameters, "hysteresis")
        return {name: np.array([getattr(each, name) for each in springs], dtype=float) for name in names}

    @property
    def rest(self) -> Array:
        """theta_0, shape (n,), rad."""
        return self._numbers["rest"]

    @property
    def hysteresis(self) -> Array:
        """h, shape (n,)."""
        return self._numbers["hysteresis"]

    @property
    def present(self) -> bool:
        """Return whether any joint has a spring that does something."""
        return bool(np.any(self._numbers["stiffness"]) or np.any(self._numbers["damping"]))

    def torque(self, position: Array, velocity: Array) -> Array:
        """Return tau^k, shape (..., n), N m."""
        stiffness, rest, damping = (self._numbers[name] for name in JOINT_SPRING.parameters)
        torque: Array = spring_torque(position, velocity, stiffness, rest, damping)
        return torque

    def rows(self, width: int) -> list[Rows]:
        """Return the table of the springs of joints that have one, and that of their hysteresis, if any has it."""
        numbers, names = np.array([self._numbers[name] for name in JOINT_SPRING.parameters]), self.description.joints
        sprung = np.flatnonzero((numbers[0] != 0.0) | (numbers[2] != 0.0))
        springs = Rows(
            group="joint_springs",
            law=JOINT_SPRING,
            names=tuple(np.array([*names])[sprung].tolist()),
            parameters=numbers[:, sprung],
            arm=np.eye(len(names), width)[sprung],
            stored=_SPRINGS,
            powers=(_SPRINGS,),
        )
        return [springs, *hysteresis_rows("spring_hysteresis", springs, self.hysteresis[sprung], OF_JOINTS, _SPRINGS)]


def hysteresis_rows(group: str, springs: Rows, shares: Array, floor: float, lost: Energy) -> list[Rows]:
    """Return the table of springs' hysteresis, of those that have some; no table without any.

    Args:
        group: Its name.
        springs: The table of the springs; its law has a ``stiffness``.
        shares: h, shape (k,).
        floor: Least level of their bristles.
        lost: Entry of the account that its losses go to.
    """
    stiffness = springs["stiffness"]
    lossy = np.flatnonzero(shares * stiffness)
    if not lossy.size:
        return []
    return [
        Rows(
            group=group,
            law=HYSTERESIS,
            names=tuple(springs.names[k] for k in lossy),
            parameters=np.array([shares[lossy], BRISTLE_RATIO * stiffness[lossy], np.full(len(lossy), floor)]),
            arm=springs.arm[lossy],
            loads={springs.group: np.eye(springs.count)[lossy]},
            stored=springs.stored,
            powers=(lost,),
            pulls=tuple(springs.pulls[k] for k in lossy if springs.pulls),
        )
    ]
