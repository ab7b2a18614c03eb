"""The same finger in two words: links with crossings, and a tree of bodies with tendons about its joints."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.parameters import Winch
from finger_pin.description.validation import validate

LENGTHS, MASSES, JOINTS = (0.05, 0.035, 0.025), (0.03, 0.02, 0.01), ("mcp", "pip", "dip")
RADII = {
    "flexor": {"mcp": 0.01, "pip": 0.008, "dip": 0.006},
    "middle": {"mcp": 0.009, "pip": 0.005},
    "opener": {"mcp": -0.008, "pip": -0.007, "dip": -0.005},
    "spreader": {"mcp": -0.004},
}
OFFSET = {"flexor": 0.4, "middle": 0.2, "opener": 0.3, "spreader": 0.1}
CHAIN = {
    "name": "one",
    "gravity": [0.0, -9.81, 0.0],
    "joints": {name: {"range": [-0.3, 1.6]} for name in JOINTS},
    "tendon_friction": {"coulomb": 0.2, "drag": 0.05, "viscous": 0.3},
    "joint_friction": {"coulomb": 2e-4, "stiction": 3e-4},
}


def links(**entries):
    """Return the finger of links, its cords bending with every joint."""
    carried = {
        name: {"range": [-0.3, 1.6], "link": {"length": length, "width": 0.012, "mass": mass}}
        for name, length, mass in zip(JOINTS, LENGTHS, MASSES, strict=True)
    }
    tendons = {
        name: {
            "curvature_offset": OFFSET[name],
            "crossings": {joint: {"radius": radius, "bends": True} for joint, radius in radii.items()},
        }
        for name, radii in RADII.items()
    }
    return validate(fp.FingerDescription, CHAIN | {"joints": carried, "tendons": tendons} | entries, ("finger",))


def tree(**entries):
    """Return it as bodies: a cord about joints gets longer by -r theta."""
    bodies, joints, parent, place = {}, {}, None, 0.0
    for name, joint in links().joints.items():
        (axial, transverse), centre = joint.link.inertia, joint.link.mass_centre
        bodies[f"{name}_link"] = {
            "position": [place, 0.0, 0.0],
            "mass": joint.link.mass,
            "centre": [centre, 0.0, 0.0],
            "inertia": [axial, transverse, transverse, 0.0, 0.0, 0.0],
        } | ({"parent": parent} if parent else {})
        joints[name] = {"body": f"{name}_link"}
        parent, place = f"{name}_link", joint.link.length
    cords = {
        name: {"joints": {joint: -r for joint, r in radii.items()}, "curvature_offset": OFFSET[name]}
        for name, radii in RADII.items()
    }
    described = {
        "bodies": bodies,
        "joints": joints,
        "tendons": cords,
        "tip": {"body": parent, "position": [place, 0.0, 0.0]},
    }
    tendons = {name: {"along": name} for name in RADII}
    return validate(fp.FingerDescription, CHAIN | {"tendons": tendons, "tree": described} | entries, ("finger",))


@pytest.mark.parametrize("place", ["canal", "bends"])
@pytest.mark.parametrize("pulled", ["sources", "winch"])
def test_crossings_and_tendons_about_the_joints_of_a_tree_are_one_model(place, pulled):
    made = []
    for describe in (links, tree):
        description = describe(tendon_friction=CHAIN["tendon_friction"] | {"place": place})
        if pulled == "winch":
            wound = description.tendons["flexor"].updated(winch=Winch(stiffness=1e4, damping=5.0))
            description = description.updated(tendons={**description.tendons, "flexor": wound})
        made.append(fp.Finger(description))
    first, second = made
    rng = np.random.default_rng(5)
    for name in ("coupling", "curvature_matrix", "curvature_offset", "loads"):
        np.testing.assert_allclose(getattr(second.routing, name), getattr(first.routing, name), rtol=1e-14)
    assert second.routing.force_closure().holds == first.routing.force_closure().holds is True
    for _ in range(4):
        x = first.rest_state(rng.uniform(0.1, 1.0, 3), rng.normal(0.0, 2.0, 3))
        x[6:] = 1e-4 * rng.normal(size=x.size - 6)
        pull = rng.uniform(2.0, 6.0, 4)
        inputs = np.where(first.routing.winched, first.excursion(x[:3]) + 1e-4 * pull, pull)
        expected, given = (finger.evaluate(x, inputs) for finger in made)
        assert np.ptp(expected["tendon_friction"]) > 1e-3
        np.testing.assert_allclose(given["tendon_friction"], expected["tendon_friction"], rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(given.rate, expected.rate, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(second.excursion(x[:3]), first.excursion(x[:3]), rtol=1e-13)


def test_a_tendon_of_the_finger_that_has_the_name_of_another_one_of_the_tree_is_refused():
    with pytest.raises(fp.InputError, match=r"finger\.tendons\.flexor: a tendon of the tree has this name"):
        tree(tendons={"flexor": {"along": "opener"}})


def test_a_body_beside_the_bodies_of_a_tree_is_refused():
    with pytest.raises(fp.InputError, match="rigid_body: has no place beside a tree"):
        fp.Finger(tree(), rigid_body=fp.Finger(links()).rigid_body)
