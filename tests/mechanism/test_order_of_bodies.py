"""The order in which a tree's bodies are listed: it names coordinates, and changes no number."""

import numpy as np
import pinocchio as pin
import pytest

import finger_pin as fp
from finger_pin.description.loading import read_scenario


def drawn_tree(rng, count=7):
    """Return bodies of a random tree by name, with the hinge or slide of each, and a motion of its joints by name."""
    bodies, joints = {}, {}
    for k in range(count):
        spread = rng.normal(size=(3, 3))
        inertia = 1e-6 * (spread @ spread.T + np.eye(3))
        bodies[f"b{k}"] = {
            "mass": float(rng.uniform(0.005, 0.05)),
            "position": rng.normal(scale=0.03, size=3).tolist(),
            "orientation": pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs().tolist(),
            "centre": rng.normal(scale=0.01, size=3).tolist(),
            "inertia": [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
            **({"parent": f"b{rng.integers(k)}"} if k > 1 else {}),
        }
        axis = rng.normal(size=3)
        joints[f"b{k}"] = {
            "axis": (axis / np.linalg.norm(axis)).tolist(),
            "kind": rng.choice(["hinge", "slide"], p=[0.7, 0.3]).item(),
            "armature": float(rng.uniform(0.0, 1e-5)),
        }
    return bodies, joints, dict(zip(bodies, rng.normal(size=(count, 3)), strict=True))


def shuffled(rng, bodies):
    """Return the names of the bodies in a random order, parents first."""
    order = []
    while len(order) < len(bodies):
        ready = [name for name in bodies if name not in order and bodies[name].get("parent", "") in ("", *order)]
        order.append(ready[rng.integers(len(ready))])
    return order


def finger(order, bodies, joints):
    """Return the finger of a tree whose bodies are listed in an order."""
    table = {
        "name": "listed",
        "joints": {f"j_{name}": {"range": [-2.0, 2.0], "limited": False} for name in order},
        "tendons": {},
        "tree": {
            "bodies": {name: bodies[name] for name in order},
            "joints": {f"j_{name}": {"body": name, **joints[name]} for name in order},
            "actuators": {f"m_{order[0]}": {"joint": f"j_{order[0]}"}},
        },
    }
    return fp.Finger(read_scenario({"name": "x", "finger": table, "controller": {"kind": "tensions"}}).finger)


@pytest.mark.parametrize("seed", range(5))
def test_mass_and_coriolis_matrices_do_not_depend_on_the_order_of_bodies(seed):
    rng = np.random.default_rng(seed)
    bodies, joints, motion = drawn_tree(rng)
    names = list(bodies)
    found = []
    for order in (names, shuffled(rng, bodies), shuffled(rng, bodies)):
        q, v, a = np.array([motion[name] for name in order]).T
        body = finger(order, bodies, joints).rigid_body
        back = [order.index(name) for name in names]
        mass, coriolis = body.mass_matrix(q), body.coriolis_matrix(q, v)
        # Newton-Euler, which takes joints one by one, and the kinetic energy.
        at_rest = body.inverse_dynamics(q, 0.0 * v, 0.0 * a)
        np.testing.assert_allclose(mass @ a, body.inverse_dynamics(q, 0.0 * v, a) - at_rest, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(coriolis @ v, body.inverse_dynamics(q, v, 0.0 * a) - at_rest, rtol=1e-9, atol=1e-12)
        assert 0.5 * v @ mass @ v == pytest.approx(float(body.kinematics(q, v).kinetic_energy), rel=1e-12)
        found.append((mass[np.ix_(back, back)], coriolis[np.ix_(back, back)]))
    for mass, coriolis in found[1:]:
        np.testing.assert_allclose(mass, found[0][0], rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(coriolis, found[0][1], rtol=1e-10, atol=1e-16)


def test_a_copy_with_other_inertias_has_their_mass_matrix():
    rng = np.random.default_rng(3)
    bodies, joints, motion = drawn_tree(rng)
    body, q = finger(list(bodies), bodies, joints).rigid_body, np.array([motion[name][0] for name in bodies])
    rotors = np.diag(np.asarray(body.model.armature))
    heavier = body.with_inertias(
        [pin.Inertia(2.0 * e.mass, e.lever, 2.0 * e.inertia) for e in body.inertias], [0, 0, 0]
    )
    np.testing.assert_allclose(heavier.mass_matrix(q) - rotors, 2.0 * (body.mass_matrix(q) - rotors), rtol=1e-10)
