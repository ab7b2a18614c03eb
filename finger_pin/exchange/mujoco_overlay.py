"""Tendons laid over a MuJoCo model that has none, such as most exports of CAD: read from TOML, added to a `MjSpec`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import model_validator

from finger_pin.description.tree_parts import TreeTendon
from finger_pin.description.validation import problem, quantity, real, suggestion, validate
from finger_pin.exceptions import InputError
from finger_pin.files import read_text


class AddedTendon(TreeTendon):
    """A tendon of the tree that a motor pulls."""

    pull: Annotated[float, real(0.0, 1e6)] = quantity(
        100.0, unit="N", source="design", doc="The most that its motor pulls with; 0: it has none."
    )

    @model_validator(mode="after")
    def _check_mujoco(self) -> Self:
        if self.slack is not None:
            raise problem("slack", "is not for MuJoCo's springs, which have a rest", self.slack)
        if self.joints is not None and self.path is not None:
            raise problem("", "needs joints or a path, and not both")
        return self


def add_tendons(spec: Any, tendons: Mapping[str, Mapping[str, Any]] | str | Path) -> None:
    """Add tendons, and motors that pull them, to a MuJoCo model.

    Args:
        spec: A `mujoco.MjSpec`, which is changed.
        tendons: Tables by name, or a TOML file with a table ``[tendons.NAME]`` for each: ``joints``, the length gained
            per joint position (a radius, negative where tension turns the joint in its positive direction), or
            ``path``,
            points and wraps on bodies, as ``finger.tree.tendons`` has them; ``stiffness``, ``rest``, ``damping`` and
            ``range`` on request, and ``pull``, N.

    Raises:
        InputError: If the file cannot be read, a key or number is not allowed, a joint or body is missing, or a name is
            taken.
    """
    import mujoco

    for name, table in _tables(tendons).items():
        added = validate(AddedTendon, dict(table), ("tendons", name))
        if spec.tendon(name) is not None:
            raise InputError(f"tendons.{name}", "the model has a tendon of this name")
        tendon = spec.add_tendon(name=name)
        for joint, radius in (added.joints or {}).items():
            _check_exists(spec.joint(joint), spec.joints, f"tendons.{name}.joints.{joint}", "joint")
            tendon.wrap_joint(joint, radius)
        for place, point in (added.path or {}).items():
            _add_waypoint(mujoco, spec, tendon, f"{name}_{place}", point, f"tendons.{name}.path.{place}")
        _add_numbers(tendon, added)
        if added.pull > 0.0:
            motor = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_TENDON, target=name)
            motor.gear, motor.ctrllimited, motor.ctrlrange = [-1.0, 0, 0, 0, 0, 0], 1, [0.0, added.pull]


def _tables(tendons: Mapping[str, Mapping[str, Any]] | str | Path) -> Mapping[str, Mapping[str, Any]]:
    if isinstance(tendons, Mapping):
        return tendons
    try:
        document = tomllib.loads(read_text(f"tendons {tendons}", Path(tendons)))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"tendons {tendons}", f"cannot be read: {error}") from None
    tables = document.get("tendons")
    if set(document) != {"tendons"} or not isinstance(tables, dict):
        raise InputError(f"tendons {tendons}", "must be tables [tendons.NAME], and nothing else")
    return tables


def _check_exists(element: Any, elements: Any, entry: str, what: str) -> None:
    if element is None:
        names = [each.name for each in elements if each.name]
        hint = suggestion(entry.rsplit(".", 1)[1], names)
        raise InputError(entry, f"no such {what}; there are {', '.join(names) or 'none'}{hint}")


def _add_waypoint(mujoco: Any, spec: Any, tendon: Any, name: str, point: Any, entry: str) -> None:
    """Add a piece of a path: a site, a geom that only wraps, or a pulley."""
    if point.kind == "pulley":
        tendon.wrap_pulley(point.divisor)
        return
    body = spec.worldbody if point.body is None else spec.body(point.body)
    _check_exists(body, spec.bodies, f"{entry}.{point.body}", "body")
    if point.kind == "point":
        body.add_site(name=name, pos=point.position)
        tendon.wrap_site(name)
        return
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER if point.kind == "cylinder" else mujoco.mjtGeom.mjGEOM_SPHERE
    quaternion = np.roll(point.orientation, 1)
    frame = {"pos": point.position, "quat": quaternion, "size": [point.radius, point.radius, 0.0]}
    body.add_geom(name=name, type=kind, contype=0, conaffinity=0, mass=0.0, group=4, **frame)
    side = ""
    if point.side is not None:
        direction = np.zeros(3)
        mujoco.mju_rotVecQuat(direction, np.array(point.side), quaternion)
        side = f"{name}_side"
        body.add_site(name=side, pos=np.array(point.position) + direction)
    tendon.wrap_geom(name, side)


def _add_numbers(tendon: Any, added: AddedTendon) -> None:
    """Set spring, damper, range and friction of a tendon."""
    tendon.stiffness = np.append(added.stiffness, np.zeros(len(np.atleast_1d(tendon.stiffness)) - 1))
    tendon.damping = np.append(added.damping, np.zeros(len(np.atleast_1d(tendon.damping)) - 1))
    tendon.frictionloss = added.friction
    if added.stiffness > 0.0:
        tendon.springlength = added.rest
    if added.range is not None:
        tendon.limited, tendon.range = 1, added.range
