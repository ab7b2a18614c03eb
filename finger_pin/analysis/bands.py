"""Elastic bands: passive tendons, and springs of a tree's tendons about joints, that pull all of their joints back.

The halves of a passive tendon pull with m in the mean, (12). A joint that moves alone makes the half that
crosses it the tighter, or the looser on its way out, (13), (14):

    T = (1 +- mu) m +- d / 2,   m = (1 +- h) max(0, K_t (l - l_0))

with the hysteresis h and the drag d of the canal; a half never pushes. A tendon of a tree has its spring at one end, as
a cord has its source; what arrives behind each place where it rubs is, by (14) of one that is let out or drawn in,

    T = ((1 +- mu) T_before +- d) / (1 -+ mu)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.analysis.equilibrium import unsettled
from finger_pin.description.caching import cached_property
from finger_pin.description.tree_actuators import drivers
from finger_pin.exceptions import InputError
from finger_pin.laws.capstan import PASSIVE_FRICTION, capstan_coefficient
from finger_pin.laws.limiter import penetration
from finger_pin.laws.spring import half_tension
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Least 1 - mu^d.
_LEAST_SHARE = 1e-300


@dataclass(frozen=True, eq=False)
class Bands:
    """The bands of a finger: b tendons that pull all of their joints one way, with a tension of the posture alone.

    Attributes:
        finger: The finger.
    """

    finger: Finger

    @classmethod
    def against(cls, finger: Finger, cord: int) -> Bands:
        """Return the bands of a finger with a cord, by its index.

        Raises:
            InputError: If a passive tendon or a spring of a tree turns a joint along with the cord, or joints both
                ways, or if more than a spring pulls a tendon of the tree, or its arms depend on the posture.
        """
        bands, tree, description = cls(finger), finger.description.tree, finger.description
        for _, entry, allowed in unsettled("return", finger):
            raise InputError(entry, allowed)
        for name in dict.fromkeys((*description.canals, *bands.sprung)):
            tendon = tree.tendons[name]
            if name not in bands.sprung or drivers(tree.actuators, "tendon", name) or tendon.path or tendon.range:
                allowed = "must have a spring about joints, and nothing else that pulls it, to be a band"
                raise InputError(description.entry("tree.tendons", name), allowed)
        tables = ["tendons"] * finger.routing.passive + ["tree.tendons"] * len(bands.sprung)
        names = (*finger.routing.passive_names, *bands.sprung)
        for table, name, arms in zip(tables, names, bands.arms, strict=True):
            if np.any(arms * finger.routing.coupling[cord] > 0.0) or arms.min() * arms.max() < 0.0:
                allowed = f"must pull all of its joints back, against {finger.routing.tendons[cord]}, to be a band"
                raise InputError(description.entry(table, name), allowed)
        return bands

    @cached_property
    def sprung(self) -> tuple[str, ...]:
        """Names of the tendons of the tree that have a spring."""
        return tuple(name for name, each in self.finger.description.tree.tendons.items() if each.stiffness)

    @cached_property
    def arms(self) -> Array:
        """Arms about joints, positive where they turn them positively, shape (b, n), m: passive tendons first."""
        routing, tendons = self.finger.routing, self.finger.description.tree.tendons
        radii = [[-(tendons[name].joints or {}).get(joint, 0.0) for joint in routing.joints] for name in self.sprung]
        return np.vstack([routing.coupling[routing.actuated :], np.reshape(radii, (-1, len(routing.joints)))])

    def pull(self, positions: Array, side: float) -> tuple[Array, Array]:
        """Return the torques against bands, N m, and the loads with which they press pins, N, shape (m, n) each.

        Args:
            positions: theta, shape (m, n), rad.
            side: 1 where a joint that moves stretches them, -1 where it lets them back, 0 without friction.
        """
        torque, load = self._halves(positions, side)
        for name in self.sprung:
            more, pressing = self._of_tree(name, positions, side)
            torque, load = torque + more, load + pressing
        return torque, load

    def _halves(self, positions: Array, side: float) -> tuple[Array, Array]:
        """Return torques and loads of passive tendons."""
        routing, tendons, actuated = self.finger.routing, self.finger.tendons, self.finger.routing.actuated
        coupling, loads, drag = routing.coupling[actuated:], self.finger.joint_friction.loads, tendons.drag[actuated:]
        stretch = -positions @ coupling.T - tendons.slack
        mean = (1.0 + side * tendons.hysteresis) * half_tension(stretch, 0.5 * tendons.half_stiffness)
        rubs = capstan_coefficient(tendons.surface, routing.curvature(positions))[:, actuated:]
        # The other half is slack where it holds less than the canal does: a loose band is dragged along.
        least = drag / np.maximum(1.0 - rubs, _LEAST_SHARE) if side > 0.0 else 0.0
        tension = np.maximum((1.0 + side * rubs) * mean + 0.5 * side * drag, least)
        return -tension @ coupling, tension @ (loads[:, actuated::2] + loads[:, actuated + 1 :: 2]).T

    def _of_tree(self, name: str, positions: Array, side: float) -> tuple[Array, Array]:
        """Return torques and loads of a tendon of the tree."""
        finger, tendon = self.finger, self.finger.description.tree.tendons[name]
        joints, tendons = finger.routing.joints, finger.tendons
        arms = self.arms[finger.routing.passive + self.sprung.index(name)]
        length, slack = -positions @ arms, tendon.slack
        if slack is not None:
            tension = np.asarray(half_tension(length - finger.paths.reference_lengths[name] - slack, tendon.stiffness))
        else:
            tension = tendon.stiffness * np.asarray(penetration(length, *tendon.rest))
        torque, load = np.zeros((2, *positions.shape))
        if name not in finger.description.canals:
            # No cord: a transmission, which rubs nowhere.
            return -tension[:, None] * arms, load
        index = len(finger.routing.tendons) + finger.description.canals.index(name)
        numbers = dict(zip(PASSIVE_FRICTION.parameters, tendons.friction[:, index].tolist(), strict=True))
        for wrap in tendons.wraps[index]:
            rubs = capstan_coefficient(numbers["surface"], np.abs(positions) @ wrap.turns(joints) + wrap.offset)
            part = side * np.sign(tension) * rubs
            tension = ((1.0 + part) * tension + side * numbers["drag"] * wrap.share) / (1.0 - part)
            tension = np.maximum(tension, 0.0) if slack is not None else tension
            torque -= tension[:, None] * wrap.arms(joints)
            load += tension[:, None] * (finger.joint_friction.bearing * wrap.loads(joints))
        return torque, load
