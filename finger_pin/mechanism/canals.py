"""Friction of tendons that other rows pull (14), (16): tendons of a tree, and branches behind pulleys.

A tendon of a tree is pulled by its spring, its range, actuators, or what drives the joint that it winds about; its
friction is a row that exerts what the canal changes of their tension. A pulley divides the tension that friction has
left, and each branch behind it rubs by its own bend at its own tension, as it slides by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from finger_pin.description.finger import FingerDescription
from finger_pin.laws.capstan import CANAL_FRICTION, CORD_TENSION
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.tendon_paths import TendonPath, TendonPaths
from finger_pin.mechanism.tendons import BRISTLES, LOSSES, SLACK, SOURCES, Tendons
from finger_pin.mechanism.tree import table_of
from finger_pin.typing import Array

#: The tables, in the order of evaluation.
CORDS, CANALS, BRANCHES = "tendon_cords", "tendon_canals", "tendon_branches"


@dataclass
class _Canal:
    """A canal: its route, what pulls through it, and the joints whose pins its friction loads.

    Attributes:
        name: Of the tendon, and which branch.
        tendon: Index of its numbers of friction.
        route: Along which it acts.
        one_way: Whether what pulls never pushes.
        crossed: Joints.
        sources: By table of earlier rows and the names of these, parts of their forces that are its tension.
        offset: Curvature that its path does not show, rad.
        bends: Curvature per joint angle, shape (n,), of a sum of joint positions.
        drag: Level without load, N.
    """

    name: str
    tendon: int
    route: TendonPath
    one_way: bool
    crossed: frozenset[str]
    sources: dict[tuple[str, str], float]
    offset: float = 0.0
    bends: Array = field(default_factory=lambda: np.zeros(0))
    drag: float = 0.0


class Canals:
    """Canals of a tree's tendons, other than those pulled by ideal sources or drives.

    Attributes:
        tables: Their rows, none without any.
        loads: By table, weights with which rows load the pins of joints, shape (n, rows).
    """

    def __init__(
        self,
        description: FingerDescription,
        routes: TendonPaths | None,
        tendons: Tendons,
        rows: Sequence[Rows],
        pulled: Mapping[str, Array],
        width: int,
    ) -> None:
        """Find the canals.

        Args:
            description: Of the finger.
            routes: The tendons of its tree; None without one.
            tendons: With the numbers of friction, those of canals after the finger's own.
            rows: Earlier rows: those of the tree, and of the finger's tendons.
            pulled: Weights with which drives pull the actuated tendons, by table.
            width: Number of coordinates.
        """
        self.tables: list[Rows] = []
        self.loads: dict[str, Array] = {}
        if routes is None or description.tree is None:
            return
        self._tree, self._joints = description.tree, tuple(description.joints)
        known = {table.group: table for table in rows}
        cords = {name: shares for name in self._tree.rubbing if (shares := self._tree.linked(name))}
        if cords:
            known[CORDS] = self._cords(cords, known, width)
            self.tables.append(known[CORDS])
        trunks = [self._trunk(name, routes, tendons) for name in self._tree.rubbing]
        branches = [each for trunk in trunks for each in self._behind(trunk, trunk.name, {(CANALS, trunk.name): 1.0})]
        for index, (name, tendon) in enumerate(description.tendons.items()):
            if tendon.along is not None:
                drives = {
                    (group, known[group].names[k]): float(weights[index, k])
                    for group, weights in pulled.items()
                    for k in np.flatnonzero(weights[index])
                }
                own = _Canal(name, index, routes.routes[tendon.along], True, frozenset(), drives)
                branches += self._behind(own, tendon.along, {("driven_tendons", name): 1.0})
        for group, canals in ((CANALS, trunks), (BRANCHES, branches)):
            if canals:
                known[group] = self._table(group, canals, tendons, known, width)
                self.tables.append(known[group])
                self._press(canals, known, {"driven_tendons", *pulled})

    def _trunk(self, name: str, routes: TendonPaths, tendons: Tendons) -> _Canal:
        """Return the canal of a tendon of the tree before its first pulley."""
        tree, tendon = self._tree, self._tree.tendons[name]
        sources: dict[tuple[str, str], float] = {}
        # No path through space has a length below zero, at which its spring or its range would push.
        one_way = not tendon.friction
        if tendon.stiffness:
            sources["tendon_spring", name] = -1.0
            one_way &= tendon.path is not None and tendon.rest[0] <= 0.0
        if tendon.range is not None:
            sources["tendon_limit", name] = -1.0
            one_way &= tendon.path is not None and tendon.range[0] <= 0.0
        for key, each in tree.actuators.items():
            if each.tendon == name:
                sources[table_of(each), key] = -each.gear
                one_way &= each.only_pulls
        if tree.linked(name):
            sources[CORDS, name] = 1.0
        around = tendon.joints or {}
        bends = np.array([float(bool(around.get(joint))) for joint in self._joints])
        index = len(tendons.routing.tendons) + tree.rubbing.index(name)
        crossed = tree.crossed(name)[0][1]
        route = routes.routes[name]
        return _Canal(name, index, route, one_way, crossed, sources, tendon.curvature_offset, bends, tendon.friction)

    def _behind(self, trunk: _Canal, tendon: str, friction: dict[tuple[str, str], float]) -> list[_Canal]:
        """Return the branches of a tendon: what pulls them is what the trunk's friction leaves, divided."""
        found, parts = [], zip(trunk.route.branches, self._tree.crossed(tendon)[1:], strict=True)
        for number, ((divisor, legs), (_, crossed)) in enumerate(parts, start=1):
            if legs:
                sources = {key: weight / divisor for key, weight in (trunk.sources | friction).items()}
                route = TendonPath(np.zeros(len(self._joints)), legs)
                found.append(_Canal(f"{trunk.name}.{number}", trunk.tendon, route, trunk.one_way, crossed, sources))
        return found

    def _cords(self, cords: Mapping[str, Mapping[str, float]], known: Mapping[str, Rows], width: int) -> Rows:
        """Return the tensions of cords that turn joints."""
        actuators = self._tree.actuators
        shares = [{(table_of(actuators[key]), key): share for key, share in each.items()} for each in cords.values()]
        return Rows(
            group=CORDS,
            law=CORD_TENSION,
            names=tuple(cords),
            parameters=np.array([[float(not self._tree.opposed(name)) for name in cords]]),
            arm=np.zeros((len(cords), width)),
            inputs=_wired(shares, known),
            powers=(SOURCES,),
        )

    def _table(self, group: str, canals: list[_Canal], tendons: Tendons, known: Mapping[str, Rows], width: int) -> Rows:
        # Drawn in, a tendon gets shorter.
        routes = [each.route.times(-1.0) for each in canals]
        arm, bends = np.zeros((2, len(canals), width))
        for k, (each, route) in enumerate(zip(canals, routes, strict=True)):
            arm[k, : len(self._joints)] = route.coefficients
            bends[k, : each.bends.size] = each.bends
        numbers = tendons.canals[:, [each.tendon for each in canals]]
        # Drag is that of the whole tendon.
        numbers[-1] = np.maximum(numbers[-1], [each.drag for each in canals]) * (group == CANALS)
        one_way = np.array([each.one_way for each in canals], dtype=float)
        return Rows(
            group=group,
            law=CANAL_FRICTION,
            names=tuple(each.name for each in canals),
            parameters=np.vstack([numbers, one_way]),
            arm=arm,
            inputs=_wired([each.sources for each in canals], known),
            bends=bends,
            curvature_offset=np.array([each.offset for each in canals]),
            paths=tuple(route.legs for route in routes),
            stored=BRISTLES,
            powers=(*LOSSES, SLACK),
        )

    def _press(self, canals: list[_Canal], known: Mapping[str, Rows], counted: set[str]) -> None:
        """Record how tensions load the pins of the joints crossed by canals.

        Those of the tables that are counted already load them by themselves.
        """
        own = self.tables[-1].group
        for joint, name in enumerate(self._joints):
            if not self._tree.joints[name].bearing:
                continue
            for each in canals:
                for (group, row), weight in (each.sources | {(own, each.name): 1.0}).items():
                    if name in each.crossed and group not in counted:
                        press = self.loads.setdefault(group, np.zeros((len(self._joints), known[group].count)))
                        press[joint, known[group].names.index(row)] += weight


def _wired(sources: Sequence[Mapping[tuple[str, str], float]], known: Mapping[str, Rows]) -> dict[str, Array]:
    """Return the weights of earlier rows in the inputs of some, by table."""
    found: dict[str, Array] = {}
    for k, each in enumerate(sources):
        for (group, row), weight in each.items():
            weights = found.setdefault(group, np.zeros((len(sources), known[group].count)))
            weights[k, known[group].names.index(row)] += weight
    return found
