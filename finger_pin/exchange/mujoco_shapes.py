"""The geoms of a MuJoCo model that collide, as shapes of a tree's bodies or objects, and which pairs may touch."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from finger_pin.exchange.mujoco_names import Table, quaternion
from finger_pin.exchange.mujoco_unsupported import ElementReader, disabled

# How deep bodies may be in each other at the start, as contacts have it, m.
_DEEPEST = 1e-3


class Shapes:
    """Spheres, capsules, boxes and cylinders that collide; all else that does is listed by name."""

    def __init__(self, read: ElementReader) -> None:
        """Read the geoms of a model."""
        mujoco, model = read.mujoco, read.model
        self.mujoco, self.model, self.names, self.rest = mujoco, model, read.names, read.rest
        kinds = mujoco.mjtGeom
        self._kinds = {
            int(kinds.mjGEOM_SPHERE): "sphere",
            int(kinds.mjGEOM_CAPSULE): "capsule",
            int(kinds.mjGEOM_CYLINDER): "cylinder",
            int(kinds.mjGEOM_BOX): "box",
        }
        self._disabled = disabled(mujoco, model)
        touching = "contact" not in self._disabled
        paired = {int(each) for each in (*model.pair_geom1, *model.pair_geom2) if touching}
        self._colliding = [
            i for i in range(model.ngeom) if model.geom_contype[i] or model.geom_conaffinity[i] or i in paired
        ]
        for i in self._colliding:
            kind = kinds(int(model.geom_type[i])).name.removeprefix("mjGEOM_").lower()
            if not self._solid(i) and not (kind == "plane" and not model.body_weldid[model.geom_bodyid[i]]):
                moves = bool(model.body_weldid[model.geom_bodyid[i]])
                self.rest.add(f"geom {self._name(i)}: a {kind} touches nothing here", moves)
        margins = [self._name(i) for i in self._colliding if model.geom_margin[i] or model.geom_gap[i]]
        if margins:
            self.rest.add(f"margins of geoms, where contacts begin: {', '.join(margins)}", moves=False)
        self._overlapping = self._overlaps()

    def _name(self, i: int) -> str:
        return self.model.geom(i).name or f"geom_{i}"

    def _solid(self, i: int) -> bool:
        return int(self.model.geom_type[i]) in self._kinds

    def _started(self) -> Any:
        """Return the model's data where runs start: at its first keyframe, or at its reference."""
        data = self.mujoco.MjData(self.model)
        if self.model.nkey:
            self.mujoco.mj_resetDataKeyframe(self.model, data, 0)
        self.mujoco.mj_kinematics(self.model, data)
        self.mujoco.mj_comPos(self.model, data)
        self.mujoco.mj_collision(self.model, data)
        return data

    def _overlaps(self) -> set[frozenset[int]]:
        """Return the pairs of geoms that overlap where runs start, by more than they may."""
        data = self._started()
        deep = [k for k in range(data.ncon) if data.contact.dist[k] < -_DEEPEST]
        return {frozenset(int(each) for each in data.contact.geom[k]) for k in deep}

    def of_body(self, body: int) -> Table:
        """Return the shapes of a body; of a surface MuJoCo has the coefficient of sliding friction."""
        model, found = self.model, {}
        for i in self._colliding:
            if model.geom_bodyid[i] == body and self._solid(i):
                place = {"position": model.geom_pos[i].tolist(), "orientation": quaternion(model.geom_quat[i])}
                found[self.names.geoms[i]] = self._shape(i) | place
        return found

    def _shape(self, i: int) -> Table:
        """Return shape, sizes and surface of a geom."""
        model = self.model
        shape, size = self._kinds.get(int(model.geom_type[i]), "half_space"), model.geom_size[i]
        sizes: Table = {} if shape == "half_space" else {"radius": float(size[0])}
        if shape == "box":
            sizes = {"sides": (2.0 * size).tolist()}
        elif shape in ("capsule", "cylinder"):
            sizes["length"] = 2.0 * float(size[1])
        friction = float(model.geom_friction[i, 0]) if model.geom_condim[i] > 1 else 0.0
        return {"shape": shape, **sizes, "surface": {"friction": friction}}

    def _meant(self, a: int, b: int) -> bool:
        """Return whether the bits of two geoms let them collide."""
        types, affinities = self.model.geom_contype, self.model.geom_conaffinity
        return bool(types[a] & affinities[b] or types[b] & affinities[a])

    def still(self) -> set[int]:
        """Return the bodies that stand still, have something to touch, and are not the world."""
        weld, carriers = self.model.body_weldid, self.model.geom_bodyid
        return {int(carriers[i]) for i in self._colliding if self._solid(i) and not weld[carriers[i]]} - {0}

    def objects(self, loose: list[int]) -> Table:
        """Return planes that may be touched, and free bodies at the start of runs, as objects."""
        model, data, found = self.model, self._started(), {}
        shapes = [i for i in self._colliding if self._solid(i) and int(model.geom_bodyid[i]) not in loose]
        taken = {*self.names.joints, *(self.names.geoms[i] for i in shapes)}
        for i in self._colliding:
            plane = model.geom_type[i] == self.mujoco.mjtGeom.mjGEOM_PLANE
            if plane and any(self._meant(i, k) for k in self._colliding if k != i) and not self._dropped(i):
                found[_free_name(self.names.geoms[i], taken)] = self._shape(i) | self._placed(data, i)
        for body in loose:
            name, own = self.names.bodies[body], [i for i in self._colliding if model.geom_bodyid[i] == body]
            if len(own) != 1 or not self._solid(own[0]) or any(model.body_parentid == body):
                self.rest.add(f"free body {name}: an object is one sphere, capsule, cylinder or box")
            elif not self._dropped(own[0]):
                (i,) = own
                if np.linalg.norm(model.geom_pos[i] - model.body_ipos[body]) > 1e-3 * model.geom_rbound[i]:
                    self.rest.add(f"free body {name}: its mass centre is not its shape's")
                if model.body_gravcomp[body]:
                    self.rest.add(f"free body {name}: gravity compensation")
                mass = {"mass": float(model.body_mass[body])}
                found[_free_name(name, taken | {*found})] = self._shape(i) | self._placed(data, i) | mass
        return found

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

    def pairs(self, bodies: list[int]) -> list[list[str]]:
        """Return the pairs that MuJoCo lets collide among some bodies: by its bits, exclusions and explicit pairs."""
        model, weld = self.model, self.model.body_weldid
        known = {i for i in self._colliding if self._solid(i) and int(model.geom_bodyid[i]) in (0, *bodies)}
        excluded = {int(each) for each in model.exclude_signature}
        filtered = "filterparent" not in self._disabled
        found = [(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)]
        for a, b in itertools.combinations(sorted(known), 2):
            one, other = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
            # What is welded is one body; a body and its parent do not collide, unless that is the world.
            first, second = int(weld[one]), int(weld[other])
            related = (
                first
                and second
                and (weld[model.body_parentid[second]] == first or weld[model.body_parentid[first]] == second)
            )
            if (
                self._meant(a, b)
                and first != second
                and not (filtered and related)
                and (one << 16) + other not in excluded
            ):
                found.append((a, b))
        kept = dict.fromkeys(tuple(sorted(pair)) for pair in found if set(pair) <= known)
        same = [pair for pair in kept if model.geom_bodyid[pair[0]] == model.geom_bodyid[pair[1]]]
        apart = []
        for a, b in kept:
            if frozenset((a, b)) in self._overlapping:
                self.rest.add(f"geoms {self._name(a)}, {self._name(b)}: they overlap where runs start, and never touch")
            elif (a, b) not in same:
                apart.append([self.names.geoms[a], self.names.geoms[b]])
        return apart


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name for an object that nothing else has."""
    return _free_name(f"{name}_object", taken) if name in taken else name
