"""Which bodies can touch, where their shapes are, and what is said of a start that cannot be."""

import numpy as np
import pinocchio as pin
import pytest

import finger_pin as fp
from finger_pin.description.objects import Object
from finger_pin.description.surface import Surface
from finger_pin.laws.contact_law import CONTACT
from finger_pin.mechanism.bodies import place_bodies
from finger_pin.mechanism.contact_rows import check_start, contact_rows
from finger_pin.mechanism.path_elements import path_kinematics
from finger_pin.mechanism.solids import add_free_objects, body_solids, object_solids

TABLE = Object(shape="half_space", position=(0.0, 0.0, -0.1))
#: Within reach of every link.
NEAR = Object(shape="half_space", position=(0.0, 0.0, -0.025))
BALL = Object(shape="sphere", radius=0.02, mass=0.05, position=(0.1, 0.0, -0.08))


def scene(**objects):
    """Return rigid body, links of the paper's finger, and the contacts of both with objects."""
    description = fp.load_finger("ub_stand_in")
    alone, placed = place_bodies(description)
    body = add_free_objects(alone, objects)
    links = {name: joint.link for name, joint in description.joints.items()}
    return (
        body,
        links,
        contact_rows([*body_solids(description.bodies, placed, body), *object_solids(objects, body)], body.model.nv),
    )


def distances(contacts, body, q):
    """Return the signed distance of every contact."""
    return path_kinematics(body, q, contacts.paths, body.model.nv).length[::3]


def configuration(body, joints, **poses):
    """Return q with the joints of the finger and poses of free objects: position, and a quaternion if it turns."""
    q = pin.neutral(body.model)
    q[:4] = joints
    for name, (position, *quaternion) in poses.items():
        at = body.model.joints[body.model.getJointId(name)].idx_q
        q[at : at + 3] = position
        if quaternion:
            q[at + 3 : at + 7] = quaternion[0]
    return q


def test_links_touch_objects_and_objects_each_other_but_neither_fixed_ones_nor_links_each_other():
    box = Object(shape="box", sides=(0.02, 0.02, 0.02), position=(0.03, 0.02, 0.0))
    _, links, contacts = scene(table=NEAR, ball=BALL, box=box)
    expected = {f"{link}-{thing}" for link in links for thing in ("table", "ball", "box")}
    pairs = {name.split(".")[0] for name in contacts.names}
    assert pairs == expected | {"ball-table", "ball-box"}


def test_a_pair_out_of_reach_in_every_posture_is_left_out():
    """The paper's finger is 117 mm long: a wall at 75 mm is out of reach of its first link, one at 120 mm of all."""
    near = Object(shape="half_space", position=(0.075, 0.0, 0.0), orientation=(0.0, -1.0, 0.0, 1.0))
    far = Object(shape="half_space", position=(0.12, 0.0, 0.0), orientation=(0.0, -1.0, 0.0, 1.0))
    behind = Object(shape="sphere", radius=0.01, position=(0.0, -0.1, 0.0))
    _, _, contacts = scene(near=near, far=far, behind=behind)
    assert contacts.names == ("medial-near", "medial-behind", "distal-near", "distal-behind")
    rng, reached = np.random.default_rng(6), 0.0
    body, links, everything = scene(ball=Object(shape="sphere", radius=1e-3, mass=1.0))
    data, lengths = body.model.createData(), np.cumsum([link.length for link in links.values()])
    for _ in range(200):
        pin.forwardKinematics(body.model, data, configuration(body, rng.uniform(-1.5, 1.5, 4)))
        tips = [data.oMi[i + 1].act(np.array([link.length, 0.0, 0.0])) for i, link in enumerate(links.values())]
        reached = max(reached, *(np.linalg.norm(tip) / length for tip, length in zip(tips, lengths, strict=True)))
    assert reached <= 1.0 + 1e-12 and len(everything.names) == 4


def test_a_straight_finger_over_a_table_is_as_high_as_its_links_are_thick():
    body, links, contacts = scene(table=NEAR, ball=BALL)
    q = configuration(body, np.zeros(4), ball=((0.2, 0.0, -0.005),))
    distance = dict(zip(contacts.names, distances(contacts, body, q), strict=True))
    for name, link in links.items():
        assert distance[f"{name}-table"] == pytest.approx(0.025 - link.width / 2.0, abs=1e-12)
    assert distance["ball-table"] == pytest.approx(0.0, abs=1e-12)


