"""What random models have to satisfy at a state: two computations of one thing that know nothing of each other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from core_cases import Bound
from random_models import RandomModel
from tree_kinematics import bias, described_tree, mass_matrix, placements, point

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger, CompiledMechanism
from finger_pin.core.tables.inputs import held_control
from finger_pin.exceptions import InputError
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.typing import Array

#: Sixth-order central differences: where to look, in steps, and weights.
OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0


def states(loop: ClosedLoop, rng: np.random.Generator, count: int) -> Array:
    """Return packed states within and beyond the ranges, from slow to fast, with unit quaternions, shape (count, n)."""
    finger = loop.finger
    lower, upper = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    x = []
    for _ in range(count):
        share = rng.uniform(-0.1, 1.1, len(lower))
        velocity = rng.normal(size=len(lower)) * 10.0 ** rng.uniform(-2.0, 0.7)
        start = loop.rest_state(lower + share * (upper - lower), velocity)
        noise = rng.normal(size=len(start)) * 10.0 ** rng.uniform(-4.0, -1.0)
        # What is moved along a path goes as the path says.
        noise[finger.mechanism.positions + np.flatnonzero(finger.mechanism.prescribed >= 0)] = 0.0
        x.append(start + noise * finger.layout.scales())
    for joint in finger.mechanism.body.model.joints[1:]:
        if joint.nq != joint.nv:
            for each in x:
                part = each[joint.idx_q : joint.idx_q + joint.nq]
                part /= np.linalg.norm(part)
    return np.array(x)


def inputs(loop: ClosedLoop, rng: np.random.Generator) -> Array:
    """Return inputs of a mechanism: tensions that pull, N, up to 0.1 mm that winches wind in, and anything else."""
    drawn = rng.uniform(0.0, 3.0, loop.finger.mechanism.channels)
    drawn[np.flatnonzero(loop.finger.routing.winched)] *= 3e-5
    return drawn


def readable_is_compiled(model: RandomModel) -> None:
    """The rates, forces, powers and signals of the readable evaluation are those of the compiled one."""
    rng, loop = model.rng(1), ClosedLoop.from_scenario(model.scenario)
    mechanism = loop.finger.mechanism
    x, u = states(loop, rng, 6), inputs(loop, rng)
    force, base = loop.fingertip_force, loop.base(0.003)
    given = x, u, force, None if base is None else np.broadcast_to(base, (len(x), *np.shape(base)[-1:]))
    expected, found = mechanism.evaluate(*given), CompiledMechanism(mechanism).evaluate(*given)
    for name in ("rate", "torque", "external", "acceleration"):
        close(getattr(found, name), getattr(expected, name), 1e-7, name)
    for booked, wanted in zip(found.account(), expected.account(), strict=True):
        assert list(booked) == list(wanted)
        most = max((np.abs(amount).max(initial=0.0) for amount in wanted.values()), default=0.0)
        for name, amount in wanted.items():
            close(booked[name], amount, 1e-7, name, most * 1e-7)
    for group, theirs in expected.rows.items():
        ours = found.rows[group]
        close(ours.force, theirs.force, 1e-7, group)
        close(ours.rate, theirs.rate, 1e-7, group)


def close(found: Array, expected: Array, tolerance: float, name: str, least: float = 1e-12) -> None:
    """Assert that numbers agree to a part of the largest of each column over all states."""
    found, expected = np.atleast_2d(found), np.atleast_2d(expected)
    assert found.shape == expected.shape, name
    # What is next to nothing beside the others is what rounding leaves of them.
    size = np.maximum(np.abs(expected).max(axis=0, initial=0.0), 1e-5 * np.abs(expected).max(initial=0.0))
    error = np.abs(found - expected) / (size + least)
    assert error.max(initial=0.0) < tolerance, f"{name}: {error.max():.3g} in column {np.argmax(error.max(axis=0))}"


def jacobian_is_that_of_differences(model: RandomModel) -> None:
    """The compiled Jacobian is that of differences of the readable rates, at states without a kink nearby."""
    rng, loop = model.rng(2), ClosedLoop.from_scenario(model.scenario)
    mechanism, u = loop.finger.mechanism, inputs(loop, rng)
    if loop.finger.scene is not None and loop.finger.scene.free:
        return  # no linear coordinates
    control = held_control(mechanism.channels, mechanism.coordinates)
    control.tension[:] = u
    bound, scales = Bound(mechanism, control, loop.fingertip_force), loop.finger.layout.scales()

    def rates(near: Array) -> Array:
        return np.asarray(mechanism.evaluate(near, u, loop.fingertip_force).rate)

    for x in states(loop, rng, 3):
        exact = _exact(bound, x)
        if exact is not None:
            check_derivatives(exact, rates, x, scales, 1e-4)


def check_derivatives(
    found: Array, function: Callable[[Array], Array], point: Array, scales: Array, tolerance: float, step: float = 1e-4
) -> None:
    """Assert that derivatives are those of differences where these agree for two steps, so that no kink is near.

    Args:
        found: Shape (n, k).
        function: Maps m points, shape (m, k), to vectors, shape (m, n).
        point: Shape (k,), of states that are n numbers, and perhaps inputs.
        scales: Of the numbers of points, shape (k,).
        tolerance: Part of the largest of each row, by scales.
        step: In scales.
    """
    coarse, fine = (_differences(function, point, share * step * scales) for share in (1.0, 0.13))
    smooth = _error(coarse, fine, scales).max(axis=0) < 0.1 * tolerance
    error = _error(found, fine, scales)[:, smooth].max(initial=0.0)
    assert error < tolerance, f"{error:.3g}"


def _differences(function: Callable[[Array], Array], point: Array, steps: Array) -> Array:
    near = (point + OFFSETS[:, None, None] * np.diag(steps)).reshape(-1, len(point))
    values = function(near).reshape(len(OFFSETS), len(point), -1)
    return np.tensordot(WEIGHTS, values, axes=1).T / steps


def _exact(bound: Bound, x: Array, g: float = 1e4) -> Array | None:
    """Return the compiled Jacobian, out of the solutions of (g - J) u = r."""
    _, solution, solved = bound.solve(0.0, x, g)
    return g * np.eye(len(x)) - np.linalg.inv(solution[:, :-1]) if solved else None


def _error(found: Array, expected: Array, scales: Array) -> Array:
    """Return differences of derivatives in parts of the largest of each row, by scales of states and inputs."""
    found, expected = (each * scales / scales[: len(each), None] for each in (found, expected))
    # What takes more than a thousand seconds is rounding.
    return np.abs(found - expected) / (np.abs(expected).max(axis=1, keepdims=True) + 1e-3)


def rigid_body_is_that_of_energies(model: RandomModel) -> None:
    """Fingertips, Jacobians, mass matrix, Coriolis and weight follow from the description's places and masses alone."""
    rng, finger = model.rng(3), fp.Finger(model.scenario.finger)
    tree, gravity = described_tree(model.table)
    body, names = finger.rigid_body, list(finger.routing.joints)
    # What a path moves has no mass, but a large inertia in the models.
    free = np.array(["path" not in tree["joints"][name] for name in names])
    for _ in range(3):
        q, v, a = (
            rng.uniform(-1.0, 1.0, len(names)),
            rng.normal(size=len(names)) * free,
            rng.normal(size=len(names)) * free,
        )
        position, velocity = dict(zip(names, q, strict=True)), dict(zip(names, v, strict=True))
        mass, forces = mass_matrix(tree, position), bias(_heavy(tree), gravity, position, velocity)
        order = [list(tree["joints"]).index(name) for name in names]
        mass, forces = mass[np.ix_(order, order)], forces[order]
        close(body.mass_matrix(q)[np.ix_(free, free)], mass[np.ix_(free, free)], 1e-9, "mass matrix")
        forces = forces * free
        close(body.inverse_dynamics(q, v, a) * free, mass @ a + forces, 1e-6, "torques")
        close((body.coriolis_matrix(q, v) @ v + body.gravity_torque(q)) * free, forces, 1e-6, "Coriolis and weight")
        tips = {name: tip for name, tip in tree["tips"].items() if "tree" not in model.table.get("finger", {}) or tip}
        placed = placements(tree, position)
        where = np.array([point(placed, tip["body"], tip["position"]) for tip in tips.values()])
        close(np.reshape(body.tip_position(q), (-1, 3)), where, 1e-11, "tips")
        slopes = []
        for name in names:
            placed = placements(tree, position | {name: position[name] + 1e-20j})
            slopes.append([np.imag(point(placed, tip["body"], tip["position"])) / 1e-20 for tip in tips.values()])
        jacobian = np.moveaxis(np.array(slopes), 0, -1)
        close(body.jacobian(q).reshape(-1, len(names)), jacobian.reshape(-1, len(names)), 1e-10, "Jacobian")
        falling = CompiledMechanism(Mechanism(body, []))
        fall = falling.evaluate(np.concatenate([q, v]), np.zeros(0)).acceleration
        close(mass @ (fall * free), -forces, 1e-6, "compiled acceleration")


