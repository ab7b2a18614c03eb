"""Friction, springs and stroke limiters of the joints: (9) with the reaction (17), and (2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.friction import bristles
from finger_pin.description.parameters import Spring
from finger_pin.exceptions import InputError
from finger_pin.laws.bristle import directed_drag
from finger_pin.laws.law import Law
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.spring import BRISTLE_RATIO, HYSTERESIS, JOINT_SPRING, spring_torque
from finger_pin.mechanism.groups import JOINT_LOSSES
from finger_pin.mechanism.joint_laws import joint_law
from finger_pin.mechanism.rows import Energy, Rows, energy
from finger_pin.typing import Array

#: Least levels of what tendons, N, and joints' springs, N m, hold, as those of their friction.
OF_TENDONS, OF_JOINTS = 1e-4, 1e-7

_SPRINGS = Energy("joint_springs", "joints' springs")

_LIMITERS = Energy("limiter", "stroke limiters")
# Farther than any joint gets, rad or m.
_BEYOND_ANY_JOINT = 1e9

_POWERS = {each.name.removeprefix("joint_"): each for each in JOINT_LOSSES}


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Friction of all joints.

    Attributes:
        loads: Shape (n, s), one where a strand loads a joint.
        bearing: Whether each joint has a pin that rubs, shape (n,).
        kinetic: M^d, shape (n,), m.
        static: M^c, shape (n,), m.
        stiffness: sigma_0, shape (n,), N m/rad.
        viscous: b, shape (n,), N m s/rad.
        stribeck_velocity: omega, shape (n,), rad/s.
        floor: g_min, shape (n,), N m.
        stribeck_exponent: 1 or 2, shape (n,).
        lag: sigma_1 / sigma_0, shape (n,), s.
        hardening: Growth of sigma_0 with |F^s|, shape (n,), 1/rad; 0 where a stiffness is given.
        drag: Level without load while sliding, shape (n,), N m; the mean of both directions.
        drag_asymmetry: a, shape (n,): drag (1 + a) hinders motion to greater angles, drag (1 - a) to smaller ones.
        reversal_speed: v_r of Coulomb's law, shape (n,), rad/s.
        law: The law.
    """

    loads: Array
    bearing: NDArray[np.bool_]
    kinetic: Array
    static: Array
    stiffness: Array
    viscous: Array
    stribeck_velocity: Array
    floor: Array
    stribeck_exponent: Array
    lag: Array
    hardening: Array
    drag: Array
    drag_asymmetry: Array
    reversal_speed: Array
    law: Law

    @classmethod
    def from_description(cls, description: FingerDescription, loads: Array) -> JointFriction:
        """Read one number per joint; ``loads`` comes from the routing."""
        law, numbers = description.joint_friction, description.numbers["joint_friction"]
        bearing = np.array(description.bearings)
        shared = bristles(law, numbers)
        shared["viscous"] = bearing * shared["viscous"]
        chosen = joint_law(law.law)
        for key in ("drag", "drag_asymmetry"):
            if np.any(numbers[key]) and key not in chosen.parameters:
                raise InputError(
                    f"finger.joint_friction.{key}", f"has no effect with law = {law.law!r}, which lacks it"
                )
        return cls(
            loads=bearing[:, None] * loads,
            bearing=bearing,
            kinetic=numbers["coulomb"],
            static=numbers[law.break_away_entry],
            **shared,
            drag=bearing * numbers["drag"],
            drag_asymmetry=numbers["drag_asymmetry"],
            reversal_speed=numbers["reversal_speed"],
            law=chosen,
        )

    @property
    def static_drag(self) -> Array:
        """Level without load at which each joint lets go, shape (n,), N m: M^c / M^d of the drag, or all of it."""
        loaded = self.kinetic > 0.0
        return self.drag * np.where(loaded, self.static / np.where(loaded, self.kinetic, 1.0), 1.0)

    def break_away_drag(self, direction: Array) -> Array:
        """Return the level without load at which joints let go in directions of 1 or -1, shape (..., n), N m."""
        level: Array = directed_drag(self.static_drag, self.drag_asymmetry, direction)
        return level

    def rows(
        self,
        names: tuple[str, ...],
        drives: Mapping[str, Array],
        actuated: int,
        width: int,
        canals: Mapping[str, Array] | None = None,
    ) -> Rows:
        """Return the table of the joints' friction.

        Args:
            names: Of the joints.
            drives: Weights with which further tables pull the strands, `Tendons.drive_matrices`; all of it adds up.
            actuated: Number of driven tendons.
            width: Number of coordinates.
            canals: Weights with which canals of a tree, and what pulls through them, load the pins, shape (n, rows).
        """
        size = len(names)
        # Strands beyond the actuated ones are halves of passive tendons.
        loads = {"driven_tendons": self.loads[:, :actuated], "passive_halves": self.loads[:, actuated:]}
        loads |= {group: self.loads @ weights for group, weights in drives.items()} | dict(canals or {})
        return Rows(
            group="joint_friction",
            law=self.law,
            names=names,
            parameters=np.array([getattr(self, name) for name in self.law.parameters]),
            arm=np.eye(size, width) * self.bearing[:, None],
            loads=loads,
            pins=np.where(self.bearing, np.arange(size), -1),
            stored=Energy("joint_bristles", "joint bristles"),
            powers=tuple(
                _POWERS.get(name) or energy(f"joint_{name}") for name in (*self.law.supplies, *self.law.losses)
            ),
        )


