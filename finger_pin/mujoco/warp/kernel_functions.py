"""Functions of the kernels: the law's text compiled by Warp, and the loads and turns of frictions."""

from collections.abc import Callable
from types import FunctionType
from typing import Any

import warp as wp

from finger_pin.mujoco import friction_step
from finger_pin.mujoco.warp.structures import ForceInputs, PinInputs, TendonInputs

wp.set_module_options({"enable_backward": False})


def _compiled(function: Callable[..., Any], callees: dict[str, Any]) -> Any:
    """Return a plain function as one of Warp's, in which those of the text that it calls are Warp's too."""
    assert isinstance(function, FunctionType)
    copied = FunctionType(function.__code__, {**function.__globals__, **callees}, function.__name__)
    copied.__annotations__, copied.__module__ = function.__annotations__, __name__
    return wp.func(copied)


coefficient, one_minus_exp, delivered = (
    _compiled(each, {}) for each in (friction_step.coefficient, friction_step.one_minus_exp, friction_step.delivered)
)
capstan = _compiled(friction_step.capstan, {"one_minus_exp": one_minus_exp})
bristle_stiffness = _compiled(friction_step.bristle_stiffness, {"capstan": capstan})
slide = _compiled(friction_step.slide, {"one_minus_exp": one_minus_exp})
sliding_level = _compiled(friction_step.sliding_level, {"coefficient": coefficient, "capstan": capstan})
row_terms = _compiled(friction_step.row_terms, {"slide": slide})


@wp.func
def spring(w: int, tendon: int, x: TendonInputs) -> float:
    """Return the force of a tendon's own spring and damper along it, N, negative in tension."""
    rest_range = x.tendon_lengthspring[w % x.tendon_lengthspring.shape[0], tendon]
    length = x.ten_length[w, tendon]
    stretch = wp.max(rest_range[0] - length, 0.0) + wp.min(rest_range[1] - length, 0.0)
    return (
        x.tendon_stiffness[w % x.tendon_stiffness.shape[0], tendon] * stretch
        - x.tendon_damping[w % x.tendon_damping.shape[0], tendon] * x.ten_velocity[w, tendon]
    )


@wp.func
def path_point(w: int, k: int, x: TendonInputs) -> wp.vec3:
    """Return a point of the paths of all tendons: two stand in a vector."""
    pair, first = x.wrap_xpos[w, k // 2], 3 * (k % 2)
    return wp.vec3(pair[first], pair[first + 1], pair[first + 2])


@wp.func
def turn_of_path(w: int, tendon: int, x: TendonInputs) -> float:
    """Return the angle by which a path turns up to its first pulley, rad, as `loads.turn_of_path` does."""
    first = x.ten_wrapadr[w, tendon]
    turn = float(0.0)
    previous = wp.vec3(0.0, 0.0, 0.0)
    before_pulley = bool(True)
    for k in range(first + 1, first + x.ten_wrapnum[w, tendon]):
        if x.wrap_obj[w, k // 2][k % 2] == -2 or x.wrap_obj[w, (k - 1) // 2][(k - 1) % 2] == -2:
            before_pulley = False
        segment = path_point(w, k, x) - path_point(w, k - 1, x)
        # Nearer points are one point, to the digits that positions have.
        if before_pulley and wp.length_sq(segment) >= 1e-12:
            # Nothing comes before the first length: with a product of -0.0 it would turn by pi.
            if wp.length_sq(previous) > 0.0:
                turn += wp.atan2(wp.length(wp.cross(segment, previous)), wp.dot(segment, previous))
            previous = segment
    return turn


@wp.func
def proximal(w: int, joint: int, x: PinInputs) -> wp.vec3:
    """Return e_j: from the joint before to this one, or the x axis of its carrier."""
    carrier = x.body_parentid[x.jnt_bodyid[joint]]
    direction = wp.vec3(x.xmat[w, carrier][0, 0], x.xmat[w, carrier][1, 0], x.xmat[w, carrier][2, 0])
    body = int(carrier)
    while body > 0:
        if x.body_jntnum[body] > 0:
            offset = x.xanchor[w, joint] - x.xanchor[w, x.body_jntadr[body] + x.body_jntnum[body] - 1]
            if wp.length(offset) > 1e-6:
                direction = wp.normalize(offset)
                body = 0
        body = x.body_parentid[body]
    return direction


@wp.func
def contact_force(w: int, r: int, elliptic: bool, x: ForceInputs) -> wp.vec3:
    """Return the force of a contact on its second geom, world frame, N, from its rows from r on."""
    c = x.id[w, r]
    dim, frame, force = x.dim[c], x.frame[c], x.force
    first, second = x.friction[c][0], x.friction[c][1]
    normal = float(force[w, r])
    across, along = float(0.0), float(0.0)
    if dim > 1 and elliptic:
        across, along = float(force[w, r + 1]), float(force[w, r + 2])
    elif dim > 1:
        for k in range(1, 2 * (dim - 1)):
            normal += force[w, r + k]
        across = first * (force[w, r] - force[w, r + 1])
        along = second * (force[w, r + 2] - force[w, r + 3])
    return normal * frame[0] + across * frame[1] + along * frame[2]
