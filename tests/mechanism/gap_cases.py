"""Random pairs of bodies that may touch, and gaps of many pairs at once."""

import coal
import numba
import numpy as np

from finger_pin.core.law_code import inlined
from finger_pin.mechanism.gaps import PRISM, prism_parameters

_value, _slopes = inlined(PRISM.value).made, inlined(PRISM.slopes).made


@numba.njit(_nrt=False)
def fill(y, p, found, slopes):
    """Fill what the gap finds for many pairs, shape (m, 13), and its slopes, shape (m, 78)."""
    for k in range(y.shape[0]):
        _value(y[k], p[k], found[k])
        _slopes(y[k], p[k], slopes[k])


def gaps(y, p):
    """Return distances and the rest, (m, 13), slopes of the rest, (m, 12, 6), and of the distance, (m, 6)."""
    found, slopes = np.empty((len(y), 13)), np.empty((len(y), 78))
    fill(y, p, found, slopes)
    return found, slopes[:, :72].reshape(-1, 12, 6), slopes[:, 72:]


def random_sizes(rng, shape):
    """Return sizes of a shape, as `prism_parameters` takes them, m."""
    return rng.uniform(0.005, 0.04, {"half_space": 0, "sphere": 1, "box": 3}.get(shape, 2))


def random_pairs(rng, shape, count, long):
    """Return y, p and sizes of W for capsules or spheres around a shape at the origin; most near, some touching."""
    sizes = np.array([random_sizes(rng, shape) for _ in range(count)])
    centre, half = 0.04 * rng.normal(size=(count, 3)), 0.02 * long * rng.normal(size=(count, 3))
    radius = rng.uniform(0.002, 0.01, count)
    p = np.array([[r, *prism_parameters(shape, each)] for r, each in zip(radius, sizes, strict=True)])
    return np.hstack([centre - half, centre + half]), p, sizes


def coal_shape(shape, sizes):
    """Return coal's shape."""
    if shape == "half_space":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    kinds = {"sphere": coal.Sphere, "box": coal.Box, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
    return kinds[shape](*sizes)


def coal_distance(shape, sizes, ends, radius, placement):
    """Return coal's signed distance, with everything moved by a placement."""
    length = np.linalg.norm(ends[3:] - ends[:3])
    along = (ends[3:] - ends[:3]) / length if length else np.array([0.0, 0.0, 1.0])
    helper = np.eye(3)[np.argmin(np.abs(along))]
    first = np.cross(helper, along) / np.linalg.norm(np.cross(helper, along))
    pose = coal.Transform3s(np.column_stack([first, np.cross(along, first), along]), (ends[:3] + ends[3:]) / 2.0)
    body = coal.Capsule(radius, length) if length else coal.Sphere(radius)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(body, placement * pose, coal_shape(shape, sizes), placement, request, result)
