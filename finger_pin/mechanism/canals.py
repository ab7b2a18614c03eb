"""Friction of tendons that other rows pull (14), (16): tendons of a tree, branches behind pulleys, further wraps.

A tendon of a tree is pulled by its spring, its range, actuators, or what drives the joint that it winds about; its
friction is a row that exerts what the canal changes of their tension. A pulley divides the tension that friction has
left, and each branch behind it rubs by its own bend at its own tension, as it slides by itself.

Where tendons rub at their bends, each wrap is such a row: along the tendon from there to its end, pulled by what the
wraps before have left. With T_(k-1) and T_k before and behind wrap k, joints between it and the next one feel T_k, and
sum_k r_k theta_k' T_k = v_1 T_0 - sum_k v_k (T_(k-1) - T_k): what each wrap takes at its own speed v_k is lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.laws.capstan import CANAL_FRICTION, CORD_TENSION
from finger_pin.mechanism.groups import BRANCHES, CANALS, CORDS, ELASTIC, TENDON_LOSSES, WRAPS
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.tendons import BRISTLES, SLACK, SOURCES, Tendons
from finger_pin.mechanism.tree_mechanism import actuator_table
from finger_pin.typing import Array


class _Canal(NamedTuple):
    """A canal, or one of the places where it rubs.

    Attributes:
        name: Of the tendon, and which branch.
        tendon: Index of its numbers of friction.
        cord: Along which it acts.
        one_way: Whether what pulls never pushes.
        sources: By table of earlier rows and the names of these, parts of their forces that are its tension.
        drag: Level without load, N.
    """

    name: str
    tendon: int
    cord: Cord
    one_way: bool
    sources: dict[tuple[str, str], float]
    drag: float = 0.0


class Canals:
    """Canals of a tree's tendons, and wraps of the finger's own beyond their first.

    Attributes:
        tables: Their rows, none without any.
        loads: By table, weights with which rows load the pins of joints, shape (n, rows).
        wraps: By table of the own tendons' wraps, which row is of which tendon, shape (t, rows).
    """

    def __init__(
        self,
        description: FingerDescription,
        paths: TendonPaths,
        tendons: Tendons,
        rows: Sequence[Rows],
        drive_matrices: Mapping[str, Array],
        width: int,
    ) -> None:
        """Read the canals.

        Args:
            description: Of the finger.
            paths: The tendons of its tree.
            tendons: With the numbers of friction, those of canals after the finger's own.
            rows: Earlier rows: those of the tree, and of the finger's tendons.
            drive_matrices: Weights with which drives pull the actuated tendons, by table.
            width: Number of coordinates.
        """
        self.tables: list[Rows] = []
        self.loads: dict[str, Array] = {}
        self.wraps: dict[str, Array] = {}
        self._description, self._tree, self._tendons, self._paths = description, description.tree, tendons, paths
        self._joints, self._width = tuple(description.joints), width
        self._tables_by_group = {table.group: table for table in rows}
        # They load the pins by themselves.
        self._loading = {"driven_tendons", *drive_matrices}
        actuated = [
            self._actuated(index, name, drive_matrices) for index, name in enumerate(description.actuated_names)
        ]
        tension_terms = {each.name: {("driven_tendons", each.name): 1.0} for each in actuated}
        self._add_wraps(WRAPS, actuated, tension_terms, 2)
        for table in self.tables:
            tendon = {row: index for index, each in enumerate(actuated) for _, row in tension_terms[each.name]}
            self.wraps[table.group] = np.eye(len(tendons.routing.tendons))[:, [tendon[name] for name in table.names]]
        # Asked once: of many cords it takes as many looks at all actuators.
        rubbing = self._tree.rubbing
        cords = {name: shares for name in rubbing if (shares := self._tree.linked(name))}
        if cords:
            self._tables_by_group[CORDS] = self._cords(cords)
            self.tables.append(self._tables_by_group[CORDS])
        own = len(tendons.routing.tendons)
        trunks = [self._trunk(name, index) for index, name in enumerate(rubbing, start=own)]
        tension_terms |= {each.name: {} for each in trunks}
        self._add_wraps(CANALS, trunks, tension_terms)
        branches = [
            branch
            for each in (*trunks, *actuated)
            for branch in self._branches_behind_pulley(each, tension_terms[each.name])
        ]
        self._add_wraps(BRANCHES, branches, {each.name: {} for each in branches})

    def _add_wraps(
        self,
        group: str,
        canals: Sequence[_Canal],
        tension_terms: dict[str, dict[tuple[str, str], float]],
        first: int = 1,
    ) -> None:
        """Add the tables of friction at wraps, first to last, and note how each changes its canal's tension.

        Args:
            group: Name of the tables.
            canals: Canals.
            tension_terms: By canal, rows that change its tension by their forces; those of wraps are added.
            first: Which wrap is the first, from 1.
        """
        wraps = {canal.name: canal.cord.wraps for canal in canals}
        for level in range(first, 1 + max(map(len, wraps.values()), default=0)):
            wrap_group = f"{group}_{level}" if level > 1 else group
            rubbing = [canal for canal in canals if len(wraps[canal.name]) >= level]
            at_wraps = [
                canal._replace(
                    name=canal.name if level == 1 else f"{canal.name}.{wraps[canal.name][level - 1].name}",
                    cord=wraps[canal.name][level - 1],
                    sources=canal.sources | tension_terms[canal.name],
                )
                for canal in rubbing
            ]
            self._tables_by_group[wrap_group] = self._table(wrap_group, at_wraps)
            self.tables.append(self._tables_by_group[wrap_group])
            self._record_joint_loads(wrap_group, at_wraps, whole=level == 1)
            for canal, at_wrap in zip(rubbing, at_wraps, strict=True):
                tension_terms[canal.name][wrap_group, at_wrap.name] = 1.0

    def _actuated(self, index: int, name: str, drive_matrices: Mapping[str, Array]) -> _Canal:
        """Return the canal of an actuated tendon, with all rows that pull it."""
        drives = {
            (group, self._tables_by_group[group].names[k]): float(weights[index, k])
            for group, weights in drive_matrices.items()
            for k in np.flatnonzero(weights[index])
        }
        return _Canal(name, index, self._description.cord(name), True, drives)

    def _trunk(self, name: str, index: int) -> _Canal:
        """Return the canal of a tendon of the tree before its first pulley.

        Its index is that of its friction, after the finger's own tendons.
        """
        tree, tendon = self._tree, self._tree.tendons[name]
        sources: dict[tuple[str, str], float] = {}
        # No path through space has a length below zero, at which its spring or its range would push.
        one_way = not tendon.friction
        if tendon.slack is not None:
            sources[ELASTIC, name] = 1.0
        elif tendon.stiffness:
            sources["tendon_spring", name] = -1.0
            one_way &= tendon.joints is None and tendon.rest[0] <= 0.0
        if tendon.range is not None:
            sources["tendon_limit", name] = -1.0
            one_way &= tendon.joints is None and tendon.range[0] <= 0.0
        for key, actuator in tree.actuators.items():
            if actuator.tendon == name:
                sources[actuator_table(actuator), key] = -actuator.gear
                one_way &= actuator.only_pulls
        if tree.linked(name):
            sources[CORDS, name] = 1.0
        return _Canal(name, index, self._description.cord(name), one_way, sources, tendon.friction)

    def _branches_behind_pulley(self, trunk: _Canal, friction: dict[tuple[str, str], float]) -> list[_Canal]:
        """Return the branches of a tendon behind a pulley, pulled by the trunk's tension after friction, divided."""
        return [
            _Canal(
                f"{trunk.name}.{number}",
                trunk.tendon,
                branch,
                trunk.one_way,
                {key: weight / branch.divisor for key, weight in (trunk.sources | friction).items()},
            )
            for number, branch in enumerate(trunk.cord.branches, start=1)
            if branch.elements
        ]

    def _cords(self, cords: Mapping[str, Mapping[str, float]]) -> Rows:
        """Return the tensions of cords that turn joints."""
        tree, actuators = self._tree, self._tree.actuators
        shares = [
            {(actuator_table(actuators[key]), key): share for key, share in each.items()} for each in cords.values()
        ]
        return Rows(
            group=CORDS,
            law=CORD_TENSION,
            names=tuple(cords),
            parameters=np.array([[float(not tree.opposed(name)) for name in cords]]),
            arm=np.zeros((len(cords), self._width)),
            inputs=_input_weights(shares, self._tables_by_group),
            powers=(SOURCES,),
        )

    def _table(self, group: str, canals: Sequence[_Canal]) -> Rows:
        # Drawn in, a tendon gets shorter.
        routes = [self._paths.along(canal.cord, -1.0) for canal in canals]
        arm, bends = np.zeros((2, len(canals), self._width))
        arm[:, : len(self._joints)] = [route.coefficients for route in routes]
        bends[:, : len(self._joints)] = [canal.cord.turns(self._joints) for canal in canals]
        numbers = self._tendons.at([canal.tendon for canal in canals], [canal.cord for canal in canals])
        # Drag is that of the whole tendon, before it is divided.
        numbers[-1] = np.maximum(numbers[-1], [canal.drag * canal.cord.share for canal in canals]) * (
            not group.startswith(BRANCHES)
        )
        one_way = np.array([canal.one_way for canal in canals], dtype=float)
        return Rows(
            group=group,
            law=CANAL_FRICTION,
            names=tuple(canal.name for canal in canals),
            parameters=np.vstack([numbers, one_way]),
            arm=arm,
            inputs=_input_weights([canal.sources for canal in canals], self._tables_by_group),
            bends=bends,
            curvature_offset=np.array([canal.cord.offset for canal in canals]),
            paths=tuple(route.legs for route in routes),
            stored=BRISTLES,
            powers=(*TENDON_LOSSES, SLACK),
        )

    def _record_joint_loads(self, wrap_group: str, canals: Sequence[_Canal], *, whole: bool) -> None:
        """Record how tensions and friction of canals load the joints that they cross."""
        for joint, (name, rubs) in enumerate(zip(self._joints, self._description.bearings, strict=True)):
            if not rubs:
                continue
            for canal in canals:
                pressing = canal.sources if whole else {}
                for (group, row), weight in (pressing | {(wrap_group, canal.name): 1.0}).items():
                    if name in canal.cord.crossed and group not in self._loading:
                        press = self.loads.setdefault(
                            group, np.zeros((len(self._joints), self._tables_by_group[group].count))
                        )
                        press[joint, self._tables_by_group[group].names.index(row)] += weight


def _input_weights(sources: Sequence[Mapping[tuple[str, str], float]], tables: Mapping[str, Rows]) -> dict[str, Array]:
    """Return the weights of earlier rows in the inputs of some, by table."""
    inputs: dict[str, Array] = {}
    for k, source in enumerate(sources):
        for (group, row), weight in source.items():
            weights = inputs.setdefault(group, np.zeros((len(sources), tables[group].count)))
            weights[k, tables[group].names.index(row)] += weight
    return inputs
