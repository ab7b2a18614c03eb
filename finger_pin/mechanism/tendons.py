"""The tendon layer: friction in the canals (14), (16), delivered tension (12), the massive passive tendon (13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.cords import Cord
from finger_pin.description.coupling import slack_lengths
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.friction import bristles
from finger_pin.description.routing import Routing
from finger_pin.description.tree_couplings import coupled
from finger_pin.laws.capstan import DRIVEN_TENDON, PASSIVE_FRICTION, UNLIMITED_FORCE, capstan_coefficient
from finger_pin.laws.spring import TENDON_HALF
from finger_pin.mechanism.groups import SOURCES, TENDON_LOSSES, TIES
from finger_pin.mechanism.joints import OF_TENDONS, hysteresis_rows
from finger_pin.mechanism.rows import Energy, Rows, Source
from finger_pin.mechanism.wiring import drive_matrices
from finger_pin.typing import Array, Number

SLACK = Energy("slack", "tensions cut at zero")
BRISTLES = Energy("tendon_bristles", "tendon bristles")
_HALVES = ("proximal", "distal")
_HYSTERESIS_ENERGY = Energy("passive_hysteresis", "passive tendons stretching")


@dataclass(frozen=True, eq=False)
class Tendons:
    """The tendon layer of a finger, by the numbers of its description, independent of the rigid body that it drives.

    Attributes:
        description: The finger.
        routing: Its cords, and their matrices.
    """

    ENTRY: ClassVar = "tendon_friction"

    description: FingerDescription
    routing: Routing

    @classmethod
    def from_description(cls, description: FingerDescription) -> Tendons:
        """Read the tendons of a finger."""
        return cls(description, Routing.from_description(description))

    @cached_property
    def wraps(self) -> tuple[tuple[Cord, ...], ...]:
        """The places where each of its tendons, and of those of its tree, rubs, behind sheaths with pieces."""
        places = list(self.routing.wraps)
        for name, wound in self.description.drive_cords.items():
            if wound.pieces:
                # The sheath is one more of them.
                behind = self.routing.cords[name]._replace(curvature_offset=0.0).wraps
                share = 1.0 / (1 + len(behind))
                places[self.routing.tendons.index(name)] = tuple(wrap._replace(share=share) for wrap in behind)
        return tuple(places)

    @cached_property
    def several(self) -> dict[int, list[tuple[Array, float, NDArray[np.bool_]]]]:
        """By index of tendons that rub at several places, of each the turns (15) and offset, and which joints follow.

        Turns have shape (n,), offsets are in rad; only tendons on joints are there, none along paths through space.
        """
        joints, through_space, found = self.routing.joints, self.routing.through_space, {}
        for k, (cord, places) in enumerate(zip(self.routing.cords.values(), self.wraps, strict=False)):
            if len(places) > 1 and not through_space[k]:
                found[k] = [(place.turns(joints), place.offset, np.isin(joints, [*place.crossed])) for place in places]
                if cord.wraps[0].share != places[0].share:
                    sheath = np.zeros(len(joints)), cord.curvature_offset, np.isin(joints, [*cord.crossed])
                    found[k].insert(0, sheath)
        return found

    def _number(self, entry: str) -> Array:
        return self.description.numbers["tendon_friction"][entry][: len(self.routing.cords)]

    @property
    def surface(self) -> Array:
        """mu_e, shape (t,)."""
        return self._number("coulomb")

    @property
    def stiction_ratio(self) -> Array:
        """rho, shape (t,)."""
        return self._number("stiction_ratio")

    @property
    def viscous(self) -> Array:
        """Coefficient b, shape (t,), N s/m."""
        return self._number("viscous")

    @property
    def drag(self) -> Array:
        """Level without load, shape (t,), N."""
        return self._number("drag")

    @property
    def stribeck(self) -> tuple[Array, Array]:
        """Stribeck's velocity, m/s, and the exponent of his curve, 1 or 2, shape (t,) each."""
        return self._number("stribeck_velocity"), self._number("stribeck_exponent")

    @property
    def half_stiffness(self) -> Array:
        """K_h = 2 K_t of the passive tendons, shape (p,), N/m."""
        return 2.0 * self.description.numbers["passive_tendon"]["stiffness"]

    @property
    def hysteresis(self) -> Array:
        """Hysteresis h of the passive tendons, shape (p,)."""
        return self.description.numbers["passive_tendon"]["hysteresis"]

    @property
    def slack(self) -> Array:
        """Length of the passive tendons, relaxed, beyond their way at theta = 0, shape (p,), m."""
        return slack_lengths(self.description)

    @property
    def mass(self) -> Array:
        """m_5 of the passive tendons, shape (p,), kg."""
        return self.description.numbers["passive_tendon"]["mass"]

    @cached_property
    def friction(self) -> Array:
        """Parameters of `PASSIVE_FRICTION` of the tendons and of the canals of the tree, shape (f, t + c)."""
        settings, numbers = self.description.tendon_friction, self.description.numbers["tendon_friction"]
        own = [0.0] * len(self.routing.tendons)
        losses = np.array(own + [self.description.tree.tendons[name].friction for name in self.description.canals])
        values = {**numbers, "surface": numbers["coulomb"], "ratio": numbers["stiction_ratio"]}
        values |= bristles(settings, numbers, losses) | {"drag": np.maximum(numbers["drag"], losses)}
        return np.array([values[name] for name in PASSIVE_FRICTION.parameters])

    @cached_property
    def coupled(self) -> Array:
        """Weights of couplings in the tendons' tensions, shape (t, k): those that have any may push."""
        couplings = self.description.couplings
        shares = [[coupled(couplings, name).get(key, 0.0) for key in couplings] for name in self.routing.tendons]
        return np.reshape(shares, (len(self.routing.tendons), len(couplings)))

    @property
    def at_bends(self) -> bool:
        """Return whether any tendon rubs at several places."""
        return any(len(places) > 1 for places in self.wraps)

    def in_sliding(self, position: Array, direction: Array) -> tuple[Array, Array]:
        """Return the shares of tendons' tensions that arrive at every joint in steady sliding at M^d, and the drags.

        Counts as if all places of a tendon slid the same way, as they do unless joints turn against each other.

        Args:
            position: theta, shape (..., n), rad.
            direction: 1 for a tendon that is drawn in, -1 for one that is let out, shape (..., t); 0 without friction.

        Returns:
            Shares, and what drag takes besides, N, shape (..., t, n) each; the last where it does not cross a joint.
        """
        routing = self.routing
        joints = len(routing.joints)

        def at_place(surface: Number, curvature: Array, direction: Array, drag: Number) -> tuple[Array, Array]:
            part = direction * capstan_coefficient(surface, curvature)
            return (1.0 - part) / (1.0 + part), direction * drag / (1.0 + part)

        whole = at_place(self.surface, routing.curvature(position), direction, self.drag)
        share, lost = (np.repeat(each[..., None], joints, axis=-1) for each in whole)
        for k, places in self.several.items():
            left, loss, drag = np.ones_like(direction[..., k]), 0.0 * direction[..., k], self.drag[k] / len(places)
            for bends, offset, beyond in places:
                turned = np.abs(position) @ bends + offset
                ratio, lower = at_place(self.surface[k], turned, direction[..., k], drag)
                left, loss = left * ratio, loss * ratio + lower
                share[..., k, beyond], lost[..., k, beyond] = left[..., None], loss[..., None]
        return share, lost

    def stretch(self, position: Array, passive_position: Array) -> tuple[Array, Array]:
        """Return the stretch of the proximal and distal halves, shapes (..., p), m; negative when slack."""
        proximal = -position @ self.routing.proximal_coupling.T - passive_position - 0.5 * self.slack
        distal = passive_position - position @ self.routing.distal_coupling.T - 0.5 * self.slack
        return proximal, distal

    def rest_position(self, position: Array) -> Array:
        """Return p_5 at equal stretch of both halves, shape (..., p), m."""
        proximal, distal = self.stretch(position, np.zeros((*position.shape[:-1], self.routing.passive)))
        return 0.5 * (proximal - distal)

    @property
    def hysteretic_halves(self) -> tuple[str, ...]:
        """Names of the halves of passive tendons with hysteresis."""
        shares = zip(self.routing.passive_names, self.hysteresis, strict=True)
        return tuple(f"{name}.{half}" for name, share in shares if share for half in _HALVES)

    def drive_matrices(self, drives: Sequence[Rows]) -> dict[str, Array]:
        """Return the weights with which drives and halves' hysteresis pull the s strands, by table, shape (s, k)."""
        actuated, strands = self.routing.actuated, np.eye(len(self.routing.strand_coupling))
        matrices = {group: strands[:, :actuated] @ weights for group, weights in self._pulls(drives).items()}
        if self.hysteretic_halves:
            matrices["passive_hysteresis"] = strands[:, actuated:][:, np.repeat(self.hysteresis > 0.0, 2)]
        return matrices

    def _pulls(self, drives: Sequence[Rows]) -> dict[str, Array]:
        """Return the weights with which drives and couplings pull the a actuated tendons, by table, shape (a, k)."""
        weights = drive_matrices(drives, self.routing.tendons[: self.routing.actuated])
        return weights | ({TIES: self.coupled[: self.routing.actuated]} if self.coupled.size else {})

    def _halves(self, motors: int) -> list[Rows]:
        """Return the tables of halves of passive tendons, (12), and of their hysteresis."""
        routing, joints, passive = self.routing, len(self.routing.joints), self.routing.passive
        # p of the halves: what draws the mass back loosens the proximal half and stretches the distal one.
        arm = np.zeros((2 * passive, joints + passive + motors))
        arm[:, :joints] = routing.strand_coupling[routing.actuated :]
        arm[np.arange(2 * passive), joints + np.arange(2 * passive) // 2] = np.tile([1.0, -1.0], passive)
        halves = Rows(
            group="passive_halves",
            law=TENDON_HALF,
            names=tuple(f"{name}.{half}" for name in routing.passive_names for half in _HALVES),
            parameters=np.repeat(self.half_stiffness, 2)[None],
            arm=arm,
            offset=np.repeat(0.5 * self.slack, 2),
            stored=Energy("passive_tendon", "passive tendons"),
        )
        held = np.repeat(self.hysteresis, 2), OF_TENDONS, _HYSTERESIS_ENERGY
        return [halves, *hysteresis_rows("passive_hysteresis", halves, *held)]

    def rows(self, drives: Sequence[Rows] = (), motors: int = 0) -> list[Rows]:
        """Return the tables of halves (12), drives, driven and passive tendons (14), for (theta, p, theta_s, theta_m).

        Args:
            drives: Motors that pull tendons in place of ideal sources.
            motors: Number of motors and of spools with play.
        """
        routing, joints, passive = self.routing, len(self.routing.joints), self.routing.passive
        actuated, width = routing.actuated, joints + passive + motors
        driven, bends = np.zeros((2, len(routing.tendons), width))
        # `Canals` has the wraps beyond the first ones.
        first = [places[0] for places in self.wraps[: len(routing.tendons)]]
        driven[:, :joints] = routing.coupling
        driven[actuated:] = np.eye(passive, width, joints)
        bends[:, :joints] = routing.first_turns
        offset, names = np.array([wrap.offset for wrap in first]), routing.passive_names
        wired = self._pulls(drives)
        replaced = np.any(np.hstack([np.zeros((actuated, 0)), *wired.values()]), axis=1)
        least = np.where(self.coupled[:actuated].any(axis=1), -UNLIMITED_FORCE, 0.0)
        # What loads a canal is what its tendon's halves pull with, and what they hold.
        halves, both = self._halves(motors), np.repeat(np.eye(passive), 2, axis=1)
        loads = {table.group: both @ table.loads.get("passive_halves", np.eye(2 * passive)).T for table in halves}
        return [
            *halves,
            *drives,
            Rows(
                group="driven_tendons",
                law=DRIVEN_TENDON,
                names=routing.tendons[:actuated],
                parameters=np.vstack([self.at(range(actuated), first[:actuated]), replaced, least]),
                arm=driven[:actuated],
                channels=np.where(replaced, -1, np.arange(actuated)),
                inputs=wired,
                bends=bends[:actuated],
                curvature_offset=offset[:actuated],
                stored=BRISTLES,
                powers=(SOURCES, *TENDON_LOSSES, SLACK),
                source=numbers_at(range(actuated), first[:actuated]),
            ),
            Rows(
                group="passive_tendons",
                law=PASSIVE_FRICTION,
                names=names,
                parameters=self.at(range(actuated, len(first)), first[actuated:]),
                arm=driven[actuated:],
                loads=loads,
                bends=bends[actuated:],
                curvature_offset=offset[actuated:],
                stored=BRISTLES,
                powers=TENDON_LOSSES,
                source=numbers_at(range(actuated, len(first)), first[actuated:]),
            ),
        ]

    def at(self, tendons: Sequence[int], wraps: Sequence[Cord], drags: bool = True) -> Array:
        """Return the numbers of `friction` of some tendons at some of their places, shape (f, k); drag if asked."""
        friction = self.friction[:, tendons]
        shared = [PASSIVE_FRICTION.parameters.index(name) for name in ("stiffness", "viscous", "drag")]
        friction[shared] *= [wrap.share for wrap in wraps]
        friction[-1] *= drags
        return friction


def numbers_at(tendons: Sequence[int], wraps: Sequence[Cord], drags: bool = True) -> Source:
    """Return `Tendons.at` of the arguments as a source of numbers."""
    return Source("tendons", methodcaller("at", tendons, wraps, drags))
