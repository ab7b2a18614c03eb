"""Trees in space, for the viewer: tendons lie where their lengths say, solids where MuJoCo has them."""

import mujoco
import numpy as np
import pytest
from mujoco_models import ROUTED, asset, posture

import finger_pin as fp
from finger_pin.mechanism.geometry import TreeGeometry

MOTORS = "".join(f'<motor name="{name}_motor" tendon="{name}" gear="-1" ctrlrange="0 5"/>' for name in ("top", "below"))


@pytest.fixture(scope="module")
def pulled():
    """A model whose tendons are pulled, and its description."""
    model = mujoco.MjModel.from_xml_string(ROUTED.replace("</actuator>", f"{MOTORS}</actuator>"))
    return model, fp.from_mujoco(model)


def test_paths_are_as_long_as_their_tendons_and_end_at_their_sites(pulled):
    model, description = pulled
    geometry, hand, data = TreeGeometry(description), fp.Hand(description), mujoco.MjData(model)
    random, wrapped = np.random.default_rng(0), 0
    positions = random.uniform([-1.4, -1.4, -0.01], [1.4, 1.4, 0.01], (120, 3))
    drawn = {path.name: path.points for path in geometry.paths(positions)}
    for name, column, ends in (("top_motor", 0, ("w0", "b1")), ("below_motor", 2, ("w1", "b2"))):
        lengths = np.linalg.norm(np.diff(drawn[name], axis=1), axis=2).sum(axis=1)
        expected = hand.paths.length(positions)[:, column]
        # Chords of arcs of up to half a turn in 11 parts.
        np.testing.assert_allclose(lengths, expected, rtol=4e-3)
        assert np.all(lengths < expected + 1e-12)
        wrapped += np.count_nonzero(lengths < expected - 1e-6)
        for position, points in zip(positions, drawn[name], strict=True):
            data.qpos = position
            mujoco.mj_kinematics(model, data)
            sites = [data.site(site).xpos for site in ends]
            np.testing.assert_allclose(points[[0, -1]], sites, atol=1e-12)
    assert wrapped > 20


def test_solids_stand_where_mujoco_has_them():
    model = mujoco.MjModel.from_xml_path(str(asset("hand/reach.xml")))
    description, data = fp.from_mujoco(model), mujoco.MjData(model)
    geometry = TreeGeometry(description)
    data.qpos = posture(model, np.random.default_rng(1))
    mujoco.mj_kinematics(model, data)
    poses = geometry.poses(data.qpos)
    capsules = 0
    for i in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE):
        name = f"{model.body(model.geom_bodyid[i]).name}_{model.geom(i).name}".replace(":", "_")
        found = [each for each in geometry.visuals if each.name == name]
        for visual in found:
            rotation, place = poses.rotation[visual.link], poses.translation[visual.link]
            np.testing.assert_allclose(rotation @ visual.placement.translation + place, data.geom_xpos[i], atol=1e-9)
            assert visual.shape.radius == pytest.approx(model.geom_size[i, 0])
            capsules += 1
    assert capsules > 10