def test_the_pad_is_where_the_fingertip_is():
    """Straight along x, the tip is a1 + a2 + a3 + a4 from the base: a wall there touches the pad."""
    wall = Object(shape="half_space", position=(0.1169, 0.0, 0.0), orientation=(0.0, -1.0, 0.0, 1.0))
    body, _, contacts = scene(wall=wall)
    distance = dict(zip(contacts.names, distances(contacts, body, np.zeros(4)), strict=True))
    assert distance["distal-wall"] == pytest.approx(0.0, abs=1e-12)
    assert min(distance.values()) == pytest.approx(0.0, abs=1e-12)


def test_a_tilted_box_over_a_table_is_as_high_as_its_lowest_corner_and_a_cylinder_as_its_rim():
    box = Object(shape="box", sides=(0.02, 0.03, 0.04), mass=0.1)
    can = Object(shape="cylinder", radius=0.01, length=0.05, mass=0.1)
    rod = Object(shape="capsule", radius=0.01, length=0.05, mass=0.1)
    body, _, contacts = scene(table=TABLE, box=box, can=can, rod=rod)
    turn = pin.Quaternion(pin.utils.rpyToMatrix(0.5, 0.2, 1.0))
    pose = ((0.3, 0.0, 0.0), turn.coeffs())
    q = configuration(body, np.zeros(4), box=pose, can=pose, rod=pose)
    distance = distances(contacts, body, q)

    def lowest(name):
        return min(d for d, pair in zip(distance, contacts.names, strict=True) if pair.startswith(f"{name}-table"))

    up = turn.matrix()[2]
    assert lowest("box") == pytest.approx(0.1 - np.abs(up) @ [0.01, 0.015, 0.02], abs=1e-12)
    assert lowest("rod") == pytest.approx(0.1 - 0.01 - 0.025 * abs(up[2]), abs=1e-12)
    assert lowest("can") == pytest.approx(0.1 - 0.01 * np.hypot(*up[:2]) - 0.025 * abs(up[2]), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["sphere", "box", "cylinder", "capsule"])
def test_bodies_farther_apart_than_their_reach_do_not_touch(shape):
    """Random poses of a free object near the finger: whatever touches is within reach."""
    sizes = {"box": {"sides": (0.02, 0.03, 0.04)}, "sphere": {"radius": 0.02}}
    other = Object(shape=shape, mass=0.1, **sizes.get(shape, {"radius": 0.01, "length": 0.05}))
    body, _, contacts = scene(other=other)
    rng, data, touched = np.random.default_rng(2), body.model.createData(), 0
    for _ in range(60):
        quaternion = rng.normal(size=4)
        pose = (rng.uniform([0.0, -0.03, -0.03], [0.12, 0.03, 0.03]), quaternion / np.linalg.norm(quaternion))
        q = configuration(body, np.zeros(4), other=pose)
        distance = distances(contacts, body, q)
        pin.forwardKinematics(body.model, data, q)
        for k, d in enumerate(distance):
            piece, out = contacts.paths[3 * k][0].piece, np.zeros(13)
            frame = data.oMi[piece.joint] * piece.frame
            y = np.concatenate([frame.actInv(data.oMi[end.joint].act(end.point)) for end in piece.ends])
            piece.shape.value(y, piece.parameters, out)
            touched += out[0] < 0.0
            assert out[0] > 0.0 or np.linalg.norm(y[:3] + y[3:]) / 2.0 < piece.reach
            assert d == pytest.approx(out[0], abs=1e-12) or 0.0 < d < out[0]
    assert touched > 10


def test_free_objects_have_the_inertia_of_solids():
    cases = {
        "sphere": ({"radius": 0.02}, pin.Inertia.FromSphere(0.3, 0.02)),
        "box": ({"sides": (0.02, 0.03, 0.05)}, pin.Inertia.FromBox(0.3, 0.02, 0.03, 0.05)),
        "cylinder": ({"radius": 0.02, "length": 0.05}, pin.Inertia.FromCylinder(0.3, 0.02, 0.05)),
        "capsule": ({"radius": 0.02, "length": 0.05}, pin.Inertia.FromCapsule(0.3, 0.02, 0.05)),
    }
    for shape, (sizes, expected) in cases.items():
        assert np.diag(Object(shape=shape, mass=0.3, **sizes).even_moments) == pytest.approx(
            expected.inertia, rel=1e-12
        )
    body, _, _ = scene(ball=BALL)
    mass = body.mass_matrix(pin.neutral(body.model))
    assert np.diag(mass)[-6:] == pytest.approx([0.05] * 3 + [0.4 * 0.05 * 0.02**2] * 3, rel=1e-12)


