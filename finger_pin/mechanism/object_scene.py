"""Scene of a finger: objects, free ones as further bodies, and all contacts."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.links import link_body
from finger_pin.description.objects import Object
from finger_pin.description.placement import Palm
from finger_pin.description.tree_actuators import Wrench
from finger_pin.exceptions import InputError
from finger_pin.laws.spring import JOINT_SPRING
from finger_pin.mechanism.body_places import Placed
from finger_pin.mechanism.contact_rows import check_start, contact_rows
from finger_pin.mechanism.evaluation import ContactPoints
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.path_elements import PathTerm
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Energy, Rows
from finger_pin.mechanism.solids import WORLD, add_free_objects, body_solids, object_solids, pairs_apart, pairs_within
from finger_pin.mechanism.state import State
from finger_pin.mechanism.wrenches import wrench_legs
from finger_pin.typing import Array

#: Numbers of a free object's pose (position, quaternion), and of its velocity.
POSE, VELOCITY = 7, 6


def _touching(
    topology: Hashable,
    objects: Mapping[str, Object],
    description: FingerDescription,
    _: RigidBody,
    width: int,
    placed: object,
) -> tuple[object, ...]:
    """Return all that contacts depend on, which is neither the mass nor the motion of objects."""
    shapes = (
        (name, each.moves, each.mass is None, each.frame, each.shape, each.sizes, each.surface, each.apart, *place)
        for name, each in objects.items()
        for place in [(each.position, each.orientation)]
    )
    of_bodies = (
        (key, each.continues, each.shape, each.sizes, each.surface, each.position, each.orientation)
        for body in description.bodies.bodies.values()
        for key, each in body.shapes.items()
    )
    hand = description.hand
    pairs = hand and hand.fingers_touch, frozenset(pairs_within(description))
    return (topology, *pairs, width, *of_bodies, *shapes)


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects around a finger.

    Attributes:
        objects: All objects, by name.
        free: Objects that move, freely or along paths.
        body: The finger's rigid body, and the free objects after its joints.
        contacts: Between links and objects, links of different fingers, and objects.
        turning: Paths whose arms are those of torques about the axes of free objects, by name.
    """

    objects: Mapping[str, Object]
    free: Mapping[str, Object]
    body: RigidBody
    contacts: Rows
    turning: Mapping[str, tuple[tuple[PathTerm, ...], ...]]

    @classmethod
    def from_mechanism(
        cls,
        mechanism: Mechanism,
        objects: Mapping[str, Object] | None,
        description: FingerDescription,
        placed: Mapping[str | None, Placed],
    ) -> Scene | None:
        """Return the scene of a finger with a tree's own objects and given ones; None if nothing can touch anything."""
        hand = description.hand
        if description.tree.objects:
            objects = {**description.tree.objects, **(objects or {})}
        if objects is None and (description.touches_itself or (hand is not None and hand.fingers_touch)):
            objects = {}
        return None if objects is None else cls.from_objects(objects, description, mechanism, placed)

    @classmethod
    def from_objects(
        cls,
        objects: Mapping[str, Object],
        description: FingerDescription,
        mechanism: Mechanism,
        placed: Mapping[str | None, Placed],
    ) -> Scene:
        """Put objects around a finger.

        Args:
            objects: By name.
            description: The finger.
            mechanism: The finger alone.
            placed: Places of a tree's bodies.
        """
        hand = description.hand
        extended = add_free_objects(mechanism.body, objects, hand.palm if hand and mechanism.moved else None)
        free = {name: obj for name, obj in objects.items() if extended.model.existJointName(f"{name}_attitude")}
        for name, obj in free.items():
            if (obj.damping or obj.angular_damping) and mechanism.moved:
                entry = "damping" if obj.damping else "angular_damping"
                allowed = "is for a palm at rest, in whose frame speeds are: leave out hand.palm.path"
                raise InputError(f"environment.objects.{name}.{entry}", allowed, getattr(obj, entry))
            if obj.path and mechanism.moved:
                raise InputError(f"environment.objects.{name}.path", "is for a palm at rest; leave out hand.palm.path")
        width = int(extended.model.nv) + len(mechanism.lumps)
        pieces = cls._pieces(mechanism.body.topology, objects, description, extended, width, placed)
        return cls(objects, free, extended, *pieces)

    @staticmethod
    @memoised(_touching)
    def _pieces(
        topology: Hashable,
        objects: Mapping[str, Object],
        description: FingerDescription,
        extended: RigidBody,
        width: int,
        placed: Mapping[str | None, Placed],
    ) -> tuple[Rows, dict[str, tuple[tuple[PathTerm, ...], ...]]]:
        """Return the contacts of links and objects, and the paths about the axes of free objects."""
        hand = description.hand
        # Of a model of the user's own joints have the places of links.
        places = placed or {
            link_body(name): Placed(k, pin.SE3.Identity()) for k, name in enumerate(description.joints, 1)
        }
        bodies = body_solids(description.bodies, places, extended)
        if hand is not None and hand.fingers_touch is False:
            bodies = [replace(each, group=hand.name) for each in bodies]
        for name in objects:
            for kind, names in (("joint", description.joints), ("shape", [each.name for each in bodies])):
                if name in names:
                    raise InputError(f"environment.objects.{name}", f"a {kind} has this name; choose another")
        solids = [*bodies, *object_solids(objects, extended)]
        never = pairs_apart(objects, [each.name for each in solids])
        turning = dict[str, tuple[tuple[PathTerm, ...], ...]]()
        for name in [name for name in objects if extended.model.existJointName(f"{name}_attitude")]:
            body: dict[str | None, Placed] = {
                name: Placed(int(extended.model.getJointId(f"{name}_attitude")), pin.SE3.Identity())
            }
            turns = [Wrench(body=name, torque=tuple(unit)) for unit in np.eye(3).tolist()]
            turning[name] = tuple(wrench_legs(body, turn, 1.0) for turn in turns)
        return contact_rows(solids, width, pairs_within(description), never), turning

    def extend(self, mechanism: Mechanism) -> Mechanism:
        """Return a mechanism with the scene: free objects after the joints, contacts before all other rows.

        What contacts exert loads the pins of joints, so they are evaluated first.
        """
        joints, bodies, lumps = int(mechanism.body.model.nv), int(self.body.model.nv), len(mechanism.lumps)
        places = np.append(np.arange(joints), bodies + np.arange(lumps))
        width = bodies + lumps
        rows = [table.embed_coordinates(places, width) for table in mechanism.listed]
        before = int(mechanism.prescribed.max(initial=-1)) + 1
        kept = mechanism.lumps, mechanism.inertia, mechanism.channels, mechanism.moved
        prescribed = np.full(bodies + lumps, -1)
        prescribed[places] = mechanism.prescribed
        prescribed[bodies - len(self.world) : bodies] = np.arange(len(self.world))
        on_paths = [joints + VELOCITY * index for index, each in enumerate(self.free.values()) if each.mass is None]
        for number, first in enumerate(on_paths):
            prescribed[first : first + VELOCITY] = before + VELOCITY * number + np.arange(VELOCITY)
        dampers = self._dampers(joints, width)
        return Mechanism(self.body, [self.contacts, *rows, *dampers], *kept, prescribed, mechanism.tendons)

    def _dampers(self, first: int, width: int) -> list[Rows]:
        """Return the table of dampers of free objects, whose coordinates begin at a given one, if there are any."""
        names, numbers, arms, paths = list[str](), list[float](), list[Array](), list[tuple[PathTerm, ...]]()
        for k, (name, each) in enumerate(self.free.items()):
            for axis, about, arm in zip("xyz", self.turning[name], np.eye(3, width, first + VELOCITY * k), strict=True):
                if each.damping:
                    names, numbers = [*names, f"{name}.{axis}"], [*numbers, each.damping]
                    arms, paths = [*arms, arm], [*paths, ()]
                if each.angular_damping:
                    # Within a step, coordinates of attitudes are angles about three axes, not turns about the body's.
                    names, numbers = [*names, f"{name}.about_{axis}"], [*numbers, each.angular_damping]
                    arms, paths = [*arms, np.zeros(width)], [*paths, about]
        damping, powers = np.array(numbers), (Energy("object_damping", "dampers of free objects"),)
        rest, stored = np.zeros_like(damping), self.contacts.stored
        parameters = np.array([rest, rest, damping])
        table = ("object_damping", JOINT_SPRING, tuple(names), parameters)
        return [Rows(*table, np.array(arms), paths=tuple(paths), stored=stored, powers=powers)] if names else []

    @property
    def world(self) -> tuple[str, ...]:
        """Names of the joints of the world seen by a moving palm; none for an empty world."""
        return WORLD if self.body.model.existJointName(WORLD[0]) else ()

    def with_objects(self, objects: Mapping[str, Object], body: RigidBody) -> Scene:
        """Return the scene with objects of other masses and paths, and the body of these."""
        return replace(self, objects=objects, free={name: objects[name] for name in self.free}, body=body)

    def with_masses(self, objects: Mapping[str, Object], body: RigidBody, palm: Palm | None) -> Scene | None:
        """Return the scene on a finger's body with other masses and paths; None if its structure would be another."""
        extended = add_free_objects(body, objects, palm)
        return self.with_objects(objects, extended) if extended.topology is self.body.topology else None

    def start(self) -> tuple[Array, Array]:
        """Return poses and velocities of the free objects at t = 0, shapes (7 f,) and (6 f,)."""
        poses = [each.pose for each in self.free.values()]
        rates = [np.append(each.velocity, each.angular_velocity) for each in self.free.values()]
        return np.array(poses).reshape(-1), np.array(rates).reshape(-1)

    def check(self, state: State) -> None:
        """Refuse a state in which bodies are deep in each other."""
        placed = _placed(state)
        check_start(self.contacts, self.body, placed)

    @property
    def mass(self) -> Array:
        """Mass of the free objects, shape (f,), kg."""
        return np.array([each.mass or 0.0 for each in self.free.values()])

    def energies(self, pose: Array, velocity: Array, base: Array | None = None) -> tuple[Array, Array]:
        """Return kinetic and potential energy of the free objects, shape (...,), J.

        With a base that moves, (..., 15) or more numbers of `base_motion`, they are those of the motion in the world,
        where the base has no height.
        """
        lead = pose.shape[:-1]
        poses, rates = pose.reshape(*lead, -1, POSE), velocity.reshape(*lead, -1, VELOCITY)
        places, speeds, turns = poses[..., :3], rates[..., :3], rates[..., 3:]
        gravity = np.asarray(self.body.model.gravity.linear)
        if base is not None:
            moved = base[..., None, :]
            speeds = speeds + moved[..., 3:6] + np.cross(moved[..., :3], places)
            # The base turns in its own axes, objects in theirs: R^T omega by the conjugate of the quaternion.
            turns = turns + _turned(moved[..., :3], -poses[..., 3:6], poses[..., 6:])
            gravity = moved[..., 12:15]
        centres = np.array([each.centre for each in self.free.values()]).reshape(-1, 3)
        moments = np.array([each.moments for each in self.free.values()]).reshape(-1, 6)
        if np.any(centres):
            speeds = speeds + _turned(np.cross(turns, centres), poses[..., 3:6], poses[..., 6:])
            places = places + _turned(centres, poses[..., 3:6], poses[..., 6:])
        kinetic = 0.5 * (np.sum(speeds**2, axis=-1) @ self.mass + np.sum(moments[:, :3] * turns**2, (-2, -1)))
        kinetic += np.sum(moments[:, 3:] * turns[..., [0, 0, 1]] * turns[..., [1, 2, 2]], (-2, -1))
        return kinetic, -np.sum(places * gravity, axis=-1) @ self.mass

    def touching(self, state: State, force: Array) -> ContactPoints:
        """Return forces, points and normals of contacts in space.

        Args:
            state: m states.
            force: Along the contacts' arms, shape (m, a c), N; moments are left out.
        """
        body, data, placed = self.body, self.body.model.createData(), _placed(state)
        pieces = [legs[0].piece for legs in self.contacts.paths[:: self.contacts.law.arms]]
        along = force.reshape(len(force), len(pieces), self.contacts.law.arms)[..., :3]
        points, out = ContactPoints(*(np.zeros((len(force), len(pieces), 3)) for _ in range(3))), np.zeros(16)
        for m in np.flatnonzero(np.any(along[..., 0], axis=1)):
            pin.forwardKinematics(body.model, data, placed[m])
            for c in np.flatnonzero(along[m, :, 0]):
                piece = pieces[c]
                frame = data.oMi[piece.joint] * piece.frame
                y = np.concatenate([frame.actInv(data.oMi[end.joint].act(end.point)) for end in piece.ends])
                piece.shape.value(y, piece.parameters, out)
                axes = frame.rotation @ out[[1, 2, 3, 7, 8, 9, 10, 11, 12]].reshape(3, 3).T
                points.force[m, c] = -axes @ along[m, c]
                points.normal[m, c] = axes[:, 0]
                points.point[m, c] = frame.act(out[4:7])
        return points


def rotate(quaternion: Array, vector: Array) -> Array:
    """Turn vectors by unit quaternions x, y, z, w, shapes (..., 3) and (..., 4)."""
    return _turned(vector, quaternion[..., :3], quaternion[..., 3:])


def _turned(vector: Array, axis: Array, scalar: Array) -> Array:
    """Return vectors turned by unit quaternions of a vector and a scalar part, shapes (..., 3), (..., 3), (..., 1)."""
    vector = np.broadcast_to(vector, axis.shape)
    across = 2.0 * np.cross(axis, vector)
    return vector + scalar * across + np.cross(axis, across)


def _placed(state: State) -> Array:
    """Return the positions of the bodies of the surroundings, shape (..., nq)."""
    parts = (state.position, state.object_pose, state.world_position)
    return np.concatenate([each for each in parts if each is not None], axis=-1)
