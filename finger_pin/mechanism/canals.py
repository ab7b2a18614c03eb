"""Friction of tendons that other rows pull (14), (16): tendons of a tree, branches behind pulleys, further wraps.

A tendon of a tree is pulled by its spring, its range, couplings, actuators, or what drives the joint that it winds
about; its friction is a row that exerts what the canal changes of their tension. A pulley divides the tension that
friction has left, and each branch behind it rubs by its own bend at its own tension, as it slides by itself.

Where tendons rub at their bends, each wrap is such a row: along the tendon from there to its end, pulled by what the
wraps before have left. With T_(k-1) and T_k before and behind wrap k, joints between it and the next one feel T_k, and
sum_k r_k theta_k' T_k = v_1 T_0 - sum_k v_k (T_(k-1) - T_k): what each wrap takes at its own speed v_k is lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from finger_pin.description.cords import Cord
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree_actuators import drivers
from finger_pin.description.tree_couplings import coupled
from finger_pin.laws.capstan import CANAL_FRICTION, CORD_TENSION
from finger_pin.mechanism.groups import BRANCHES, CANALS, CORDS, ELASTIC, SOURCES, TENDON_LOSSES, WRAPS
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.tendons import BRISTLES, SLACK, Tendons, numbers_at
from finger_pin.mechanism.tree_mechanism import actuator_table
from finger_pin.typing import Array


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
            tendons: With wraps and numbers of friction, those of canals after the finger's own.
            rows: Earlier rows: those of the tree, and of the finger's tendons.
            drive_matrices: Weights with which drives pull the actuated tendons, by table.
            width: Number of coordinates.
        """
        self._description, self._tree, self._tendons, self._paths = description, description.tree, tendons, paths
        self._joints, self._width = tuple(description.joints), width
        self.tables: list[Rows] = []
        self.loads: dict[str, Array] = {}
        # They load the pins by themselves.
        self._loading = {"driven_tendons", *drive_matrices}
        rubbing = self._tree.rubbing
        shares = {name: self._tree.linked[name] for name in rubbing if name in self._tree.linked}
        cords = [self._cords(shares, rows)] if shares else []
        own, actuated = len(tendons.routing.tendons), tendons.routing.actuated
        pulls = [self._pull(name) for name in rubbing]
        self._one_way = np.array(
            [not any(each) for each in tendons.coupled] + [pulls_only for _, pulls_only in pulls], float
        )
        canals = list(zip((*tendons.routing.tendons, *rubbing), range(own + len(pulls)), tendons.wraps, strict=True))
        # By table, weights of its rows in the tension of every canal, which wraps change.
        tension = {
            group: np.eye(len(canals), actuated) @ weights[:actuated]
            for group, weights in {**drive_matrices, "driven_tendons": np.eye(actuated)}.items()
        }
        tension |= _input_weights([{}] * own + [sources for sources, _ in pulls], (*rows, *cords))
        self._add_wraps(WRAPS, canals, range(actuated), tension, first=2)
        self.wraps = {table.group: tension[table.group][:own] for table in self.tables}
        self.tables += cords
        self._add_wraps(CANALS, canals, range(own, len(canals)), tension)
        # Each rubs by itself at the tension that the pulley divides.
        branches = [
            (f"{name}.{number}", k, branch)
            for name, k, wraps in (*canals[own:], *canals[:actuated])
            for number, branch in enumerate(wraps[0].branches, start=1)
            if branch.elements
        ]
        trunks, divisors = [k for _, k, _ in branches], np.array([[branch.divisor] for _, _, branch in branches])
        self._add_wraps(
            BRANCHES,
            [(name, k, branch.wraps) for name, k, branch in branches],
            range(len(branches)),
            {group: weights[trunks] / divisors for group, weights in tension.items() if branches},
        )

    def _add_wraps(
        self,
        group: str,
        canals: Sequence[tuple[str, int, Sequence[Cord]]],
        rubbing: Sequence[int],
        tension: dict[str, Array],
        first: int = 1,
    ) -> None:
        """Add the tables of friction at wraps, first to last, and note how each changes its canal's tension.

        Args:
            group: Name of the tables.
            canals: Name, index of the numbers of friction, and wraps of each.
            rubbing: Which of them.
            tension: By table, weights of rows in the tension of every canal; those of wraps are added.
            first: Which wrap is the first, from 1.
        """
        for level in range(first, 1 + max((len(canals[k][2]) for k in rubbing), default=0)):
            at = [k for k in rubbing if len(canals[k][2]) >= level]
            wraps = [canals[k][2][level - 1] for k in at]
            names = [canals[k][0] + f".{wrap.name}" * (level > 1) for k, wrap in zip(at, wraps, strict=True)]
            table = f"{group}_{level}" if level > 1 else group
            inputs = {key: weights[at] for key, weights in tension.items() if np.any(weights[at])}
            self.tables.append(self._table(table, names, wraps, [canals[k][1] for k in at], inputs))
            # What pulls loads the pins of all joints that the whole canal crosses.
            self._load_pins(wraps, {**(inputs if level == 1 else {}), table: np.eye(len(at))})
            tension[table] = np.eye(len(canals))[:, at]

    def _pull(self, name: str) -> tuple[dict[tuple[str, str], float], bool]:
        """Return what pulls a tendon of the tree, by table and row, and whether all of it never pushes."""
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
        for key, actuator in drivers(tree.actuators, "tendon", name).items():
            sources[actuator_table(actuator), key] = -actuator.gear
            one_way &= actuator.only_pulls
        for key, part in coupled(tree.couplings, name).items():
            sources["coupling", key] = part
            one_way = False
        if name in tree.linked:
            sources[CORDS, name] = 1.0
        return sources, one_way

    def _cords(self, cords: Mapping[str, Mapping[str, float]], rows: Sequence[Rows]) -> Rows:
        """Return the tensions of cords that turn joints."""
        tree, actuators = self._tree, self._tree.actuators
        shares = [
            {(actuator_table(actuators[key]), key): share for key, share in each.items()} for each in cords.values()
        ]
        return Rows(
            group=CORDS,
            law=CORD_TENSION,
            names=tuple(cords),
            parameters=np.array([[float(name not in tree.opposed) for name in cords]]),
            arm=np.zeros((len(cords), self._width)),
            inputs=_input_weights(shares, rows),
            powers=(SOURCES,),
        )

    def _table(
        self, group: str, names: Sequence[str], wraps: Sequence[Cord], tendons: Sequence[int], inputs: dict[str, Array]
    ) -> Rows:
        # Drawn in, a tendon gets shorter.
        arms, paths = self._paths.along(wraps, -1.0)
        arm, bends = np.zeros((2, len(wraps), self._width))
        arm[:, : len(self._joints)] = arms
        bends[:, : len(self._joints)] = [wrap.turns(self._joints) for wrap in wraps]
        # Drag is that of the whole tendon, before it is divided.
        source = numbers_at(tendons, wraps, not group.startswith(BRANCHES))
        return Rows(
            group=group,
            law=CANAL_FRICTION,
            names=tuple(names),
            parameters=np.vstack([source.numbers(self._tendons), self._one_way[tendons]]),
            arm=arm,
            inputs=inputs,
            bends=bends,
            curvature_offset=np.array([wrap.offset for wrap in wraps]),
            paths=paths,
            stored=BRISTLES,
            powers=(*TENDON_LOSSES, SLACK),
            source=source,
        )

    def _load_pins(self, wraps: Sequence[Cord], tension: Mapping[str, Array]) -> None:
        """Record how rows load the pins of the joints that wraps cross, by their weights in the wraps' tensions."""
        bearings = zip(self._joints, self._description.bearings, strict=True)
        joints = [wrap.crossed for wrap in wraps]
        crossed = np.array([[float(rubs and name in each) for each in joints] for name, rubs in bearings])
        for group, weights in tension.items():
            if group not in self._loading and np.any(pressing := crossed @ weights):
                self.loads[group] = self.loads.get(group, 0.0) + pressing


def _input_weights(sources: Sequence[Mapping[tuple[str, str], float]], tables: Sequence[Rows]) -> dict[str, Array]:
    """Return the weights of earlier rows in the inputs of some, by table."""
    rows, inputs = {table.group: table.names for table in tables}, dict[str, Array]()
    for k, source in enumerate(sources):
        for (group, row), weight in source.items():
            weights = inputs.setdefault(group, np.zeros((len(sources), len(rows[group]))))
            weights[k, rows[group].index(row)] += weight
    return inputs