def _heavy(tree: dict) -> dict:
    """Return a tree whose weight nothing holds up, as a rigid body knows of nothing that does."""
    bodies = {name: {**body, "gravity_compensation": 0.0} for name, body in tree["bodies"].items()}
    return {**tree, "bodies": bodies}


def linearisation_is_that_of_differences(model: RandomModel) -> None:
    """A and B of `linearise` are the derivatives of the readable rates."""
    rng, loop = model.rng(4), ClosedLoop.from_scenario(model.scenario)
    if loop.finger.scene is not None and loop.finger.scene.free:
        return
    mechanism, u, x = loop.finger.mechanism, inputs(loop, rng), states(loop, rng, 1)[0]
    linear = fp.linearise(model.scenario, x, u)
    found = np.hstack([linear.A, linear.B])

    def rates(near: Array) -> Array:
        return np.asarray(mechanism.evaluate(near[:, : len(x)], near[:, len(x) :]).rate)

    check_derivatives(found, rates, np.append(x, u), np.append(loop.finger.layout.scales(), np.ones(len(u))), 1e-4)


def equilibrium_is_at_rest(model: RandomModel) -> None:
    """At the posture where a finger comes to rest without friction nothing accelerates."""
    loop = ClosedLoop.from_scenario(model.scenario)
    u = np.abs(inputs(loop, model.rng(5)))
    start = loop.finger.layout.unpack(loop.initial_state()).position
    try:
        resting = fp.analysis.equilibrium(loop.finger, u, position=start)
    except InputError as error:
        assert "\n" not in str(error)
        return
    signals = CompiledFinger(loop.finger).evaluate(resting.state, u)
    rate = np.asarray(signals.rate) / loop.finger.layout.scales()
    assert np.abs(rate).max() < 1e-3, f"{np.abs(rate).max():.3g}"


