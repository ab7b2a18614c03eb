"""Equalities of a MuJoCo model, as stiff springs: joints, points of bodies, fixed tendons; the others are listed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from finger_pin.exchange.mujoco_names import Names, Table, distinct
from finger_pin.exchange.mujoco_unsupported import ElementReader

# Time constant with which what is coupled follows, critically damped, s.
_COUPLED = 0.005
# The same of points that close a loop, whose springs carry what the loop does, s.
_CLOSED = 0.0005
# Of the points that a weld holds, the least distance from their middle, m.
_WELD = 0.01


def read_equalities(read: ElementReader) -> tuple[Table, Table, Table]:
    """Return couplings of joints, loops, and the tendons that stand for equalities of tendons, each by name."""
    mujoco, model, names, rest = read.mujoco, read.model, read.names, read.rest
    couplings: Table = {}
    loops: Table = {}
    tendons: Table = {}
    for i in (int(each) for each in np.flatnonzero(model.eq_active0)):
        name = model.equality(i).name or f"equality_{i}"
        kind = mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower()
        if kind in ("connect", "weld"):
            found = _points(mujoco, model, names, i)
            if isinstance(found, str):
                rest.add(f"equality {name}: {found}")
            else:
                loops |= {f"{name}_{k}" if len(found) > 1 else name: each for k, each in enumerate(found)}
        elif kind == "joint":
            couplings[name] = _coupling(model, names, i)
        elif kind != "tendon":
            rest.add(f"equality {name}: of kind {kind}")
        elif np.any(model.eq_data[i, 2:5]):
            rest.add(f"equality {name}: its polynomial is not linear")
        elif any(_spatial(mujoco, model, t) for t in _both(model, i)):
            rest.add(f"equality {name}: of tendons through space")
        else:
            tendons[name] = _difference(model, names, i)
    return _renamed(couplings), _renamed(loops), _renamed(tendons)


def _points(mujoco: Any, model: Any, names: Names, i: int) -> list[Table] | str:
    """Return the points that a connection holds together, three for a weld, or the reason for their lack."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    of_sites = model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
    bodies = [int(model.site_bodyid[each]) if of_sites else each for each in (first, second)]
    if any(model.body_mocapid[each] >= 0 for each in bodies):
        return "to a mocap body, which others lead"
    given, turned = model.eq_data[i], [data.xmat[each].reshape(3, 3) for each in bodies]
    if model.eq_type[i] == mujoco.mjtEq.mjEQ_CONNECT:
        places = [model.site_pos[first], model.site_pos[second]] if of_sites else [given[:3], given[3:6]]
        return [_loop(model, names, bodies, places)]
    # A frame of the second body and one of the first stay together: three points of them do.
    frames = [np.eye(3), np.eye(3)]
    if of_sites:
        places = [model.site_pos[first], model.site_pos[second]]
        frames = [_matrix(mujoco, model.site_quat[each]) for each in (first, second)]
    else:
        # The anchor in the second body's frame; where it is in the first's, and how the second is turned there.
        anchor, pose = given[:3], given[3:10]
        frames[0] = _matrix(mujoco, pose[3:7])
        places = [pose[:3] + frames[0] @ anchor, anchor]
    size = max(float(np.linalg.norm(turned[0] @ (model.body_ipos[bodies[0]] - places[0]))), _WELD)
    corners = size * np.array([[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]])
    return [
        _loop(model, names, bodies, [place + frame @ corner for place, frame in zip(places, frames, strict=True)], 3.0)
        for corner in corners
    ]


def _matrix(mujoco: Any, quaternion: Any) -> Any:
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, quaternion)
    return found.reshape(3, 3)


def _loop(model: Any, names: Names, bodies: list[int], places: list[Any], shared: float = 1.0) -> Table:
    """Return two points that stay together; the body that moves is the first."""
    pairs = sorted(zip(bodies, places, strict=True), key=lambda each: -each[0])
    (body, place), (other, there) = pairs
    lightness = float(np.sum(model.body_invweight0[bodies, 0]))
    # A body that turns about its mass centre alone has none.
    mass = (1.0 / lightness if lightness > 0.0 else float(np.sum(model.body_mass[bodies]))) / shared
    return {
        "body": names.bodies[body],
        **names.carrier(other, "other"),
        "position": [float(each) for each in place],
        "other_position": [float(each) for each in there],
        "stiffness": mass / _CLOSED**2,
        "damping": 2.0 * mass / _CLOSED,
    }


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
    q0 = model.qpos0[model.jnt_qposadr]
    # From the references of both.
    powers = Polynomial([float(each) for each in model.eq_data[i, :5]])
    offset = float(q0[first] + powers.coef[0])
    other: Table = {}
    if second >= 0:
        powers = powers(Polynomial([-float(q0[second]), 1.0]))
        coefficients = [*powers.coef.tolist(), 0.0, 0.0]
        other = {"other": names.joints[second], "ratio": coefficients[1]}
        offset = float(q0[first]) + coefficients[0]
        if any(coefficients[2:]):
            other["powers"] = coefficients[2 : len(powers.coef)]
    inertia = float(model.dof_M0[model.jnt_dofadr[first]])
    return {"joint": names.joints[first], "offset": offset, **_held(inertia), **other}


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
