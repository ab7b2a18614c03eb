"""Linear equalities of joints and of fixed tendons in a MuJoCo model, as stiff springs; the others are listed."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.mechanism.exchange.mujoco_names import Names, Table, distinct
from finger_pin.mechanism.exchange.mujoco_unsupported import ElementReader

# Time constant with which what is coupled follows, critically damped, s.
_COUPLED = 0.005


def read_equalities(read: ElementReader) -> tuple[Table, Table]:
    """Return couplings of joints, and the tendons that take the place of equalities of tendons, both by name."""
    mujoco, model, names, rest = read.mujoco, read.model, read.names, read.rest
    couplings: Table = {}
    tendons: Table = {}
    for i in (int(each) for each in np.flatnonzero(model.eq_active0)):
        name = model.equality(i).name or f"equality_{i}"
        kind = mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower()
        spatial = kind == "tendon" and any(_spatial(mujoco, model, t) for t in _both(model, i))
        if kind not in ("joint", "tendon"):
            rest.add(f"equality {name}: of kind {kind}")
        elif np.any(model.eq_data[i, 2:5]):
            rest.add(f"equality {name}: its polynomial is not linear")
        elif spatial:
            rest.add(f"equality {name}: of tendons through space")
        elif kind == "joint":
            couplings[name] = _coupling(model, names, i)
        else:
            tendons[name] = _difference(model, names, i)
    return _renamed(couplings), _renamed(tendons)


def _renamed(found: Table) -> Table:
    return dict(zip(distinct("equality", list(found)), found.values(), strict=True))


def _both(model: Any, i: int) -> list[int]:
    """Return the elements of an equality: one or two."""
    return [int(each[i]) for each in (model.eq_obj1id, model.eq_obj2id) if each[i] >= 0]


def _spatial(mujoco: Any, model: Any, tendon: int) -> bool:
    return bool(model.wrap_type[model.tendon_adr[tendon]] != mujoco.mjtWrap.mjWRAP_JOINT)


def _held(inertia: float) -> Table:
    return {"stiffness": inertia / _COUPLED**2, "damping": 2.0 * inertia / _COUPLED}


def _coupling(model: Any, names: Names, i: int) -> Table:
    """Return an equality of a joint with another, or with a number."""
    first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    constant, ratio = (float(each) for each in model.eq_data[i, :2])
    q0 = model.qpos0[model.jnt_qposadr]
    other = {"other": names.joints[second], "ratio": ratio} if second >= 0 else {}
    offset = q0[first] + constant - (ratio * q0[second] if second >= 0 else 0.0)
    inertia = float(model.dof_M0[model.jnt_dofadr[first]])
    return {"joint": names.joints[first], "offset": float(offset), **_held(inertia), **other}


def _difference(model: Any, names: Names, i: int) -> Table:
    """Return an equality of fixed tendons as a spring of a tendon as long as their difference."""
    tendons, ratios = _both(model, i), (1.0, -float(model.eq_data[i, 1]))
    found: dict[str, float] = {}
    rest, mobility = float(model.eq_data[i, 0]), 0.0
    for tendon, ratio in zip(tendons, ratios, strict=False):
        rest += ratio * float(model.tendon_length0[tendon])
        mobility += ratio**2 * float(model.tendon_invweight0[tendon])
        for k in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
            joint = names.joints[model.wrap_objid[k]]
            found[joint] = found.get(joint, 0.0) + ratio * float(model.wrap_prm[k])
    return {"joints": found, "rest": [rest, rest], **_held(1.0 / mobility)}
