"""A tree of bodies from its description, and the rows of its tendons, couplings, loops, weights and actuators."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from finger_pin.description.caching import cached_property, memoised
from finger_pin.description.cords import Cord, CordElement
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import routing_parts
from finger_pin.description.tree import Tree
from finger_pin.description.tree_actuators import TreeActuator
from finger_pin.description.tree_couplings import Coupling
from finger_pin.exceptions import InputError
from finger_pin.mechanism.bodies import place_bodies
from finger_pin.mechanism.groups import ACTUATORS, ELASTIC, MUSCLES, STATEFUL, STATELESS, TIES, TREE_TABLES
from finger_pin.mechanism.path_elements import PathElement, Paths, PathTerm, Place
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.spans import ANGLE, RISE
from finger_pin.mechanism.tendon_paths import TendonPaths
from finger_pin.mechanism.wrenches import wrench_legs
from finger_pin.typing import Array

# Dry friction of a tendon holds until it has slid so far, m.
_DRY_STICTION = 1e-4
# How soon an actuator of limited rate follows its input, s.
_INPUT_LAG, _UNLIMITED = 1e-4, (-np.inf, np.inf)


class TreePaths(TendonPaths):
    """Tendons of a finger, with the rows of its tree: pieces of their paths are the same while no other part changes.

    Structures are built once for the same pieces.
    """

    @cached_property
    def tables(self) -> tuple[Rows, ...]:
        """Rows of the tree, without the friction of loaded tendons, for the coordinates of its joints."""
        return tuple(_tree_rows(self.description, self))


def build_body(description: FingerDescription, body: RigidBody | None = None) -> tuple[RigidBody, TreePaths]:
    """Return the rigid body that a finger's links or bodies make, with its gravity, and the tendons on it.

    Args:
        description: Of the finger.
        body: In place of the body that its links would make.
    """
    if body is None:
        return _tendons_on_bodies(description)
    if description.tree.bodies:
        raise InputError("rigid_body", "has no place beside a tree, whose bodies are its own")
    return body, TreePaths(body, description, {})


def _parts(description: FingerDescription) -> tuple[object, ...]:
    """Return the parts of a description that its tendons and the rows of its tree depend on."""
    couplings = description.tree.couplings.values()
    middles = (description.joints[each.other].range for each in couplings if each.other and any(each.higher))
    ties = description.couplings.values()
    return (place_bodies(description)[0], *routing_parts(description), *middles, *ties)


@memoised(_parts)
def _tendons_on_bodies(description: FingerDescription) -> tuple[RigidBody, TreePaths]:
    body, placed = place_bodies(description)
    return body, TreePaths(body, description, placed)


def along_paths(description: FingerDescription, paths: TendonPaths, table: Rows) -> Rows:
    """Return a table of tendons with those along paths of a tree: drawn in, a tendon gets shorter.

    The curvature of driven ones is that of the first place where they rub.
    """
    if (table.group != "driven_tendons" and not table.pulls) or not paths.cords:
        return table
    names, arm = table.pulls or table.names, table.arm.copy()
    arm[:, : len(description.joints)], legs = paths.along([paths.routing.cords[name].wraps[0] for name in names], -1.0)
    drawn = [paths.reference_lengths.get(description.tendons[name].along, 0.0) for name in names]
    return replace(table, arm=arm, measure=arm, offset=table.offset + drawn, paths=legs)


def _tree_rows(description: FingerDescription, routes: TendonPaths) -> list[Rows]:
    """Return the rows of a tree, without the friction of loaded tendons, and of all couplings, for its joints."""
    tree, width = description.tree, len(description.joints)

    def table(group: str, names: Iterable[str], numbers: _Numbers, along: tuple[Array, Paths], **further: Any) -> Rows:
        arms, paths = along
        arm = np.zeros((len(arms), width))
        arm[:, : arms.shape[1]] = arms
        law, stored, powers = TREE_TABLES[group]
        parameters = np.array(numbers, dtype=float).T
        return Rows(group, law, tuple(names), parameters, arm, paths=paths, stored=stored, powers=powers, **further)

    described = (
        *_tendons(tree, routes),
        *(_couplings(group, description, routes) for group in ("coupling", TIES)),
        _loops(tree, routes),
        _weights(description, routes),
    )
    tables = [table(*each) for each in described if each[1]]
    cords = {name: each for name, each in tree.tendons.items() if each.slack is not None}
    if cords:
        along = routes.along([routes.cords[name] for name in cords], -1.0)
        offset = np.array([routes.reference_lengths[name] + (each.slack or 0.0) for name, each in cords.items()])
        numbers = [(each.stiffness, each.damping) for each in cords.values()]
        tables.append(table(ELASTIC, cords, numbers, along, offset=offset, unit="m"))
    first = len(description.actuated_names)
    for group in ACTUATORS:
        actuators = {name: each for name, each in tree.actuators.items() if actuator_table(each) == group}
        if actuators:
            arms, paths = zip(*(_driven(each, routes) for each in actuators.values()), strict=True)
            channels = first + np.array([list(tree.actuators).index(name) for name in actuators])
            parameters = [_actuator(each) for each in actuators.values()]
            tables.append(table(group, actuators, parameters, (np.vstack(arms), paths), channels=channels))
    return tables


_Numbers = Sequence[Sequence[float]]
_Described = tuple[str, Collection[str], _Numbers, tuple[Array, Paths]]


def _about(joint: str, radius: float = -1.0) -> Cord:
    """Return a cord about one joint, by default as long as the joint's coordinate."""
    return Cord((CordElement(joint, frozenset({joint}), radius),))