@dataclass(frozen=True, eq=False)
class StrokeLimiter:
    """Stroke limiters of all joints.

    Attributes:
        lower: Shape (n,), rad.
        upper: Shape (n,), rad.
        stiffness: k, shape (n,), N m/rad.
        damping: c, shape (n,), s/rad.
        viscous: b, shape (n,), N m s/rad.
        limited: Whether each joint has limits, shape (n,).
    """

    lower: Array
    upper: Array
    stiffness: Array
    damping: Array
    viscous: Array
    limited: NDArray[np.bool_]

    @classmethod
    def from_description(cls, description: FingerDescription) -> StrokeLimiter:
        """Read the ranges and the contact's stiffness and damping."""
        ranges = np.array([joint.range for joint in description.joints.values()])
        numbers = description.numbers["stroke_limiter"]
        limited = np.array([joint.limited for joint in description.joints.values()])
        return cls(ranges[:, 0], ranges[:, 1], limited=limited, **numbers)

    def rows(self, names: tuple[str, ...], width: int) -> Rows:
        """Return the table of the limiters."""
        lower, upper = (
            np.where(self.limited, self.lower, -_BEYOND_ANY_JOINT),
            np.where(self.limited, self.upper, _BEYOND_ANY_JOINT),
        )
        return Rows(
            group="limiter",
            law=STROKE_LIMITER,
            names=names,
            parameters=np.array([lower, upper, self.stiffness, self.damping, self.viscous]),
            arm=np.eye(len(names), width),
            stored=_LIMITERS,
            powers=(_LIMITERS,),
        )


@dataclass(frozen=True, eq=False)
class JointSprings:
    """The springs of all joints; all zero at a joint that has none.

    Attributes:
        stiffness: k, shape (n,), N m/rad.
        rest: theta_0, shape (n,), rad.
        damping: c, shape (n,), N m s/rad.
        hysteresis: h, shape (n,).
    """

    stiffness: Array
    rest: Array
    damping: Array
    hysteresis: Array

    @classmethod
    def from_description(cls, description: FingerDescription) -> JointSprings:
        """Read the springs of the joints."""
        springs = [joint.spring or Spring(stiffness=0.0) for joint in description.joints.values()]
        return cls(*(np.array([getattr(each, name) for each in springs]) for name in cls.__annotations__))

    @property
    def present(self) -> bool:
        """Return whether any joint has a spring that does something."""
        return bool(np.any(self.stiffness) or np.any(self.damping))

    def torque(self, position: Array, velocity: Array) -> Array:
        """Return tau^k, shape (..., n), N m."""
        torque: Array = spring_torque(position, velocity, self.stiffness, self.rest, self.damping)
        return torque

    @property
    def _sprung(self) -> NDArray[np.intp]:
        return np.flatnonzero((self.stiffness != 0.0) | (self.damping != 0.0))

    def rows(self, names: tuple[str, ...], width: int) -> Rows:
        """Return the table of the springs, of those joints that have one."""
        sprung = self._sprung
        return Rows(
            group="joint_springs",
            law=JOINT_SPRING,
            names=tuple(names[joint] for joint in sprung),
            parameters=np.array([self.stiffness, self.rest, self.damping])[:, sprung],
            arm=np.eye(len(names), width)[sprung],
            stored=_SPRINGS,
            powers=(_SPRINGS,),
        )

    def hysteresis_rows(self, names: tuple[str, ...], width: int) -> list[Rows]:
        """Return the table of the springs' hysteresis, of those that have some; no table without any."""
        springs = self.rows(names, width)
        return hysteresis_rows("spring_hysteresis", springs, self.hysteresis[self._sprung], OF_JOINTS, _SPRINGS)


def hysteresis_rows(group: str, springs: Rows, shares: Array, floor: float, lost: Energy) -> list[Rows]:
    """Return the table of springs' hysteresis, of those that have some; no table without any.

    Args:
        group: Its name.
        springs: The table of the springs; its law has a ``stiffness``.
        shares: h, shape (k,).
        floor: Least level of their bristles.
        lost: Entry of the account that its losses go to.
    """
    stiffness = springs.parameters[springs.law.parameters.index("stiffness")]
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
