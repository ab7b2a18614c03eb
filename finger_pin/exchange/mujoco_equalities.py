"""Equalities of a MuJoCo model, as stiff springs: joints, points of bodies, tendons; the others are listed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from finger_pin.exchange.mujoco_compliance import soft_spring
from finger_pin.exchange.mujoco_names import Table, distinct, model_name
from finger_pin.exchange.mujoco_unsupported import ElementReader

# Least distance of a weld's three points from their middle, m.
_LEAST_ARM = 1e-3


def linked_bodies(mujoco: Any, model: Any) -> set[int]:
    """Return the bodies that connections and welds hold together, without the world."""
    linked: set[int] = set()
    for i in (int(each) for each in np.flatnonzero(model.eq_active0)):
        if model.eq_type[i] in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
            linked |= set(_bodies(mujoco, model, i))
    return linked - {0}


def _bodies(mujoco: Any, model: Any, i: int) -> list[int]:
    """Return the bodies of a connection or weld."""
    of_sites = model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
    ids = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    return [int(model.site_bodyid[each]) if of_sites else each for each in ids]


def coupled_tendons(mujoco: Any, model: Any) -> set[int]:
    """Return the tendons that equalities hold which are carried over."""
    couplings = [i for i in np.flatnonzero(model.eq_active0) if _is_linear(mujoco, model, int(i))]
    return {tendon for i in couplings for tendon in _elements(model, int(i))}


def _is_linear(mujoco: Any, model: Any, i: int) -> bool:
    """Return whether an equality is one of tendons, and linear."""
    of_tendons = model.eq_type[i] == mujoco.mjtEq.mjEQ_TENDON
    return bool(of_tendons and not (len(_elements(model, i)) > 1 and np.any(model.eq_data[i, 2:5])))


def read_equalities(reader: ElementReader) -> tuple[Table, Table]:
    """Return couplings of joints and of tendons, and loops, each by name."""
    mujoco, model, left_out = reader.mujoco, reader.model, reader.left_out
    couplings: Table = {}
    loops: Table = {}
    for i in (int(each) for each in np.flatnonzero(model.eq_active0)):
        name = model_name(model, "equality", i)
        kind = mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower()
        if kind in ("connect", "weld"):
            points = _points(reader, i)
            loops |= {f"{name}_{k}" if len(points) > 1 else name: point for k, point in enumerate(points)}
        elif kind == "joint":
            couplings[name] = _coupling(reader, i)
        elif _is_linear(mujoco, model, i):
            couplings[name] = _tendon_coupling(reader, i)
        else:
            left_out.add(
                f"equality {name}: {'its polynomial is not linear' if kind == 'tendon' else f'of kind {kind}'}"
            )
    return _with_entry_names(couplings), _with_entry_names(loops)


def _points(reader: ElementReader, i: int) -> list[Table]:
    """Return the points that a connection holds together, three for a weld."""
    mujoco, model = reader.mujoco, reader.model
    first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    of_sites, bodies = model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE, _bodies(mujoco, model, i)
    if not any(reader.moves[bodies]):
        return []  # Both stand still.
    numbers = model.eq_data[i]
    if model.eq_type[i] == mujoco.mjtEq.mjEQ_CONNECT:
        places = [model.site_pos[first], model.site_pos[second]] if of_sites else [numbers[:3], numbers[3:6]]
        return [_loop(reader, i, bodies, places)]
    # A frame of the second body and one of the first stay together: three points of them do.
    frames = [np.eye(3), np.eye(3)]
    if of_sites:
        places = [model.site_pos[first], model.site_pos[second]]
        frames = [_matrix(mujoco, model.site_quat[each]) for each in (first, second)]
    else:
        # The anchor in the second body's frame; where it is in the first's, and how the second is turned there.
        frames[0], places = _matrix(mujoco, numbers[6:10]), [numbers[3:6], numbers[:3]]
    # Three springs of k / 3 at a distance s turn back with k s^2 / 2 about axes in their plane, and k s^2 across it.
    # MuJoCo has the scaled sine of half the angle, which is 1/4 of a spring of the turns' mobility.
    along, about = np.sum(model.body_invweight0[bodies], axis=0)
    size = float(numbers[10]) * math.sqrt(along / (3.0 * about)) if about > 0.0 else _LEAST_ARM
    if size < _LEAST_ARM:
        scale, least = float(numbers[10]), _LEAST_ARM / size * float(numbers[10]) if size else 0.0
        if not scale:
            # Nothing turns back.
            return [_loop(reader, i, bodies, places)]
        name = model_name(model, "equality", i)
        reader.left_out.add(f"equality {name}: torquescale {scale:g} is {least:.3g} here, the least", moves=False)
    corners = max(size, _LEAST_ARM) * np.array([[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]])
    poses = list(zip(places, frames, strict=True))
    return [_loop(reader, i, bodies, [place + frame @ corner for place, frame in poses], 3.0) for corner in corners]


def _matrix(mujoco: Any, quaternion: Any) -> Any:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _loop(reader: ElementReader, i: int, bodies: list[int], places: list[Any], divisor: float = 1.0) -> Table:
    """Return two points that stay together; the body that moves is the first."""
    model, names = reader.model, reader.names
    pairs = sorted(zip(bodies, places, strict=True), key=lambda pair: (not reader.moves[pair[0]], -pair[0]))
    (body, place), (other, other_place) = pairs
    mobility = float(np.sum(model.body_invweight0[bodies, 0]))
    # A body that turns about its mass centre alone has none.
    mobility = mobility or 1.0 / float(np.sum(model.body_mass[bodies]))
    spring = _spring(reader, i, mobility)
    return {
        "body": names.bodies[body],
        **names.carrier(other, "other"),
        "position": [float(each) for each in place],
        "other_position": [float(each) for each in other_place],
        **{key: each / divisor for key, each in spring.items()},
    }


def _with_entry_names(entries: Table) -> Table:
    return dict(zip(distinct("equality", list(entries)), entries.values(), strict=True))


def _elements(model: Any, i: int) -> list[int]:
    """Return the elements of an equality: one or two."""
    return [int(each[i]) for each in (model.eq_obj1id, model.eq_obj2id) if each[i] >= 0]


def _spring(reader: ElementReader, i: int, mobility: float) -> Table:
    model = reader.model
    element = f"equality {model_name(reader.model, 'equality', i)}"
    stiffness, damping = soft_spring(reader, element, model.eq_solref[i], model.eq_solimp[i], mobility)
    return {"stiffness": stiffness, "damping": damping}


def _coupling(reader: ElementReader, i: int) -> Table:
    """Return an equality of a joint with another, or with a number."""
    model, names = reader.model, reader.names
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
            _list_multiturn(reader, i, second)
    dofs = model.jnt_dofadr[[each for each in (first, second) if each >= 0]]
    spring = _spring(reader, i, float(np.sum(model.dof_invweight0[dofs])))
    return {"joint": names.joints[first], "offset": offset, **spring, **other}


def _list_multiturn(reader: ElementReader, i: int, joint: int) -> None:
    """List a polynomial of the angle of a hinge that may turn by more than half a turn from its range's middle."""
    model = reader.model
    hinge = model.jnt_type[joint] == reader.mujoco.mjtJoint.mjJNT_HINGE
    half = 0.5 * float(np.ptp(model.jnt_range[joint])) if model.jnt_limited[joint] else math.inf
    if hinge and half > math.pi:
        name, joint_name = model_name(model, "equality", i), model_name(model, "joint", joint)
        reader.left_out.add(f"equality {name}: powers of the angle of {joint_name} repeat beyond half a turn")


def _tendon_coupling(reader: ElementReader, i: int) -> Table:
    """Return an equality of a tendon with another, or with a number: lengths count from the references of both."""
    model, elements = reader.model, _elements(reader.model, i)
    spring = _spring(reader, i, float(np.sum(model.tendon_invweight0[elements])))
    first, *others = (reader.names.tendons[each] for each in elements)
    other = {"other": others[0], "ratio": float(model.eq_data[i, 1])} if others else {}
    return {"tendon": first, "offset": float(model.eq_data[i, 0]), **spring, **other}
