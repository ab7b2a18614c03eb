"""The geoms of a MuJoCo model that collide, as shapes of a tree's bodies or objects, and which pairs may touch."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.description.objects import Object
from finger_pin.exchange.mujoco_names import Table, free_name, model_name, quaternion
from finger_pin.exchange.mujoco_pairs import Pairs
from finger_pin.exchange.mujoco_unsupported import ElementReader, disabled
from finger_pin.mechanism.tendon_paths import rotation

# How deep bodies may be in each other at the start, as contacts have it, m.
_DEEPEST = 1e-3
# Part of the largest moment of inertia, and distance, m, by which a free body may differ from an even solid.
_UNEVEN = 1e-9


class Shapes:
    """Colliding spheres, capsules, boxes, cylinders and ellipsoids; other colliding geoms are listed by name."""

    def __init__(self, read: ElementReader) -> None:
        """Read the geoms of a model."""
        mujoco, model = read.mujoco, read.model
        self.mujoco, self.model, self.names, self.rest = mujoco, model, read.names, read.rest
        self._moves = read.moves[model.geom_bodyid]
        kinds = mujoco.mjtGeom
        self._kinds = {
            int(kinds.mjGEOM_SPHERE): "sphere",
            int(kinds.mjGEOM_CAPSULE): "capsule",
            int(kinds.mjGEOM_CYLINDER): "cylinder",
            int(kinds.mjGEOM_BOX): "box",
            int(kinds.mjGEOM_ELLIPSOID): "ellipsoid",
        }
        touching = "contact" not in disabled(mujoco, model)
        self._colliding = read.colliding
        for i in self._colliding:
            kind = kinds(int(model.geom_type[i])).name.removeprefix("mjGEOM_").lower()
            if not self._solid(i) and not self._is_plane(i):
                moves = bool(self._moves[i])
                self.rest.add(f"geom {self._name(i)}: {_with_article(kind)} touches nothing here", moves)
        pairs, self._placed_at = Pairs(*vars(read).values()), dict[int, str]()
        # Meshes and planes that move were listed.
        carried = [i for i in self._colliding if self._solid(i) or self._is_plane(i)]
        self._met = pairs.met(carried) if touching else {}
        self._surfaces = pairs.surfaces(self._met)
        self._read = read
        self._list_margins()
        self._overlapping = self._overlaps()

    def _name(self, i: int) -> str:
        return model_name(self.model, "geom", i)

    def _solid(self, i: int) -> bool:
        return int(self.model.geom_type[i]) in self._kinds

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
            self.rest.add(line, moves=bool(largest > _DEEPEST))

    def _overlaps(self) -> set[frozenset[int]]:
        """Return the pairs of geoms that overlap where runs start, by more than they may."""
        data = self._read.start_data()
        self.mujoco.mj_collision(self.model, data)
        deep = [k for k in range(data.ncon) if data.contact.dist[k] < -_DEEPEST]
        return {frozenset(int(each) for each in data.contact.geom[k]) for k in deep}

    def of_body(self, body: int) -> Table:
        """Return the shapes of a body; of a surface MuJoCo has the coefficient of sliding friction."""
        model, shapes = self.model, {}
        for i in self._colliding:
            if model.geom_bodyid[i] == body and self._solid(i):
                place = {"position": model.geom_pos[i].tolist(), "orientation": quaternion(model.geom_quat[i])}
                shapes[self.names.geoms[i]] = self._shape(i) | place
        return shapes

    def _shape(self, i: int) -> Table:
        """Return shape, sizes and surface of a geom."""
        model = self.model
        shape, size = self._kinds.get(int(model.geom_type[i]), "half_space"), model.geom_size[i]
        sizes: Table = {} if shape == "half_space" else {"radius": float(size[0])}
        if shape == "box":
            sizes = {"sides": (2.0 * size).tolist()}
        elif shape == "ellipsoid":
            sizes = {"semi_axes": size.tolist()}
        elif shape in ("capsule", "cylinder"):
            sizes["length"] = 2.0 * float(size[1])
        alone = {"friction": float(model.geom_friction[i, 0]) if model.geom_condim[i] > 1 else 0.0}
        return {"shape": shape, **sizes, "surface": self._surfaces.get(i, alone)}

    def still(self) -> set[int]:
        """Return the bodies that stand still, have something to touch, and are not the world."""
        return {int(self.model.geom_bodyid[i]) for i in self._colliding if self._solid(i) and not self._moves[i]} - {0}

    def objects(self, loose: list[int]) -> Table:
        """Return planes that may be touched, and free bodies at the start of runs, as objects."""
        model, data, objects = self.model, self._read.start_data(), {}
        shapes = [i for i in self._colliding if self._solid(i) and int(model.geom_bodyid[i]) not in loose]
        used = {*self.names.joints, *(self.names.geoms[i] for i in shapes)}
        for i in self._colliding:
            if self._is_plane(i) and any(i in pair for pair in self._met) and not self._dropped(i):
                self._placed_at[i] = free_name(self.names.geoms[i], used, "object")
                objects[self._placed_at[i]] = self._shape(i) | self._placed(data, i)
        for body in loose:
            name, geoms = self.names.bodies[body], [i for i in self._colliding if model.geom_bodyid[i] == body]
            if len(geoms) != 1 or not self._solid(geoms[0]) or any(model.body_parentid == body):
                self.rest.add(f"free body {name}: an object is one sphere, capsule, cylinder, box or ellipsoid")
            elif not self._dropped(geoms[0]):
                (i,) = geoms
                self._placed_at[i] = free_name(name, used | {*objects}, "object")
                moving = {"mass": float(model.body_mass[body]), **self._velocity(data, i)}
                objects[self._placed_at[i]] = self._shape(i) | self._placed(data, i) | moving
                objects[self._placed_at[i]] |= self._inertia(body, i, objects[self._placed_at[i]])
                self._list_free(body)
        return objects

    def object_states(self, keyframe: int) -> Table:
        """Return the free bodies whose place or speed at a keyframe differs from that at the start of runs."""
        start, data = (self._free_states(k) for k in (0, keyframe))
        return {name: state for name, state in data.items() if state != start[name]}

    def _free_states(self, keyframe: int) -> Table:
        data = self._read.start_data(keyframe)
        free = {name: i for i, name in self._placed_at.items() if self._moves[i]}
        return {name: self._placed(data, i) | self._velocity(data, i) for name, i in free.items()}

    def _dropped(self, i: int) -> bool:
        """Return whether an object overlaps a body at the start of runs, and list it if so."""
        met = sorted({self._name(k) for pair in self._overlapping if i in pair for k in pair - {i}})
        if met:
            self.rest.add(f"geom {self._name(i)}: it overlaps {', '.join(met)} where runs start")
        return bool(met)

    def _placed(self, data: Any, i: int) -> Table:
        turned = np.zeros(4)
        self.mujoco.mju_mat2Quat(turned, data.geom_xmat[i])
        return {"position": data.geom_xpos[i].tolist(), "orientation": quaternion(turned)}

    def _velocity(self, data: Any, i: int) -> Table:
        """Return the speeds of a free geom where runs start: of its middle, and of its turning in its own frame."""
        velocity = np.zeros(6)
        # Turning comes first.
        self.mujoco.mj_objectVelocity(self.model, data, self.mujoco.mjtObj.mjOBJ_GEOM, i, velocity, 0)
        turned = data.geom_xmat[i].reshape(3, 3).T @ velocity[:3]
        return {"velocity": velocity[3:].tolist(), "angular_velocity": turned.tolist()} if velocity.any() else {}

    def _inertia(self, body: int, i: int, described: Table) -> Table:
        """Return mass centre and moments of inertia of a free body in a geom's frame, if no even solid has them."""
        model, turned = self.model, rotation(quaternion(self.model.geom_quat[i])).T
        centre = turned @ (model.body_ipos[body] - model.geom_pos[i])
        axes = turned @ rotation(quaternion(model.body_iquat[body]))
        moments = axes @ np.diag(model.body_inertia[body]) @ axes.T
        even = Object.model_validate(described).even_moments
        if np.abs(moments - np.diag(even)).max() < _UNEVEN * max(even) and np.allclose(centre, 0.0, 0.0, _UNEVEN):
            return {}
        products = moments[np.triu_indices(3, 1)].tolist()
        return {"centre": centre.tolist(), "inertia": [*np.diag(moments).tolist(), *products]}

    def _list_free(self, body: int) -> None:
        """List properties of a free body that objects lack."""
        model, name, first = self.model, self.names.bodies[body], int(self.model.body_dofadr[body])
        dofs, joint = slice(first, first + 6), int(model.body_jntadr[body])
        for what, values in (
            ("gravity compensation", model.body_gravcomp[body]),
            ("damping", model.dof_damping[dofs]),
            ("armature", model.dof_armature[dofs]),
            ("friction loss", model.dof_frictionloss[dofs]),
            ("a spring", model.jnt_stiffness[joint]),
        ):
            if np.any(values):
                self.rest.add(f"free body {name}: {what}")

    def pairs(self, bodies: list[int]) -> list[list[str]]:
        """Return the pairs of shapes that MuJoCo lets collide among some bodies, as `Pairs` finds them."""
        apart, carriers = [], self.model.geom_bodyid
        for a, b in self._met:
            if not {int(carriers[a]), int(carriers[b])} <= {0, *bodies} or not (self._solid(a) and self._solid(b)):
                continue
            if frozenset((a, b)) in self._overlapping:
                self.rest.add(f"geoms {self._name(a)}, {self._name(b)}: they overlap where runs start, and never touch")
            elif carriers[a] != carriers[b]:
                apart.append([self.names.geoms[a], self.names.geoms[b]])
        return apart

    def set_apart(self, objects: Table, bodies: list[int]) -> None:
        """Set the entry ``apart`` of objects: what MuJoCo does not let collide with them."""
        carriers = self.model.geom_bodyid
        shapes = {
            i: self.names.geoms[i] for i in self._colliding if self._solid(i) and int(carriers[i]) in (0, *bodies)
        }
        others = dict(shapes)
        for i, name in self._placed_at.items():
            apart = [
                other
                for k, other in others.items()
                if (self._moves[i] or self._moves[k]) and (min(i, k), max(i, k)) not in self._met
            ]
            objects[name] |= {"apart": apart} if apart else {}
            others[i] = name


def _with_article(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"