def test_where_two_surfaces_meet_the_smaller_numbers_count():
    rough = Object(shape="half_space", surface={"friction": 1.0, "stiffness": 1e6})
    ice = Object(shape="sphere", radius=0.01, mass=0.1, surface={"friction": 0.1, "stiction_ratio": 1.5})
    _, _, contacts = scene(table=rough, ball=ice)
    at = dict(zip(CONTACT.parameters, contacts.parameters[:, contacts.names.index("ball-table")], strict=True))
    assert (at["kinetic"], at["static"], at["stiffness"]) == pytest.approx((0.1, 0.1, 1e4))
    at = dict(zip(CONTACT.parameters, contacts.parameters[:, contacts.names.index("distal-ball")], strict=True))
    assert (at["kinetic"], at["static"]) == pytest.approx((0.1, 0.15))


def test_a_start_deep_in_an_object_is_refused_and_one_that_touches_is_not():
    body, _, contacts = scene(table=TABLE, ball=BALL)
    # What is 1 mm deep but for rounding starts as well.
    for height in (-0.0805, -0.0810000005):
        check_start(contacts, body, configuration(body, np.zeros(4), ball=((0.2, 0.0, height),)))
    for height, told in ((-0.083, "3"), (-0.081004, r"1\.004")):
        message = rf"environment\.objects: ball-table: starts {told} mm deep in each other, at most 1 mm"
        with pytest.raises(fp.InputError, match=message):
            check_start(contacts, body, configuration(body, np.zeros(4), ball=((0.2, 0.0, height),)))


ERRORS = {
    'shape = "mesh"': "meshes are not supported",
    'shape = "spere"': "did you mean sphere",
    'shape = "sphere"': "radius: is missing",
    'shape = "sphere"\nradius = 20': "in millimetres",
    'shape = "sphere"\nradius = 0.1\nmass = 0': "mass = 0: must be above 0",
    'shape = "sphere"\nradius = 0.1\nlength = 0.1': "length = 0.1: is for cylinder, capsule",
    'shape = "half_space"\nmass = 1.0': "a half-space is fixed",
    'shape = "half_space"\norientation = [0, 0, 0, 0]': "not zero",
    'shape = "box"\nsides = [0.1, 0.1, 0.1]\nvelocity = [1, 0, 0]': "which are free to move",
    'shape = "half_space"\nsurface.friction = -1': "friction = -1: must be at least 0",
    'shape = "half_space"\nsurface.fricton = 1': "did you mean environment.objects.thing.surface.friction",
}


@pytest.mark.parametrize("entries", ERRORS)
def test_a_wrong_object_is_one_clear_line(entries, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(f'finger = "ub_stand_in"\n[environment.objects.thing]\n{entries}\n')
    with pytest.raises(fp.InputError, match=ERRORS[entries]) as caught:
        fp.load_scenario(file)
    assert str(caught.value).startswith("environment.objects.thing") and "\n" not in str(caught.value)


def test_parameters_of_a_contact_are_the_smaller_of_both_surfaces_by_name():
    """mu_s is mu_k times the smaller ratio, and the length of the torsion what mu_k makes the smaller torsion of."""
    hard = Surface(stiffness=3e4, damping=1.0, friction=0.5, stiction_ratio=1.4, torsion=0.002, floor=1e-3, lag=2e-3)
    soft = Surface(stiffness=1e4, damping=3.0, friction=0.8, stiction_ratio=1.2, torsion=0.001, floor=1e-4, lag=5e-3)
    ball, other = (BALL.updated(surface=each, position=(x, 0.0, 0.0)) for x, each in ((0.1, hard), (0.2, soft)))
    _, _, contacts = scene(ball=ball, other=other)
    pair = contacts.names.index("ball-other")
    given = {"stiffness": 1e4, "damping": 1.0, "exponent": 1.0, "static": 0.6, "kinetic": 0.5, "torsion_radius": 0.002}
    given |= {"floor": 1e-4, "lag": 2e-3, "tangential_stiffness": 7e3, "stribeck_velocity": 0.01}
    assert {name: contacts[name][pair] for name in CONTACT.parameters} == pytest.approx(given)
