"""Actuators of a MuJoCo model at sites: wrenches on bodies, along a site's own axes or those of another one."""

from __future__ import annotations

import numpy as np

from finger_pin.exchange.mujoco_names import Table, quaternion
from finger_pin.exchange.mujoco_unsupported import ElementReader
from finger_pin.mechanism.body_places import rotation


def target_kind(reader: ElementReader, i: int) -> str:
    """Return the kind of what an actuator drives: joint, tendon, site, or another."""
    kind = reader.mujoco.mjtTrn(int(reader.model.actuator_trntype[i])).name.removeprefix("mjTRN_").lower()
    return "joint" if kind == "jointinparent" else kind


def target_problem(reader: ElementReader, i: int) -> str | None:
    """Return the reason against carrying over what an actuator drives, or None."""
    model, target = reader.model, target_kind(reader, i)
    if target not in ("joint", "tendon", "site"):
        return f"it drives a {target}"
    if target == "joint" and model.jnt_type[model.actuator_trnid[i, 0]] == reader.mujoco.mjtJoint.mjJNT_FREE:
        return "it drives a free joint"
    return None


def actuated_sites(reader: ElementReader) -> list[int]:
    """Return the sites that actuators push, and those whose axes they do it along."""
    ends = reader.model.actuator_trnid[[target_kind(reader, i) == "site" for i in range(_count(reader))]]
    return [int(site) for site in ends.ravel() if site >= 0]


def moves_site(reader: ElementReader, i: int, joint: int) -> bool:
    """Return whether a joint moves a site of an actuator, which then exerts a force on it."""
    sites = reader.model.actuator_trnid[i] if target_kind(reader, i) == "site" else ()
    return any(int(reader.model.jnt_bodyid[joint]) in _carriers(reader, int(site)) for site in sites if site >= 0)


def at_site(reader: ElementReader, i: int, law: Table) -> Table | str:
    """Return the law of an actuator with its wrench, or the reason against carrying it over.

    MuJoCo's length is zero along a site's own axes. Along those of another site it is that from there, and there the
    reaction acts, which is that of a force between two points only if what moves the one moves the other.
    """
    model, (site, reference) = reader.model, reader.model.actuator_trnid[i].tolist()
    force, torque = model.actuator_gear[i].reshape(2, 3)
    if "muscle" in law:
        return "it is a muscle at a site"
    if any(np.any(getattr(model, f"actuator_{what}", np.zeros(i + 1))[i]) for what in ("armature", "damping")):
        return "it has armature or damping at a site"
    has_length = reference >= 0 and not np.any(torque)
    if law.get("integral") or (law["by_length"] and reference >= 0):
        if not has_length:
            return "it drives an angle between sites" if reference >= 0 else "it sums up the error of a length of zero"
    if not (np.any(force) or np.any(torque)):
        return "its gear at a site is zero"
    own = site if reference < 0 else reference
    axes = rotation(quaternion(model.site_quat[own]))
    wrench: Table = {
        **reader.names.carrier(int(model.site_bodyid[site]), "body"),
        "position": model.site_pos[site].tolist(),
        "force": (axes @ force).tolist(),
        "torque": (axes @ torque).tolist(),
    }
    if "body" not in wrench:
        return "its site stands still"
    if reference >= 0:
        if np.any(force) and not _jointed(reader, reference) <= _jointed(reader, site):
            return "its refsite moves beside its site"
        place = {"other_position": model.site_pos[reference].tolist()}
        wrench |= {"axes": "other", **reader.names.carrier(int(model.site_bodyid[reference]), "other"), **place}
    return law | {"gear": 1.0, "wrench": wrench} | ({} if reference >= 0 else {"by_length": 0.0})


def _count(reader: ElementReader) -> int:
    return int(getattr(reader.model, "nactuator", reader.model.nu))


def _carriers(reader: ElementReader, site: int) -> set[int]:
    """Return the bodies that carry a site, without the world."""
    body, carriers = int(reader.model.site_bodyid[site]), set[int]()
    while body:
        carriers.add(body)
        body = int(reader.model.body_parentid[body])
    return carriers


def _jointed(reader: ElementReader, site: int) -> set[int]:
    """Return the bodies with joints that carry a site."""
    return {body for body in _carriers(reader, site) if reader.model.body_jntnum[body]}