def _driven(actuator: TreeActuator, routes: TendonPaths) -> tuple[Array, Sequence[PathTerm]]:
    """Return the arm of what an actuator drives, shape (n,), and its path."""
    if actuator.wrench:
        return np.zeros(len(routes.description.joints)), wrench_legs(routes.placed, actuator.wrench, actuator.gear)
    kind, name = actuator.drives
    (arm,), (path,) = routes.along([_about(name) if kind == "joint" else routes.cords[name]], actuator.gear)
    return arm, path


def _tendons(tree: Tree, routes: TendonPaths) -> list[_Described]:
    """Return springs, ranges, and the dry friction of tendons that no load presses."""
    tendons = tree.tendons
    sprung = {name: each for name, each in tendons.items() if each.slack is None and (each.stiffness or each.damping)}
    limited = {name: each for name, each in tendons.items() if each.range is not None}
    loaded = {*tree.rubbing}
    rubbing = {name: each for name, each in tendons.items() if each.friction and name not in loaded}
    springs = [(each.stiffness, *each.rest, each.damping) for each in sprung.values()]
    limits = [each.limiter for each in limited.values()]
    # Law (9) whose level is its floor.
    level = [(0, 0, each.friction / _DRY_STICTION, 0, 1, each.friction, 1, 0, 0, 0, 0, 0) for each in rubbing.values()]
    return [
        (group, names, numbers, routes.along(routes.cords[name] for name in names))
        for group, names, numbers in (
            ("tendon_spring", sprung, springs),
            ("tendon_limit", limited, limits),
            ("tendon_dry_friction", rubbing, level),
        )
    ]


def _couplings(group: str, description: FingerDescription, routes: TendonPaths) -> _Described:
    """Return the springs that hold joints or tendons to others: each is a constraint q - f(q_other)."""
    couplings = description.couplings if group == TIES else description.tree.couplings
    ends, numbers, starts = list[tuple[Array, Paths]](), list[Sequence[float]](), {**routes.reference_lengths}
    cords: Mapping[str, Cord] = routes.cords
    if group == TIES:
        cords = routes.routing.cords
        starts = {name: starts.get(tendon.along, 0.0) for name, tendon in description.tendons.items()}
    for each in couplings.values():
        names = (each.follower, *([each.other] if each.other else ()))
        factors, rest = (1.0, -each.slope)[: len(names)], each.offset
        if each.tendon:
            rest += sum(factor * starts[name] for factor, name in zip(factors, names, strict=True))
        ends.append(routes.along((cords[name] if each.tendon else _about(name) for name in names), factors))
        numbers.append((each.stiffness, rest, each.damping))
    arms = np.array([arm.sum(axis=0) for arm, _ in ends])
    paths = tuple(
        (*chain(*legs), *_higher_powers(description, routes, each))
        for (_, legs), each in zip(ends, couplings.values(), strict=True)
    )
    return group, couplings, numbers, (arms, paths)


