"""Tendons of a MuJoCo model, fixed and spatial, as entries of a description."""

from __future__ import annotations

import math

import numpy as np

from finger_pin.description.validation import validate
from finger_pin.description.waypoints import Waypoint, points_inside_wraps
from finger_pin.exchange.mujoco_compliance import soft_spring
from finger_pin.exchange.mujoco_names import Table, distinct, quaternion
from finger_pin.exchange.mujoco_sites import actuated_sites
from finger_pin.exchange.mujoco_unsupported import ElementReader, within_margin
from finger_pin.typing import Array


def passed_bodies(reader: ElementReader, sides: bool = False) -> set[int]:
    """Return the bodies that tendons pass, wrap or actuators push at sites; those with side sites if asked for."""
    model, types = reader.model, reader.mujoco.mjtWrap
    wraps = np.isin(model.wrap_type, [int(each) for each in (types.mjWRAP_SPHERE, types.mjWRAP_CYLINDER)])
    sites = model.wrap_objid[model.wrap_type == types.mjWRAP_SITE].tolist()
    sites += [int(site) for site in model.wrap_prm[wraps] if sides and site >= 0]
    sites += actuated_sites(reader)
    return {int(body) for body in (*model.site_bodyid[sites], *model.geom_bodyid[model.wrap_objid[wraps]])}


# Distance from a cylinder's axis, in parts of its radius, within which a side site lies on it.
_ON_AXIS = 1e-9
# Less is no direction, m: MuJoCo takes the x axis.
_NO_DIRECTION = 1e-15


class TendonReader(ElementReader):
    """Reader of a MuJoCo model's tendons."""

    def table(self, i: int) -> Table:
        """Return a tendon by its index."""
        model, types = self.model, self.mujoco.mjtWrap
        pieces = range(int(model.tendon_adr[i]), int(model.tendon_adr[i] + model.tendon_num[i]))
        tendon: Table = {
            "stiffness": float(model.tendon_stiffness[i]),
            "rest": model.tendon_lengthspring[i].tolist(),
            "damping": float(model.tendon_damping[i]),
            "friction": float(model.tendon_frictionloss[i]),
        }
        if model.wrap_type[pieces[0]] == types.mjWRAP_JOINT:
            tendon["joints"] = {self.names.joints[model.wrap_objid[k]]: float(model.wrap_prm[k]) for k in pieces}
        else:
            names = distinct("pulley", [self._piece_name(k) for k in pieces])
            path = {name: self._piece(k) for name, k in zip(names, pieces, strict=True)}
            tendon["path"] = self._without_unused_wraps(self.names.tendons[i], path)
        if model.tendon_limited[i]:
            tendon["range"] = within_margin(model.tendon_range[i], float(model.tendon_margin[i]))
            limit = model.tendon_solref_lim[i], model.tendon_solimp_lim[i], float(model.tendon_invweight0[i])
            element = f"range of tendon {self.names.tendons[i]}"
            tendon["limit_stiffness"], tendon["limit_viscous"] = soft_spring(self, element, *limit, stop=True)
            tendon["limit_damping"] = 0.0
        return tendon

    def _without_unused_wraps(self, tendon: str, path: Table) -> Table:
        """Return a path without the wraps that a point of their own body lies inside of: they never wrap."""
        waypoints = {name: validate(Waypoint, each, ("tendons", tendon, name)) for name, each in path.items()}
        unused = set()
        for point, wrap in points_inside_wraps(waypoints):
            self.left_out.add(f"wrap {wrap}: {point} lies inside of it, so that the path goes straight", moves=False)
            unused.add(wrap)
        return {name: each for name, each in path.items() if name not in unused}

    def _piece_name(self, k: int) -> str:
        kind, object_id, types = self.model.wrap_type[k], self.model.wrap_objid[k], self.mujoco.mjtWrap
        if kind == types.mjWRAP_PULLEY:
            return ""
        return (self.names.sites if kind == types.mjWRAP_SITE else self.names.geoms)[int(object_id)]

    def _piece(self, k: int) -> Table:
        """Return a piece of a spatial tendon's path."""
        model, types, kind = self.model, self.mujoco.mjtWrap, self.model.wrap_type[k]
        object_id = int(model.wrap_objid[k])
        if kind == types.mjWRAP_PULLEY:
            return {"kind": "pulley", "divisor": float(model.wrap_prm[k])}
        if kind == types.mjWRAP_SITE:
            entries = {"kind": "point", "position": model.site_pos[object_id].tolist()}
            return entries | self.names.carrier(int(model.site_bodyid[object_id]), "body")
        wrap = {
            "kind": "cylinder" if kind == types.mjWRAP_CYLINDER else "sphere",
            "position": model.geom_pos[object_id].tolist(),
            "orientation": quaternion(model.geom_quat[object_id]),
            "radius": float(model.geom_size[object_id, 0]),
            **self.names.carrier(int(model.geom_bodyid[object_id]), "body"),
        }
        side = int(model.wrap_prm[k])
        if side >= 0:
            carrier = int(model.site_bodyid[side])
            if carrier != model.geom_bodyid[object_id]:
                entries = {"position": model.site_pos[side].tolist(), **self.names.carrier(carrier, "body")}
                wrap["side_point"] = entries
            else:
                wrap["side"] = self._in_geom_frame(object_id, side).tolist()
                away = math.hypot(*wrap["side"][:2])
                if wrap["kind"] == "cylinder" and away < _ON_AXIS * wrap["radius"] <= abs(wrap["side"][2]):
                    line = f"wrap {self.names.geoms[object_id]}: its side site is on its axis, on no side of it"
                    self.left_out.add(line, moves=False)
                    if away < _NO_DIRECTION:
                        wrap["side"][:2] = _ON_AXIS * wrap["radius"], 0.0
        return wrap

    def _in_geom_frame(self, geom: int, site: int) -> Array:
        """Return a site in the frame of a geom, at the model's reference."""
        mujoco, model = self.mujoco, self.model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        rotation = data.geom_xmat[geom].reshape(3, 3)
        return np.asarray(rotation.T @ (data.site_xpos[site] - data.geom_xpos[geom]))
