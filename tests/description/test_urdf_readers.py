"""What other programs read from a URDF: masses, mass matrix and tip of the finger that it was written from."""

import io
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import finger_pin as fp

TREE = """<mujoco><compiler angle="radian"/><worldbody><geom type="box" size=".1 .1 .01" pos="0 0 -.3"/><body name="a">
<joint name="a" axis="0 1 0" range="-0.5 1"/><joint name="a2" axis="0 0 1" range="-0.5 1"/>
<joint name="a3" type="slide" axis="0 0 1" range="-0.5 1"/><geom type="capsule" size="0.01" fromto="0 0 0 0.04 0 0"/>
<body name="b" pos="0.04 0 0"><joint name="b" axis="0 1 0" range="-1 1"/><geom type="box" size="0.01 0.005 0.004"/>
<body name="pad" pos=".02 0 0"><geom type="sphere" size=".005" mass="0"/><site name="tip"/></body></body></body>
</worldbody></mujoco>"""
POSTURE = np.array([0.1, 0.4, 0.05, 0.35])


def by_pinocchio(text, joints):
    """Return the mass of all links, kg, the mass matrix and the tip at `POSTURE`; of MuJoCo and others alike."""
    model = pin.buildModelFromXML(text)
    data = model.createData()
    mass = pin.crba(model, data, POSTURE)
    pin.framesForwardKinematics(model, data, POSTURE)
    tip = data.oMf[model.getFrameId("fingertip")].translation
    return pin.computeTotalMass(model), np.triu(mass) + np.triu(mass, 1).T, tip


def by_mujoco(text, joints):
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    model = spec.compile()
    data, matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[[model.joint(name).qposadr[0] for name in joints]] = POSTURE
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    return model.body_mass.sum(), matrix, data.body("fingertip").xpos


def by_bullet(text, joints):
    bullet = pytest.importorskip("pybullet")
    world = bullet.connect(bullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "finger.urdf")
            path.write_text(text)
            body = bullet.loadURDF(str(path), useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE)
        links = range(bullet.getNumJoints(body))
        names = {bullet.getJointInfo(body, i)[1].decode(): i for i in links}
        for name, angle in zip(joints, POSTURE, strict=True):
            bullet.resetJointState(body, names[name], angle)
        mass = sum(bullet.getDynamicsInfo(body, i)[0] for i in (-1, *links))
        tip = bullet.getLinkState(body, names["fingertip_fixed"], computeForwardKinematics=True)[4]
        return mass, np.array(bullet.calculateMassMatrix(body, [*POSTURE])), np.array(tip)
    finally:
        bullet.disconnect(world)


def by_drake(text, joints):
    plant = pytest.importorskip("pydrake.multibody.plant").MultibodyPlant(0.0)
    pytest.importorskip("pydrake.multibody.parsing").Parser(plant).AddModelsFromString(text, "urdf")
    if not plant.HasJointNamed("world_fixed"):
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    context, places = plant.CreateDefaultContext(), [plant.GetJointByName(name).velocity_start() for name in joints]
    plant.SetPositions(context, POSTURE[np.argsort(places)])
    tip = plant.GetFrameByName("fingertip").CalcPoseInWorld(context).translation()
    return plant.CalcTotalMass(context), plant.CalcMassMatrix(context)[np.ix_(places, places)], tip


@pytest.mark.parametrize("reader", [by_pinocchio, by_mujoco, by_bullet, by_drake])
@pytest.mark.parametrize("tree", [False, True], ids=["chain", "tree"])
def test_every_reader_finds_the_masses_the_mass_matrix_and_the_tip_of_the_finger(tree, reader):
    model = mujoco.MjModel.from_xml_string(TREE)
    description = fp.from_mujoco(model) if tree else fp.load_finger("ub_stand_in")
    # The tree's masses are those that MuJoCo compiles; the chain's are those of Table I's links.
    total = model.body_mass.sum() if tree else 5.0e-3 + 10.1e-3 + 6.0e-3 + 3.8e-3
    mass, matrix, tip = reader(fp.to_urdf(description), list(description.joints))
    body = fp.Finger(description).rigid_body
    # Links between the joints of one body have 1e-14 kg; Bullet places links in single precision.
    assert mass == pytest.approx(total, rel=1e-11)
    np.testing.assert_allclose(matrix, body.mass_matrix(POSTURE), rtol=1e-7, atol=1e-13)
    np.testing.assert_allclose(tip, body.tip_position(POSTURE), rtol=0, atol=1e-8 if reader is by_bullet else 1e-14)


@pytest.mark.parametrize("tree", [False, True], ids=["chain", "tree"])
def test_every_link_says_what_it_weighs(tree):
    model = mujoco.MjModel.from_xml_string(TREE)
    description = fp.from_mujoco(model) if tree else fp.load_finger("ub_stand_in")
    robot = yourdfpy.URDF.load(io.BytesIO(fp.to_urdf(description).encode()), load_meshes=False)
    weights = {name: link.inertial.mass for name, link in robot.link_map.items()}
    assert weights["base"] == weights["fingertip"] == 0.0
    last, mass = ("b", model.body("b").mass[0]) if tree else ("distal_link", 3.8e-3)
    assert weights[last] == pytest.approx(mass, rel=1e-15)
