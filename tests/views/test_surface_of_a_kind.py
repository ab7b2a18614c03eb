"""A kind of primitive that is a surface of triangles is drawn and written as its entry in the table of kinds says."""

from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.description.primitives import KINDS, Geometry
from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.playground.session import Session
from finger_pin.playground.stage import Stage
from finger_pin.views.viewer.solids import link_solids
from finger_pin.views.viewer.video import _Body

MODEL = """<mujoco><worldbody><body><joint name="knuckle" axis="0 1 0" range="-0.2 1.5"/>
<geom name="gem" type="sphere" size=".02" pos=".05 0 0" mass=".01"/></body></worldbody>
<tendon><fixed name="cord"><joint joint="knuckle" coef="0.01"/></fixed></tendon>
<actuator><motor tendon="cord" ctrlrange="0 5"/></actuator></mujoco>"""
#: Corners of an octahedron that a ball of 20 mm goes around, m, and its faces.
CORNERS = np.array([[0.02, 0, 0], [0, 0.02, 0], [-0.02, 0, 0], [0, -0.02, 0], [0, 0, 0.02], [0, 0, -0.02]])
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]])


@pytest.fixture
def gem(monkeypatch):
    """A finger of one solid, of a kind that has a surface, and that neither MuJoCo nor a URDF has."""
    finger = fp.from_mujoco(mujoco.MjModel.from_xml_string(MODEL))
    octahedron = ((Geometry.mesh(CORNERS, FACES), 0.0),)
    kind = KINDS["sphere"]._replace(parts=lambda _: octahedron, geom=None, in_urdf=False)
    monkeypatch.setitem(KINDS, "sphere", kind)
    return finger


def test_page_film_and_playground_draw_the_surface(gem):
    solid, *_ = link_solids(TendonGeometry(gem), 1e-3)
    drawn = solid.command()["object"]
    data = drawn["geometries"][0]["data"]
    np.testing.assert_allclose(np.reshape(data["attributes"]["position"]["array"], (-1, 3)), CORNERS)
    np.testing.assert_array_equal(np.reshape(data["index"]["array"], (-1, 3)), FACES)
    # Column by column, its last one is the place of the middle.
    np.testing.assert_allclose(np.reshape(drawn["object"]["matrix"], (4, 4))[3], [0.05, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(_Body.from_solid(solid, [solid.frame]).corners, np.add(CORNERS, [0.05, 0.0, 0.0]))
    server = MagicMock()
    Stage(server, Session(read_scenario(demo_motion(gem, 0.05))))
    (call,) = server.scene.add_mesh_simple.call_args_list
    np.testing.assert_array_equal(call.kwargs["vertices"], CORNERS)
    np.testing.assert_array_equal(call.kwargs["faces"], FACES)


def test_a_kind_that_mujoco_lacks_is_refused_and_one_that_a_urdf_lacks_is_left_out_by_name(gem):
    with pytest.raises(InputError, match=r"gem.*MuJoCo has no sphere"):
        fp.to_mjcf(gem)
    urdf = fp.to_urdf(gem)
    assert "<geometry>" not in urdf and "spheres, ellipsoids, objects" in urdf
