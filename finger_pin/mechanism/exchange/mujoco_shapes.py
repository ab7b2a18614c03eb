"""The geoms of a MuJoCo model that collide, as shapes of a tree's bodies, and which pairs of them may touch."""

from __future__ import annotations

import itertools

from finger_pin.mechanism.exchange.mujoco_flags import disabled
from finger_pin.mechanism.exchange.mujoco_names import Table, quaternion
from finger_pin.mechanism.exchange.mujoco_unsupported import ElementReader


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
            if not model.geom_bodyid[i]:
                self.rest.add(f"geom {self._name(i)}: it belongs to the world, where objects of a scenario stand")
            elif int(model.geom_type[i]) not in self._kinds:
                self.rest.add(f"geom {self._name(i)}: a {kind} touches nothing here")

    def _name(self, i: int) -> str:
        return self.model.geom(i).name or f"geom_{i}"

    def _kept(self, i: int) -> bool:
        return int(self.model.geom_type[i]) in self._kinds and bool(self.model.geom_bodyid[i])

    def of_body(self, body: int) -> Table:
        """Return the shapes of a body; of a surface MuJoCo has the coefficient of sliding friction."""
        model, found = self.model, {}
        for i in self._colliding:
            if model.geom_bodyid[i] != body or not self._kept(i):
                continue
            shape, size = self._kinds[int(model.geom_type[i])], model.geom_size[i]
            sizes: Table = {"radius": float(size[0])}
            if shape == "box":
                sizes = {"sides": (2.0 * size).tolist()}
            elif shape != "sphere":
                sizes["length"] = 2.0 * float(size[1])
            found[self.names.geoms[i]] = {
                "shape": shape,
                **sizes,
                "position": model.geom_pos[i].tolist(),
                "orientation": quaternion(model.geom_quat[i]),
                "surface": {"friction": float(model.geom_friction[i, 0]) if model.geom_condim[i] > 1 else 0.0},
            }
        return found

    def pairs(self, bodies: list[int]) -> list[list[str]]:
        """Return the pairs that MuJoCo lets collide among some bodies: by its bits, exclusions and explicit pairs."""
        model, weld = self.model, self.model.body_weldid
        known = {i for i in self._colliding if self._kept(i) and int(model.geom_bodyid[i]) in bodies}
        excluded = {int(each) for each in model.exclude_signature}
        filtered = "filterparent" not in self._disabled
        for i in filter(self._kept, self._colliding):
            if i not in known:
                self.rest.add(f"geom {self._name(i)}: its body stands still and carries nothing")
        found = [(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)]
        for a, b in itertools.combinations(sorted(known), 2):
            one, other = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
            meant = (
                model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
            )
            # What is welded is one body; a body and its parent do not collide, unless that is the world.
            first, second = int(weld[one]), int(weld[other])
            related = (
                first
                and second
                and (weld[model.body_parentid[second]] == first or weld[model.body_parentid[first]] == second)
            )
            if meant and first != second and not (filtered and related) and (one << 16) + other not in excluded:
                found.append((a, b))
        kept = dict.fromkeys(tuple(sorted(pair)) for pair in found if set(pair) <= known)
        same = [pair for pair in kept if model.geom_bodyid[pair[0]] == model.geom_bodyid[pair[1]]]
        return [[self.names.geoms[a], self.names.geoms[b]] for a, b in kept if (a, b) not in same]
