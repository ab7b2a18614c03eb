"""Meshes of a MuJoCo model: primitives in the place of those that collide, and what is drawn of all geoms."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.spatial

from finger_pin.description.meshes import Mesh
from finger_pin.description.primitives import KINDS, SOLIDS
from finger_pin.exceptions import InputError
from finger_pin.exchange.mesh_fits import FORMS, Fit, Hull, fit
from finger_pin.exchange.mujoco_names import Table, entry_name, model_name, quaternion, unused_name
from finger_pin.exchange.mujoco_sizes import KIND_OF_GEOM, described_sizes, geom_kind, mujoco_sizes
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.mechanism.body_places import rotation
from finger_pin.typing import Array

#: What `from_mujoco` can make of all meshes, or of one that is named.
CHOICES = ("fit", "none", *FORMS)
# Groups from this one on are hidden in MuJoCo's viewer, unless one asks for them.
_FIRST_HIDDEN_GROUP = 3


class Meshes:
    """Meshes of a model.

    Attributes:
        model: The model with primitives in the place of meshes that collide; MuJoCo collides their convex hulls.
    """

    def __init__(self, reader: ElementReader, meshes: Mapping[str, str] | str) -> None:
        """Fit primitives as chosen, and list them.

        Raises:
            InputError: If there is no such choice, or no geom, mesh or body of a name has a mesh that collides.
        """
        self._reader, self.model, self._fitted = reader, reader.model, set[int]()
        fits: dict[tuple[int, str], tuple[Fit, float] | None] = {}
        for i, choice in self._choices(meshes).items():
            key = int(reader.model.geom_dataid[i]), choice
            if choice != "none" and key not in fits:
                fits[key] = _fit(self._points(key[0]), tuple(FORMS) if choice == "fit" else (choice,))
            if (found := fits.get(key)) is not None:
                fitted, distance = found
                self._replace(i, fitted)
                what = f"{'an' if fitted.kind[0] in 'aeiou' else 'a'} {fitted.kind}, at most {1e3 * distance:.2f} mm"
                line = f"geom {model_name(reader.model, 'geom', i)}: its mesh touches as {what} from its hull"
                reader.left_out.add(line, moves=False)

    def _choices(self, meshes: Mapping[str, str] | str) -> dict[int, str]:
        """Return what becomes of every geom whose mesh collides: of names its own, its mesh's and its body's count."""
        reader, model, names = self._reader, self._reader.model, self._reader.names
        if not isinstance(meshes, str | Mapping):
            raise InputError("meshes", "must be a text, or texts by the names of geoms, meshes or bodies", meshes)
        given = [("meshes", meshes)] if isinstance(meshes, str) else [(f"meshes.{k}", v) for k, v in meshes.items()]
        for entry, choice in given:
            if choice not in CHOICES:
                raise InputError(entry, f"must be {', '.join(CHOICES[:-1])} or {CHOICES[-1]}", choice)
        geoms = {
            i: (names.geoms[i], names.meshes[model.geom_dataid[i]], names.bodies[model.geom_bodyid[i]])
            for i in reader.colliding
            if geom_kind(reader.mujoco, model, i) == "mesh"
        }
        if isinstance(meshes, str):
            return dict.fromkeys(geoms, meshes)
        for key in meshes:
            if not any(entry_name(key) in labels for labels in geoms.values()):
                there = ", ".join(labels[0] for labels in geoms.values()) or "none"
                allowed = f"no geom, mesh or body of this name has a mesh that collides; geoms that have one: {there}"
                raise InputError(f"meshes.{key}", allowed)
        chosen = {entry_name(key): kind for key, kind in meshes.items()}
        return {i: next((chosen[each] for each in labels if each in chosen), "fit") for i, labels in geoms.items()}

    def _points(self, mesh: int) -> Array:
        model = self._reader.model
        first = int(model.mesh_vertadr[mesh])
        return np.asarray(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], dtype=float)

    def _replace(self, i: int, fitted: Fit) -> None:
        """Put a primitive, whose place is in the frame of a geom's mesh, in the place of the geom."""
        mujoco, before = self._reader.mujoco, self._reader.model
        if not self._fitted:
            self.model = copy.copy(before)
            # The boxes about bodies that it uses are still those of meshes.
            self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
        self._fitted.add(i)
        model, kind = self.model, KINDS[fitted.kind]
        sizes = mujoco_sizes(fitted.kind, fitted.sizes)
        model.geom_type[i] = int(getattr(mujoco.mjtGeom, f"mjGEOM_{str(kind.geom).upper()}"))
        model.geom_dataid[i], model.geom_sameframe[i] = -1, 0
        model.geom_size[i] = [*sizes, *[0.0] * (3 - len(sizes))]
        model.geom_rbound[i] = kind.reach(fitted.sizes)
        model.geom_aabb[i] = [0.0, 0.0, 0.0, *kind.half_sides(fitted.sizes)]
        turn = rotation(quaternion(before.geom_quat[i]))
        model.geom_pos[i] = before.geom_pos[i] + turn @ fitted.position
        mujoco.mju_mat2Quat(model.geom_quat[i], (turn @ fitted.axes).ravel())

    def solids(self, body: int) -> Table:
        """Return the visible geoms of a body, or all if none is, and what was fitted; of still bodies no mesh."""
        model, names, solids = self._reader.model, self._reader.names, {}
        geoms = np.flatnonzero(model.geom_bodyid == body)
        visible = geoms[model.geom_group[geoms] < _FIRST_HIDDEN_GROUP]
        for i in (visible if len(visible) else geoms).tolist():
            kind = geom_kind(self._reader.mujoco, model, i)
            if KIND_OF_GEOM.get(kind) in SOLIDS:
                solids[names.geoms[i]] = self._primitive(i)
            elif kind == "mesh" and model.body_weldid[body]:
                # A forearm that stands still would be in the way.
                name = unused_name(names.geoms[i], names.geoms, "mesh") if i in self._fitted else names.geoms[i]
                solids[name] = {"kind": "mesh", "mesh": names.meshes[model.geom_dataid[i]], **self._pose(model, i)}
        moving = [i for i in geoms.tolist() if i in self._fitted and model.body_weldid[body]]
        return solids | {names.geoms[i]: self._primitive(i) for i in moving}

    def _primitive(self, i: int) -> Table:
        kind = KIND_OF_GEOM[geom_kind(self._reader.mujoco, self.model, i)]
        return {"kind": kind, **described_sizes(kind, self.model.geom_size[i]), **self._pose(self.model, i)}

    @staticmethod
    def _pose(model: Any, i: int) -> Table:
        return {"position": model.geom_pos[i].tolist(), "orientation": quaternion(model.geom_quat[i])}

    def surfaces(self, bodies: list[int]) -> Table:
        """Return the meshes that the solids of bodies are made of."""
        model, names = self._reader.model, self._reader.names.meshes
        used_meshes = {solid.get("mesh") for i in bodies for solid in self.solids(i).values()}
        meshes = {}
        for i in range(model.nmesh):
            faces = slice(model.mesh_faceadr[i], model.mesh_faceadr[i] + model.mesh_facenum[i])
            if names[i] in used_meshes:
                meshes[names[i]] = Mesh.packed(self._points(i), model.mesh_face[faces])
        return meshes


def _fit(points: Array, kinds: tuple[str, ...]) -> tuple[Fit, float] | None:
    """Return the primitive of some kinds that fits points best, with its distance, m; None if they have no volume."""
    try:
        hull = Hull.around(points)
    except scipy.spatial.QhullError:
        return None
    fitted = fit(hull, kinds)
    return fitted, fitted.distance(hull)