def _higher_powers(description: FingerDescription, routes: TendonPaths, coupling: Coupling) -> tuple[PathTerm, ...]:
    """Return the powers of the other coordinate beyond the first in a coupling, as a path."""
    if coupling.other is None or not any(coupling.higher):
        return ()
    tree = description.tree
    # An angle is measured from its range's middle, so that it never comes to half a turn.
    model, middle = routes.body.model, 0.5 * sum(description.joints[coupling.other].range)
    index = list(tree.joints).index(coupling.other) + 1
    hinge, axis = tree.joints[coupling.other].kind == "hinge", np.array(tree.joints[coupling.other].axis)
    upright = _upright(axis)
    powers = Polynomial([0.0, 0.0, *coupling.higher])(Polynomial([middle, 1.0])).coef
    numbers = np.array([*powers.tolist(), *np.zeros(len(ANGLE.parameters) - len(powers))])
    parent = int(model.parents[index])
    frame = model.jointPlacements[index] * pin.SE3(upright, np.zeros(3))
    if hinge:
        moved = Place(index, upright @ np.array([math.cos(middle), -math.sin(middle), 0.0]))
        piece = PathElement(ANGLE, numbers, (moved, Place(parent, np.array(frame.translation))), parent, frame)
    else:
        still = Place(parent, np.array(frame.act(np.array([0.0, 0.0, middle]))))
        piece = PathElement(RISE, numbers, (still, Place(index, np.zeros(3))), parent, frame)
    return (PathTerm(piece, arm=-1.0),)


def _loops(tree: Tree, routes: TendonPaths) -> _Described:
    """Return the springs that hold points of bodies together, one along each axis of the base."""
    heights = {}
    for name, loop in tree.loops.items():
        first, second = routes.placed[loop.body], routes.placed[loop.other]
        for axis, unit in zip("xyz", np.eye(3), strict=True):
            heights[f"{name}.{axis}"] = _height(first.place(loop.position), second.place(loop.other_position), unit)
    numbers = [(loop.stiffness, 0.0, loop.damping) for loop in tree.loops.values() for _ in "xyz"]
    return "loop", heights, numbers, (np.zeros((len(heights), 1)), tuple(heights.values()))


def _weights(description: FingerDescription, routes: TendonPaths) -> _Described:
    """Return the forces that hold up a part of bodies' weight."""
    tree, gravity = description.tree, np.array(description.gravity)
    size = float(np.linalg.norm(gravity))
    compensated = {
        name: each
        for name, each in tree.bodies.items()
        if size and each.gravity_compensation and each.mass and routes.placed[name].joint
    }
    base, places = Place(0, np.zeros(3)), routes.placed
    heights = tuple(
        _height(base, places[name].place(each.centre), -gravity / size) for name, each in compensated.items()
    )
    numbers = [(each.gravity_compensation * each.mass * size,) for each in compensated.values()]
    return "gravity_compensation", compensated, numbers, (np.zeros((len(heights), 1)), heights)


def _height(first: Place, second: Place, axis: Array) -> tuple[PathTerm]:
    """Return the height of one point above another along an axis of the base, a unit vector, as a path."""
    numbers = np.eye(len(RISE.parameters))[1]
    return (PathTerm(PathElement(RISE, numbers, (first, second), 0, pin.SE3(_upright(axis), np.zeros(3)))),)


def _upright(axis: Array) -> Array:
    """Return a rotation whose z axis is a unit vector."""
    turned: Array = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
    return turned


def actuator_table(actuator: TreeActuator) -> str:
    """Return the name of the table that an actuator's row stands in."""
    if actuator.muscle is not None:
        return MUSCLES
    return STATEFUL if actuator.has_state else STATELESS


def _actuator(actuator: TreeActuator) -> tuple[float, ...]:
    """Return the numbers of an actuator's law."""
    if (muscle := actuator.muscle) is not None:
        origin = muscle.length_range[0] - muscle.range[0] * muscle.optimal_length
        shape = muscle.lmin, muscle.lmax, muscle.vmax, muscle.fpmax, muscle.fvmax
        peak = muscle.force, muscle.optimal_length, origin
        return *peak, *shape, *muscle.time_constants, muscle.smoothing, *actuator.excitations
    bounds = (*(actuator.input_range or _UNLIMITED), *(actuator.force_range or _UNLIMITED))
    bias = actuator.offset, actuator.by_length, actuator.by_speed, *bounds
    if not actuator.has_state:
        return actuator.gain, *bias
    if actuator.integral:
        law, state = actuator.gain, (actuator.integral, 1.0, -1.0, 0.0)
    else:  # What it holds takes the place of its input.
        lag = actuator.time_constant or (0.0 if actuator.slew is None else _INPUT_LAG)
        law, state = 0.0, (actuator.gain, 1.0 / (lag or 1.0), 0.0, -1.0 / lag if lag else 0.0)
    return law, *bias, *state, *(actuator.state_range or _UNLIMITED), actuator.slew or np.inf
