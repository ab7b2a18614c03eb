"""Random pairs of a body's part and another body, and gaps of many pairs at once."""

import coal
import numpy as np
from compiled_shapes import fill_rows

from finger_pin.mechanism.gaps import ELLIPSOIDS, PRISM, prism_parameters

#: Kinds of parts: whether they have a disc, and a length.
PARTS = {"point": (0.0, 0.0), "segment": (0.0, 1.0), "disc": (1.0, 0.0), "cylinder": (1.0, 1.0), "ellipsoid": None}
#: Distances of what lies along a face are too low by this much of a part's length and of its disc's diameter.
EPSILON = 1e-5 / 4.0


#: By the count of their parameters.
SHAPE = {len(shape.parameters): shape for shape in (PRISM, ELLIPSOIDS)}


def gaps(y, p):
    """Return distances and the rest, (m, 13), slopes of the rest, (m, 12, 6), and of the distance, (m, 6)."""
    shape = SHAPE[p.shape[1]]
    found, slopes = fill_rows(shape.value, 13, y, p), fill_rows(shape.slopes, 78, y, p)
    return found, slopes[:, :72].reshape(-1, 12, 6), slopes[:, 72:]


def random_pairs(rng, shape, part, count, fillet=0.0):
    """Return y, p and sizes of a shape at the origin for parts around it; most near, some touching."""
    numbers_of = {"half_space": 0, "sphere": 1, "box": 3, "ellipsoid": 3}
    sizes = rng.uniform(0.005, 0.04, (count, numbers_of.get(shape, 2)))
    centre, axis = 0.04 * rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    half = rng.uniform(0.002, 0.03, (count, 1)) * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    if part == "ellipsoid":
        across = np.cross(half, rng.normal(size=(count, 3)))
        across *= rng.uniform(0.002, 0.03, (count, 1)) / np.linalg.norm(across, axis=1, keepdims=True)
        third = rng.uniform(0.002, 0.03, count)
        p = np.column_stack([third, sizes])
        if shape != "ellipsoid":
            p = np.array(
                [
                    [0.0, 0.0, 0.0, c, *prism_parameters(shape, each, fillet)]
                    for c, each in zip(third, sizes, strict=True)
                ]
            )
        return np.hstack([centre, centre + half, centre + across]), p, sizes
    disc, along = PARTS[part]
    numbers = np.column_stack([rng.uniform(0.002, 0.01, count), disc * rng.uniform(0.003, 0.03, count)])
    p = np.array(
        [[*n, along, 0.0, *prism_parameters(shape, each, fillet)] for n, each in zip(numbers, sizes, strict=True)]
    )
    ends = (centre, centre) if part == "point" else (centre - half, centre + half)
    return np.hstack(ends), p, sizes


def twists(rng, y):
    """Return random motions of the part, about 1 m/s and 50 rad/s: rates of y, what slopes are by, turn and speed."""
    turn, speed = 50.0 * rng.normal(size=(len(y), 3)), rng.normal(size=(len(y), 3))
    rate = np.hstack([speed + np.cross(turn, point) for point in np.split(y, y.shape[1] // 3, axis=1)])
    return rate, (rate if y.shape[1] == 6 else np.hstack([rate[:, :3], turn])), turn, speed


def coal_shape(shape, sizes, fillet=0.0):
    """Return coal's shape, without the fillet."""
    if shape == "half_space":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    if shape == "box":
        return coal.Box(*(sizes - 2.0 * fillet))
    if shape == "cylinder":
        return coal.Cylinder(sizes[0] - fillet, sizes[1] - 2.0 * fillet)
    return {"sphere": coal.Sphere, "capsule": coal.Capsule, "ellipsoid": coal.Ellipsoid}[shape](*sizes)


def coal_distance(shape, sizes, y, p, placement, fillet=0.0):
    """Return coal's signed distance of a pair, with everything moved by a placement."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = 1e-10
    other = coal_shape(shape, sizes, fillet)
    if len(y) == 9:
        one, two, third = y[3:6] - y[:3], y[6:] - y[:3], p[0 if len(p) == 4 else 3]
        axes = np.column_stack([one / np.linalg.norm(one), two / np.linalg.norm(two), np.zeros(3)])
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
        body = coal.Ellipsoid(np.linalg.norm(one), np.linalg.norm(two), third)
        pose = coal.Transform3s(axes, y[:3])
        return coal.distance(body, placement * pose, other, placement, request, result) - fillet
    radius, disc, far = p[0], p[1], np.linalg.norm(y[3:] - y[:3])
    along = (y[3:] - y[:3]) / far if far else np.array([0.0, 0.0, 1.0])
    helper = np.eye(3)[np.argmin(np.abs(along))]
    first = np.cross(helper, along) / np.linalg.norm(np.cross(helper, along))
    length, centre = (far, 0.5 * (y[:3] + y[3:])) if p[2] else (0.0, y[:3])
    pose = coal.Transform3s(np.column_stack([first, np.cross(along, first), along]), centre)
    # A disc is a cylinder of no height; its rounding is taken off.
    body = coal.Cylinder(disc, max(length, 1e-9)) if disc else coal.Capsule(radius, length)
    if not disc and not length:
        body = coal.Sphere(radius)
    return coal.distance(body, placement * pose, other, placement, request, result) - fillet - (radius if disc else 0.0)
