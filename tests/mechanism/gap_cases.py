"""Random pairs of a body's part and another body, and gaps of many pairs at once."""

import coal
import numba
import numpy as np

from finger_pin.core.evaluation.law_code import inlined
from finger_pin.mechanism.gaps import PRISM, prism_parameters

_value, _slopes = inlined(PRISM.value), inlined(PRISM.slopes)
#: Kinds of parts: whether they have a disc, and a length.
PARTS = {"point": (0.0, 0.0), "segment": (0.0, 1.0), "disc": (1.0, 0.0), "cylinder": (1.0, 1.0)}
#: Distances of what lies along a face are too low by this much of a part's length and of its disc's diameter.
EPSILON = 1e-5 / 4.0


@numba.njit
def fill(y, p, found, slopes):
    """Fill the gap of many pairs, shape (m, 13), and its slopes, shape (m, 78)."""
    for k in range(y.shape[0]):
        _value(y[k], p[k], found[k])
        _slopes(y[k], p[k], slopes[k])


def gaps(y, p):
    """Return distances and the rest, (m, 13), slopes of the rest, (m, 12, 6), and of the distance, (m, 6)."""
    found, slopes = np.empty((len(y), 13)), np.empty((len(y), 78))
    fill(y, p, found, slopes)
    return found, slopes[:, :72].reshape(-1, 12, 6), slopes[:, 72:]


def random_pairs(rng, shape, part, count, fillet=0.0):
    """Return y, p and sizes of a shape at the origin for parts around it; most near, some touching."""
    sizes = rng.uniform(0.005, 0.04, (count, {"half_space": 0, "sphere": 1, "box": 3}.get(shape, 2)))
    centre, axis = 0.04 * rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    half = rng.uniform(0.002, 0.03, (count, 1)) * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    disc, along = PARTS[part]
    numbers = np.column_stack([rng.uniform(0.002, 0.01, count), disc * rng.uniform(0.003, 0.03, count)])
    p = np.array([[*n, along, *prism_parameters(shape, each, fillet)] for n, each in zip(numbers, sizes, strict=True)])
    ends = (centre, centre) if part == "point" else (centre - half, centre + half)
    return np.hstack(ends), p, sizes


def twists(rng, y):
    """Return rates of y by random motions of the part, of about 1 m/s and 50 rad/s."""
    turn, speed = 50.0 * rng.normal(size=(len(y), 3)), rng.normal(size=(len(y), 3))
    return np.hstack([speed + np.cross(turn, y[:, :3]), speed + np.cross(turn, y[:, 3:])])


def coal_shape(shape, sizes, fillet=0.0):
    """Return coal's shape, without the fillet."""
    if shape == "half_space":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    if shape == "box":
        return coal.Box(*(sizes - 2.0 * fillet))
    if shape == "cylinder":
        return coal.Cylinder(sizes[0] - fillet, sizes[1] - 2.0 * fillet)
    return {"sphere": coal.Sphere, "capsule": coal.Capsule}[shape](*sizes)


def coal_distance(shape, sizes, y, p, placement, fillet=0.0):
    """Return coal's signed distance of a pair, with everything moved by a placement."""
    radius, disc, far = p[0], p[1], np.linalg.norm(y[3:] - y[:3])
    along = (y[3:] - y[:3]) / far if far else np.array([0.0, 0.0, 1.0])
    helper = np.eye(3)[np.argmin(np.abs(along))]
    first = np.cross(helper, along) / np.linalg.norm(np.cross(helper, along))
    length, centre = (far, 0.5 * (y[:3] + y[3:])) if p[2] else (0.0, y[:3])
    pose = coal.Transform3s(np.column_stack([first, np.cross(along, first), along]), centre)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = 1e-10
    # A disc is a cylinder of no height; its rounding is taken off.
    body = coal.Cylinder(disc, max(length, 1e-9)) if disc else coal.Capsule(radius, length)
    if not disc and not length:
        body = coal.Sphere(radius)
    other = coal_shape(shape, sizes, fillet)
    return coal.distance(body, placement * pose, other, placement, request, result) - fillet - (radius if disc else 0.0)
