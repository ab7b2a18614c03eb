"""The geoms of a MuJoCo model that collide, as shapes of a tree's bodies or objects, and which pairs may touch."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.description.objects import Object
from finger_pin.description.primitives import SOLIDS
from finger_pin.exchange.mujoco_names import Table, model_name, quaternion, unused_name
from finger_pin.exchange.mujoco_pairs import Pairs
from finger_pin.exchange.mujoco_sizes import KIND_OF_GEOM, described_sizes, geom_kind
from finger_pin.exchange.mujoco_unsupported import ElementReader, disabled
from finger_pin.mechanism.body_places import rotation
from finger_pin.mechanism.contact_rows import DEEPEST_START

# Difference of a free body from an even solid: in moments of inertia, part of the largest, and in mass centre, m.
_INERTIA_TOLERANCE = 1e-9


class Shapes:
    """Colliding spheres, capsules, boxes, cylinders and ellipsoids; other colliding geoms are listed by name."""

    def __init__(self, reader: ElementReader) -> None:
        """Read the geoms of a model."""
        mujoco, model = reader.mujoco, reader.model
        self.mujoco, self.model, self.names, self.left_out = mujoco, model, reader.names, reader.left_out
        self._moves = reader.moves[model.geom_bodyid]
        contacts_enabled = "contact" not in disabled(mujoco, model)
        self._colliding = reader.colliding
        for i in self._colliding:
            kind = geom_kind(mujoco, model, i)
            if not self._is_solid(i) and not self._is_plane(i):
                moves = bool(self._moves[i])
                article = "an" if kind[0] in "aeiou" else "a"
                self.left_out.add(f"geom {self._name(i)}: {article} {kind} touches nothing here", moves)
        pairs, self._object_names = Pairs(*vars(reader).values()), dict[int, str]()
        # Meshes and planes that move were listed.
        carried = [i for i in self._colliding if self._is_solid(i) or self._is_plane(i)]
        self._contact_pairs = pairs.coefficients(carried) if contacts_enabled else {}
        self._surfaces = pairs.surfaces(self._contact_pairs)
        self._reader = reader
        self._list_margins()
        self._overlapping = self._overlaps()

    def _name(self, i: int) -> str:
        return model_name(self.model, "geom", i)

    def _is_solid(self, i: int) -> bool:
        return KIND_OF_GEOM.get(geom_kind(self.mujoco, self.model, i)) in SOLIDS

    def _is_plane(self, i: int) -> bool:
        model = self.model
        return bool(model.geom_type[i] == self.mujoco.mjtGeom.mjGEOM_PLANE and not self._moves[i])

    def _list_margins(self) -> None:
        model = self.model
        margins = [self._name(i) for i in self._colliding if model.geom_margin[i] or model.geom_gap[i]]
        paired = [self._name(int(model.pair_geom1[k])) for k in range(model.npair) if model.pair_margin[k]]
        if margins or paired:
            largest = max(model.geom_margin.max(initial=0.0), model.pair_margin.max(initial=0.0))
            line = f"margins of geoms, where contacts begin: {', '.join(dict.fromkeys(margins + paired))}"
            self.left_out.add(line, moves=bool(largest > DEEPEST_START))

    def _overlaps(self) -> set[frozenset[int]]:
        """Return the pairs of geoms that overlap where runs start, by more than they may."""
        data = self._reader.start_data()
        self.mujoco.mj_collision(self.model, data)
        deep = [k for k in range(data.ncon) if data.contact.dist[k] < -DEEPEST_START]
        return {frozenset(int(each) for each in data.contact.geom[k]) for k in deep}

    def body_shapes(self, body: int) -> Table:
        """Return the shapes of a body; of a surface MuJoCo has the coefficient of sliding friction."""
        model, shapes = self.model, {}
        for i in self._colliding:
            if model.geom_bodyid[i] == body and self._is_solid(i):
                place = {"position": model.geom_pos[i].tolist(), "orientation": quaternion(model.geom_quat[i])}
                shapes[self.names.geoms[i]] = self._shape(i) | place
        return shapes

    def _shape(self, i: int) -> Table:
        """Return shape, sizes and surface of a geom."""
        model = self.model
        shape, size = KIND_OF_GEOM[geom_kind(self.mujoco, model, i)], model.geom_size[i]
        default_surface = {"friction": float(model.geom_friction[i, 0]) if model.geom_condim[i] > 1 else 0.0}
        return {"shape": shape, **described_sizes(shape, size), "surface": self._surfaces.get(i, default_surface)}

    def fixed_bodies(self) -> set[int]:
        """Return the bodies that stand still, have something to touch, and are not the world."""
        fixed = [i for i in self._colliding if self._is_solid(i) and not self._moves[i]]
        return set(self.model.geom_bodyid[fixed].tolist()) - {0}

    def objects(self, free_bodies: list[int]) -> Table:
        """Return planes that may be touched, and free bodies at the start of runs, as objects."""
        model, data, objects = self.model, self._reader.start_data(), {}
        shapes = [i for i in self._colliding if self._is_solid(i) and int(model.geom_bodyid[i]) not in free_bodies]
        used = {*self.names.joints, *(self.names.geoms[i] for i in shapes)}
        for i in self._colliding:
            if self._is_plane(i) and any(i in pair for pair in self._contact_pairs) and not self._overlaps_body(i):
                self._object_names[i] = unused_name(self.names.geoms[i], used, "object")
                objects[self._object_names[i]] = self._shape(i) | self._pose(data, i)
        for body in free_bodies:
            name, geoms = self.names.bodies[body], [i for i in self._colliding if model.geom_bodyid[i] == body]
            if len(geoms) != 1 or not self._is_solid(geoms[0]) or any(model.body_parentid == body):
                self.left_out.add(f"free body {name}: an object is one {', '.join(SOLIDS[:-1])} or {SOLIDS[-1]}")
            elif not self._overlaps_body(geoms[0]):
                (i,) = geoms
                self._object_names[i] = unused_name(name, used | {*objects}, "object")
                moving = {"mass": float(model.body_mass[body]), **self._velocity(data, i), **self._damping(body, i)}
                objects[self._object_names[i]] = self._shape(i) | self._pose(data, i) | moving
                objects[self._object_names[i]] |= self._inertia(body, i, objects[self._object_names[i]])
                self._list_free(body)
        return objects

    def object_states(self, keyframe: int) -> Table:
        """Return the free bodies whose place or speed at a keyframe differs from that at the start of runs."""
        start, data = (self._free_states(k) for k in (0, keyframe))
        return {name: state for name, state in data.items() if state != start[name]}

    def _free_states(self, keyframe: int) -> Table:
        data = self._reader.start_data(keyframe)
        free = {name: i for i, name in self._object_names.items() if self._moves[i]}
        return {name: self._pose(data, i) | self._velocity(data, i) for name, i in free.items()}

    def _overlaps_body(self, i: int) -> bool:
        """Return whether an object overlaps a body at the start of runs, and list it if so."""
        overlapped = sorted({self._name(k) for pair in self._overlapping if i in pair for k in pair - {i}})
        if overlapped:
            self.left_out.add(f"geom {self._name(i)}: it overlaps {', '.join(overlapped)} where runs start")
        return bool(overlapped)

    def _pose(self, data: Any, i: int) -> Table:
        quaternion_wxyz = np.zeros(4)
        self.mujoco.mju_mat2Quat(quaternion_wxyz, data.geom_xmat[i])
        return {"position": data.geom_xpos[i].tolist(), "orientation": quaternion(quaternion_wxyz)}

    def _velocity(self, data: Any, i: int) -> Table:
        """Return the speeds of a free geom where runs start: of its middle, and of its turning in its own frame."""
        velocity = np.zeros(6)
        # Turning comes first.
        self.mujoco.mj_objectVelocity(self.model, data, self.mujoco.mjtObj.mjOBJ_GEOM, i, velocity, 0)
        turning = data.geom_xmat[i].reshape(3, 3).T @ velocity[:3]
        return {"velocity": velocity[3:].tolist(), "angular_velocity": turning.tolist()} if velocity.any() else {}

    def _inertia(self, body: int, i: int, described: Table) -> Table:
        """Return mass centre and moments of inertia of a free body in a geom's frame, if no even solid has them."""
        model, to_geom = self.model, rotation(quaternion(self.model.geom_quat[i])).T
        centre = to_geom @ (model.body_ipos[body] - model.geom_pos[i])
        axes = to_geom @ rotation(quaternion(model.body_iquat[body]))
        moments = axes @ np.diag(model.body_inertia[body]) @ axes.T
        even = Object.model_validate(described).even_moments
        same_moments = np.abs(moments - np.diag(even)).max() < _INERTIA_TOLERANCE * max(even)
        if same_moments and np.allclose(centre, 0.0, 0.0, _INERTIA_TOLERANCE):
            return {}
        products = moments[np.triu_indices(3, 1)].tolist()
        return {"centre": centre.tolist(), "inertia": [*np.diag(moments).tolist(), *products]}

    def _damping(self, body: int, i: int) -> Table:
        """Return the damping of a free body, which acts on its origin: none where the geom's middle is elsewhere."""
        rates = self.model.dof_damping[int(self.model.body_dofadr[body]) :][:6].reshape(2, 3)
        (linear, angular), aside = rates[:, 0].tolist(), np.any(np.abs(self.model.geom_pos[i]) > _INERTIA_TOLERANCE)
        if np.any(np.ptp(rates, axis=1)) or (linear and aside):
            self.left_out.add(
                f"free body {self.names.bodies[body]}: damping at another point than the middle of its geom"
            )
            return {}
        return {key: each for key, each in (("damping", linear), ("angular_damping", angular)) if each}

    def _list_free(self, body: int) -> None:
        """List properties of a free body that objects lack."""
        model, name, first = self.model, self.names.bodies[body], int(self.model.body_dofadr[body])
        dofs, joint = slice(first, first + 6), int(model.body_jntadr[body])
        for what, values in (
            ("gravity compensation", model.body_gravcomp[body]),
            ("armature", model.dof_armature[dofs]),
            ("friction loss", model.dof_frictionloss[dofs]),
            ("a spring", model.jnt_stiffness[joint]),
        ):
            if np.any(values):
                self.left_out.add(f"free body {name}: {what}")

    def pairs(self, bodies: list[int]) -> list[list[str]]:
        """Return the pairs of shapes that MuJoCo lets collide among some bodies, as `Pairs` finds them."""
        apart, carriers = [], self.model.geom_bodyid
        for a, b in self._contact_pairs:
            solids = self._is_solid(a) and self._is_solid(b)
            if not ({int(carriers[a]), int(carriers[b])} <= {0, *bodies} and solids):
                continue
            if frozenset((a, b)) in self._overlapping:
                reason = "they overlap where runs start, and never touch"
                self.left_out.add(f"geoms {self._name(a)}, {self._name(b)}: {reason}")
            elif carriers[a] != carriers[b]:
                apart.append([self.names.geoms[a], self.names.geoms[b]])
        return apart

    def set_apart(self, objects: Table, bodies: list[int]) -> None:
        """Set the entry ``apart`` of objects: what MuJoCo does not let collide with them."""
        carriers = self.model.geom_bodyid
        shapes = {
            i: self.names.geoms[i] for i in self._colliding if self._is_solid(i) and int(carriers[i]) in (0, *bodies)
        }
        others = dict(shapes)
        for i, name in self._object_names.items():
            apart = [
                other
                for k, other in others.items()
                if (self._moves[i] or self._moves[k]) and (min(i, k), max(i, k)) not in self._contact_pairs
            ]
            objects[name] |= {"apart": apart} if apart else {}
            others[i] = name
