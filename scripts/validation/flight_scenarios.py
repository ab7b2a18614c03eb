"""Random flights, spins and sweeps of bodies towards each other, whose motion is known until they touch; and falls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.description.objects import Object
from finger_pin.description.placement import PathSignal
from finger_pin.mechanism.solids import object_solid
from finger_pin.typing import Array

G = 9.81
#: Touches that are not as deep, m, and misses that are as near, are left out: they are within the tolerances.
DEPTH = 1e-7
_FASTEST = 15.0


@dataclass(frozen=True, eq=False)
class Flight:
    """Bodies under way, and their exact motion.

    Attributes:
        objects: By name.
        duration: s.
        gap: Maps packed positions, shape (m, nq), to the distance of the two surfaces, negative inside, shape (m,), m.
        exact: Maps times, shape (m,), to the packed positions if nothing touched, shape (m, nq).
        gravity: Along z, m/s2.
        speed: Of a link of 0.1 m that turns about z in the origin, rad/s; None without.
        path: Of the first object along x, if it is moved.
        margin: Touches less deep are left out, m.
    """

    objects: dict[str, Object]
    duration: float
    gap: Callable[[Array], Array]
    exact: Callable[[Array], Array]
    gravity: float = 0.0
    speed: float | None = None
    path: PathSignal | None = None
    margin: float = DEPTH


def from_box(points: Array, sides: Array) -> Array:
    """Return signed distances of points from a box about the origin."""
    beyond = np.abs(points) - 0.5 * np.asarray(sides)
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0))


def from_segment(points: Array, start: Array, end: Array) -> Array:
    """Return distances of points from segments."""
    along = end - start
    share = np.clip(np.sum((points - start) * along, axis=-1) / np.sum(along * along, axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[..., None] * along, axis=-1))


def turned(quaternions: Array, vector: Array) -> Array:
    """Return a vector turned by quaternions (x, y, z, w), shape (m, 4)."""
    axis, scalar = quaternions[:, :3], quaternions[:, 3:]
    across = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + scalar * across + np.cross(axis, across))


def thrown(times: Array, start: Array, velocity: Array, gravity: float) -> Array:
    """Return a parabola."""
    places = start + np.outer(times, velocity)
    places[:, 2] -= 0.5 * gravity * times**2
    return places


def pose(places: Array, turns: Array | None = None) -> Array:
    """Return poses at places, turned by angles about y."""
    found = np.column_stack([places, np.zeros((len(places), 3)), np.ones(len(places))])
    if turns is not None:
        found[:, 4], found[:, 6] = np.sin(0.5 * turns), np.cos(0.5 * turns)
    return found


def _surface(rng: np.random.Generator) -> dict[str, float]:
    return {"stiffness": 10 ** rng.uniform(4.0, 6.0), "damping": float(rng.choice([0.0, 1.0, 5.0]))}


def _mass(wanted: float, volume: float) -> float:
    """Return a mass, or that of a heavy metal of this volume, m3, if this is less: denser solids are refused."""
    return min(wanted, 2e4 * float(volume))


def _velocity(rng: np.random.Generator) -> Array:
    found = np.asarray(rng.normal(size=3) * 10 ** rng.uniform(-1.5, 1))
    # So that nothing starts further away than objects may.
    return found * min(1.0, _FASTEST / float(np.linalg.norm(found)))


def ball_and_plate(rng: np.random.Generator) -> Flight:
    """Throw a small ball at a thin plate, with gravity or without, spinning."""
    radius, thick, velocity = 10 ** rng.uniform(-3, -1.5), 10 ** rng.uniform(-3.3, -1.5), _velocity(rng)
    gravity, meets = float(rng.choice([0.0, G])), 10 ** rng.uniform(-1.5, 0.5)
    sides, surface = np.array([*rng.uniform(0.1, 1.0, 2), thick]), _surface(rng)
    aim = np.array([*(0.6 * rng.uniform(-1.0, 1.0, 2) * sides[:2]), 0.5 * thick])
    start = aim - velocity * meets + [0.0, 0.0, 0.5 * gravity * meets**2]
    plate = Object(shape="box", sides=tuple(sides), surface=surface)
    ball = Object(
        shape="sphere",
        radius=radius,
        mass=_mass(10 ** rng.uniform(-3, -0.5), 4.0 * radius**3),
        position=tuple(start),
        velocity=tuple(velocity),
        angular_velocity=tuple(_velocity(rng) * 10.0),
        surface=surface,
    )
    return Flight(
        {"plate": plate, "ball": ball},
        2.0 * meets,
        lambda q: from_box(q[:, :3], sides) - radius,
        lambda t: pose(thrown(t, start, velocity, gravity)),
        gravity,
    )


def two_balls(rng: np.random.Generator) -> Flight:
    """Let two balls fall and meet, or miss each other by little."""
    radii, velocities = 10 ** rng.uniform(-3, -1.5, 2), [_velocity(rng), _velocity(rng)]
    meets, gravity, surface = 10 ** rng.uniform(-1.5, 0.5), float(rng.choice([0.0, G])), _surface(rng)
    beside = rng.normal(size=3)
    beside *= 1.2 * rng.random() * radii.sum() / np.linalg.norm(beside)
    fallen = np.array([0.0, 0.0, 0.5 * gravity * meets**2])
    starts = [fallen - velocities[0] * meets, fallen + beside - velocities[1] * meets]
    balls = {
        f"ball_{i}": Object(
            shape="sphere",
            radius=radii[i],
            mass=_mass(0.01 + rng.random(), 4.0 * radii[i] ** 3),
            position=tuple(starts[i]),
            velocity=tuple(velocities[i]),
            surface=surface,
        )
        for i in range(2)
    }
    return Flight(
        balls,
        2.0 * meets,
        lambda q: np.asarray(np.linalg.norm(q[:, :3] - q[:, 7:10], axis=1) - radii.sum()),
        lambda t: np.hstack([pose(thrown(t, *each, gravity)) for each in zip(starts, velocities, strict=True)]),
        gravity,
    )


def spinning_capsule(rng: np.random.Generator) -> Flight:
    """Let a capsule spin across its axis on its way past a small fixed ball."""
    radii, length, velocity = 10 ** rng.uniform(-3, -2, 2), rng.uniform(0.02, 0.2), _velocity(rng)
    meets, spin, surface = 10 ** rng.uniform(-1.5, 0.5), float(rng.normal() * 10 ** rng.uniform(-1, 2)), _surface(rng)
    start = rng.uniform(-0.5, 0.5, 3) * length - velocity * meets
    capsule = Object(
        shape="capsule",
        radius=radii[0],
        length=length,
        mass=_mass(0.1, 3.0 * length * radii[0] ** 2),
        position=tuple(start),
        velocity=tuple(velocity),
        angular_velocity=(0.0, spin, 0.0),
        surface=surface,
    )
    post = Object(shape="sphere", radius=radii[1], surface=surface)

    def gap(q: Array) -> Array:
        half = turned(q[:, 3:7], np.array([0.0, 0.0, 0.5 * length]))
        return from_segment(np.zeros(3), q[:, :3] - half, q[:, :3] + half) - radii.sum()

    return Flight(
        {"post": post, "capsule": capsule}, 2.0 * meets, gap, lambda t: pose(thrown(t, start, velocity, 0.0), spin * t)
    )


def tumbling(rng: np.random.Generator, shape: str) -> Flight:
    """Throw a tumbling body up from a floor: it reaches it at some time."""
    sides, spin, surface = 10 ** rng.uniform(-2.3, -1, 3), float(rng.normal() * 10 ** rng.uniform(-1, 2)), _surface(rng)
    velocity = _velocity(rng)
    start = np.array([0.0, 0.0, 0.51 * np.linalg.norm(sides) + 10 ** rng.uniform(-6, 0)])
    up = max(velocity[2], 0.0)
    duration = 1.2 * (up + np.sqrt(up**2 + 2.0 * G * start[2])) / G
    body = Object(
        shape=shape,
        **({"sides": tuple(sides)} if shape == "box" else {"semi_axes": tuple(0.5 * sides)}),
        mass=_mass(0.1, np.prod(sides)),
        position=tuple(start),
        velocity=tuple(velocity),
        angular_velocity=(0.0, spin, 0.0),
        surface=surface,
    )
    floor = Object(shape="half_space", surface=surface)

    def gap(q: Array) -> Array:
        # How far each half axis goes down; of a box their sum, of an ellipsoid the square root of their squares' sum.
        down = np.stack([turned(q[:, 3:7], axis)[:, 2] for axis in np.diag(0.5 * sides)])
        return np.asarray(q[:, 2] - np.linalg.norm(down, ord=1 if shape == "box" else 2, axis=0))

    exact = lambda t: pose(thrown(t, start, velocity, G), spin * t)  # noqa: E731
    return Flight({"floor": floor, "body": body}, duration, gap, exact, G)


def tumbling_box(rng: np.random.Generator) -> Flight:
    """Throw a tumbling box up from a floor."""
    return tumbling(rng, "box")


def tumbling_ellipsoid(rng: np.random.Generator) -> Flight:
    """Throw a tumbling ellipsoid up from a floor."""
    return tumbling(rng, "ellipsoid")


def paddle(rng: np.random.Generator) -> Flight:
    """Let a thin paddle swing to and fro through a ball at rest."""
    radius, thick, surface = 10 ** rng.uniform(-2.5, -1.5), 10 ** rng.uniform(-3, -2), _surface(rng)
    path = PathSignal(amplitude=rng.uniform(0.1, 0.3), frequency=10 ** rng.uniform(-0.5, 1))
    assert path.frequency is not None
    sides, amplitude, circular = np.array([thick, 0.1, 0.1]), path.amplitude, 2.0 * np.pi * path.frequency
    place = np.array([float(rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 0.9) * amplitude), *rng.uniform(-0.03, 0.03, 2)])
    blade = Object(shape="box", sides=tuple(sides), path={"x": path}, surface=surface)
    ball = Object(
        shape="sphere", radius=radius, mass=_mass(0.05, 4.0 * radius**3), position=tuple(place), surface=surface
    )

    def exact(t: Array) -> Array:
        swung = np.column_stack([amplitude * np.sin(circular * t), 0.0 * t, 0.0 * t])
        return np.hstack([pose(swung), pose(np.tile(place, (len(t), 1)))])

    gap = lambda q: from_box(q[:, 7:10] - q[:, :3], sides) - radius  # noqa: E731
    return Flight({"paddle": blade, "ball": ball}, 1.0 / path.frequency, gap, exact, path=path, margin=0.5 * radius)


def sweeping_link(rng: np.random.Generator) -> Flight:
    """Let a link sweep around a joint, past a small free ball at rest."""
    radius, speed, surface = 10 ** rng.uniform(-3, -2), 10 ** rng.uniform(-1, 2), _surface(rng)
    speed *= float(rng.choice([-1, 1]))
    far, angle = rng.uniform(0.03, 0.12), rng.uniform(0.5, 2.0 * np.pi - 0.5)
    place = np.array([far * np.cos(angle), far * np.sin(angle), 1.2 * rng.uniform(-1, 1) * (radius + 0.005)])
    ball = Object(
        shape="sphere", radius=radius, mass=_mass(0.05, 4.0 * radius**3), position=tuple(place), surface=surface
    )

    def gap(q: Array) -> Array:
        tip = 0.095 * np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0]), 0.0 * q[:, 0]])
        return from_segment(q[:, 1:4], np.zeros(3), tip) - radius - 0.005

    def exact(t: Array) -> Array:
        return np.hstack([speed * t[:, None], pose(np.tile(place, (len(t), 1)))])

    return Flight({"ball": ball}, 2.0 * np.pi / abs(speed), gap, exact, speed=speed)


_THIN, _TABLE, _GROUND = 5e-3, 0.2, Object(shape="half_space")
FALLING = ("sphere", "box", "cylinder", "capsule", "ellipsoid")
FALLEN_ON = ("half_space", *FALLING)


def _sizes(rng: np.random.Generator, shape: str) -> dict[str, object]:
    if shape == "box":
        return {"sides": tuple(rng.uniform(0.015, 0.05, 3))}
    if shape == "ellipsoid":
        return {"semi_axes": tuple(rng.uniform(0.008, 0.025, 3))}
    length = {"length": rng.uniform(0.01, 0.06)} if shape in ("cylinder", "capsule") else {}
    return {"radius": rng.uniform(0.006, 0.02), **length} if shape != "half_space" else {}


def falls(rng: np.random.Generator, shape: str, onto: str) -> tuple[Flight, Flight]:
    """Let a body of 50 g fall 0.1 to 0.4 m onto a fixed one; and the same onto a half-space.

    Half of what it falls on stands upright, and half of those boxes are tables, from 5 mm thick.
    """
    size, turn, drop = _sizes(rng, shape), tuple(rng.normal(size=4)), float(rng.uniform(0.1, 0.4))
    base, upright = _sizes(rng, onto), onto == "half_space" or rng.random() < 0.5
    if onto == "box" and upright and rng.random() < 0.5:
        base["sides"] = (_TABLE, _TABLE, rng.uniform(_THIN, 0.04))
    fixed = Object(shape=onto, **base, orientation=(0.0, 0.0, 0.0, 1.0) if upright else tuple(rng.normal(size=4)))
    aside = rng.uniform(-0.01, 0.01, 2)

    def onto_one(floor: Object) -> Flight:
        reach = sum(_reach(each) for each in (floor, Object(shape=shape, **size)))
        body = Object(
            shape=shape,
            **size,
            mass=0.05,
            position=(*aside, reach + 1e-3),
            orientation=turn,
            velocity=(0.0, 0.0, -np.sqrt(2.0 * G * drop)),
        )
        start = np.append(body.position, body.quaternion)
        return Flight({"floor": floor, "body": body}, 0.3, lambda q: q[:, 2], lambda t: np.tile(start, (len(t), 1)), G)

    return onto_one(fixed), onto_one(_GROUND)


def _reach(body: Object) -> float:
    return 0.0 if body.shape == "half_space" else object_solid("", body, 0).reach


#: Each makes a flight of a generator of random numbers.
FAMILIES = (ball_and_plate, two_balls, spinning_capsule, tumbling_box, tumbling_ellipsoid, paddle, sweeping_link)
