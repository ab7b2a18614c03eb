"""Names of the elements of a MuJoCo model, as entries of a description, and its quaternions."""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import dataclass
from typing import Any

from finger_pin.typing import Array

Table = dict[str, Any]


@dataclass(frozen=True)
class Names:
    """Names by index, letters, digits and underscores, all different within a kind; plugins by instance."""

    bodies: list[str]
    joints: list[str]
    tendons: list[str]
    sites: list[str]
    geoms: list[str]
    meshes: list[str]
    actuators: list[str]
    plugins: list[str]

    @classmethod
    def from_model(cls, model: Any, plugins: list[str]) -> Names:
        """Read the names of a model; names of plugin instances come from its specification."""
        return cls(
            bodies=distinct("body", [model.body(i).name for i in range(model.nbody)]),
            joints=distinct("joint", [model.joint(i).name for i in range(model.njnt)]),
            tendons=distinct("tendon", [model.tendon(i).name for i in range(model.ntendon)]),
            sites=distinct("site", [model.site(i).name for i in range(model.nsite)]),
            geoms=distinct("geom", [model.geom(i).name for i in range(model.ngeom)]),
            meshes=distinct("mesh", [model.mesh(i).name for i in range(model.nmesh)]),
            actuators=distinct(
                "actuator", [model.actuator(i).name for i in range(getattr(model, "nactuator", model.nu))]
            ),
            plugins=plugins,
        )

    def carrier(self, body: int, entry: str) -> Table:
        """Return the entry that names a body; nothing for the world."""
        return {entry: self.bodies[body]} if body else {}


def quaternion(real_first: Array) -> tuple[float, float, float, float]:
    """Return a quaternion x, y, z, w of one w, x, y, z."""
    w, x, y, z = real_first.tolist()
    return x, y, z, w


def entry_name(text: str) -> str:
    """Return a name of letters, digits and underscores."""
    name = re.sub(r"[^A-Za-z0-9_]+", "_", text).strip("_")[:60]
    return name if re.match(r"[A-Za-z]", name) else f"n{name}"


def model_name(model: Any, what: str, i: int) -> str:
    """Return the name that a model has for an element, such as a ``geom``, or what it is and its number."""
    return str(getattr(model, what)(i).name or f"{what}_{i}")


def distinct(what: str, names: list[str]) -> list[str]:
    """Return names for elements, all different; those without one are numbered."""
    entries: list[str] = []
    for index, text in enumerate(names):
        name = entry_name(text) if text else f"{what}_{index}"
        while name in entries:
            name = f"{name[:56]}_{index}"
        entries.append(name)
    return entries


def unused_name(name: str, used: Container[str], what: str) -> str:
    """Return an unused name: the kind of element is appended if the name is taken."""
    return unused_name(f"{name}_{what}", used, what) if name in used else name