def urdf_is_read_as_the_same_body(model: RandomModel) -> None:
    """Pinocchio reads from the URDF the mass matrix and weight of the finger, or of a whole hand."""
    import pinocchio as pin

    description, rng = model.scenario.finger, model.rng(6)
    text, body = fp.to_urdf(description), fp.Finger(description).rigid_body
    read = pin.buildModelFromXML(text)
    read.gravity.linear[:] = description.gravity
    data, joints = read.createData(), [read.joints[read.getJointId(name)] for name in description.joints]
    rotors = description.tree.joints if description.tree.bodies else {}
    armature = np.diag([rotors[name].armature if rotors else 0.0 for name in description.joints])
    order = np.array([joint.idx_v for joint in joints])
    # What a path moves has no mass, but a large inertia in the models.
    free = np.array([not rotors or rotors[name].path is None for name in description.joints])
    for q in rng.uniform(-0.8, 0.8, (2, len(joints))):
        theirs = pin.neutral(read)
        for joint, angle in zip(joints, q, strict=True):
            # A hinge that turns on has a cosine and a sine.
            theirs[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        upper = np.triu(pin.crba(read, data, theirs))
        mass = (upper + np.triu(upper, 1).T)[np.ix_(order[free], order[free])]
        # Links between two joints of a body have inertias of 1e-14 kg m^2, as readers want some.
        close(mass, (body.mass_matrix(q) - armature)[np.ix_(free, free)], 1e-7, "mass matrix", 1e-6)
        weight = pin.computeGeneralizedGravity(read, data, theirs)[order]
        close(weight, body.gravity_torque(q), 1e-7, "weight", 1e-9)
