"""Objects and contacts on the page, read back from what it plays."""

import re
from importlib import resources
from typing import ClassVar

import numpy as np
import pytest
from pages import opened, seek
from unpacked_page import unpacked

import finger_pin as fp
from finger_pin.views import draw, write_animation
from finger_pin.views.plots.style import new_figure
from finger_pin.views.viewer.animation import Playback, animation_page
from finger_pin.views.viewer.solids import FORCE_COLOUR
from finger_pin.views.viewer.video import _Film


@pytest.fixture(scope="module")
def pinched():
    return fp.simulate(fp.load_scenario("pinch", {"simulation.duration": 0.5}))


def test_every_object_stands_where_it_is_and_moves_as_in_the_result(pinched):
    found, columns = unpacked(animation_page(pinched))
    objects = found["objects"]
    # On a palm that moves, what is fixed moves along.
    assert objects["free"] == ["object_ball", "object_tray"]
    drawn = {each["path"] for each in found["commands"]}
    assert {"/finger_pin/object_ball/part0", "/finger_pin/object_tray/part0"} <= drawn
    time, poses = columns["time"], columns["object"].reshape(-1, 2, 7)
    at = pinched.sel(time=time)
    # The palm moves without turning.
    assert np.ptp(at.palm_position.values, axis=0).max() > 0.01
    assert poses[:, 0, :3] == pytest.approx(at.palm_position.values + at.object_position.values[:, 0], abs=1e-6)
    assert poses[:, 0, 3:] == pytest.approx(at.object_orientation.values[:, 0], abs=1e-6)
    assert poses[:, 1, :3] == pytest.approx(np.add(at.palm_position.values, [0.2, 0.0, 0.0]), abs=1e-6)


def test_arrows_are_the_forces_of_the_contacts_that_close_and_cones_as_steep_as_friction(pinched):
    found, columns = unpacked(animation_page(pinched))
    assert found["objects"]["steepness"] == [0.7, 0.7]
    numbers = columns["contact"].reshape(-1, 2, 9)
    at = pinched.sel(time=columns["time"], contact=["left.distal-ball", "right.distal-ball"])
    points = at.contact_point.values + at.palm_position.values[:, None]
    for first, expected in ((0, points), (3, at.contact_force.values), (6, at.contact_normal.values)):
        assert numbers[..., first : first + 3] == pytest.approx(expected, abs=1e-5)
    strongest = np.linalg.norm(at.contact_force.values, axis=-1).max()
    assert 0.02 < found["objects"]["length"] * strongest < 0.06


@pytest.mark.parametrize("friction", [0.3, 3.0])
def test_no_cone_is_larger_than_a_finger_is_wide(browser, pinched, tmp_path, friction):
    """The hypotenuse of its height and radius is its slant, whatever friction and force are."""
    slippery = pinched.assign(contact_level=friction * pinched.contact_normal_force)
    page = opened(browser, write_animation(slippery, tmp_path / "pinch.html").as_uri())
    seek(page, 0.5)
    slants = page.execute_script("""
    return fingerPlayer.scene.contacts.filter((each) => each.group.visible).map(({ cone }) => {
      const { radius, height } = cone.geometry.parameters;
      return cone.scale.x * Math.hypot(radius, height);
    });""")
    assert len(slants) == 2 and 0.002 < min(slants) and max(slants) < 0.018


def test_an_arrow_ends_where_bodies_touch_and_is_as_long_as_the_force_at_the_scale_of_the_panel(
    browser, pinched, tmp_path
):
    page = opened(browser, write_animation(pinched, tmp_path / "pinch.html").as_uri())
    seek(page, 0.5)
    ends = page.execute_script("""
    const { root, contacts } = fingerPlayer.scene; fingerPlayer.viewer.scene.updateMatrixWorld(true);
    return contacts.map(({ head, shaft }) => [[head, "max"], [shaft, "min"]].map(([mesh, end]) => {
      mesh.geometry.computeBoundingBox();
      const y = mesh.geometry.boundingBox[end].y;
      return root.worldToLocal(mesh.localToWorld(new MeshCat.THREE.Vector3(0, y, 0))).toArray();
    }));""")
    last = pinched.sel(contact=["left.distal-ball", "right.distal-ball"]).isel(time=-1)
    (scale,) = re.findall(r"([0-9.]+) mm per N", page.find_element("id", "objects").text)
    points = last.contact_point.values + last.palm_position.values
    np.testing.assert_allclose(
        ends, np.stack([points, points - 1e-3 * float(scale) * last.contact_force], 1), atol=1e-6
    )


def test_a_result_without_objects_has_none_on_its_page():
    found, columns = unpacked(animation_page(fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.1}))))
    assert "objects" not in found and set(columns) == {"time", "pose", "path", "tension", "tip", "joint"}


class Window:
    """The messages that a `meshcat.Visualizer` sends."""

    sent: ClassVar = {}

    def send(self, command):
        found = command.lower()
        self.sent.setdefault(found["path"].removeprefix("/meshcat/finger_pin/"), []).append(found)


def test_a_meshcat_window_shows_objects_where_they_end_and_the_forces_on_them(pinched):
    meshcat = pytest.importorskip("meshcat")
    window = Window()
    draw(meshcat.Visualizer(window=window), pinched, speed=np.inf)
    last = pinched.isel(time=-1)
    assert {"object_ball/part0", "object_tray/part0"} <= set(window.sent)
    matrix = np.reshape(window.sent["object_ball"][-1]["matrix"], (4, 4)).T
    assert matrix[:3, 3] == pytest.approx((last.palm_position + last.object_position[0]).values, abs=1e-9)
    shape = window.sent["tendons/contact0"][-1]["object"]["geometries"][0]["data"]["attributes"]["position"]["array"]
    points = np.frombuffer(shape.data, "<f4").reshape(2, -1, 3).mean(axis=1)
    force = last.contact_force.sel(contact="left.distal-ball").values
    along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    assert along == pytest.approx(force / np.linalg.norm(force), abs=1e-5)


def test_a_film_shows_the_ball_round_and_where_it_is(pinched):
    motion = Playback.from_result(pinched, 10.0)
    film, frame = _Film(new_figure(4.0, 3.0), motion), 3
    film.show(frame)
    at = pinched.sel(time=motion.time[frame])
    centre = film.camera[:2] @ (at.palm_position + at.object_position[0]).values
    outlines = [path.vertices for path in film.bodies.get_paths()]
    distances = [np.linalg.norm(outline - centre, axis=1) for outline in outlines]
    assert any(each.max() < 0.01501 and each.min() > 0.0145 for each in distances)
    assert len(film.arrows.get_segments()) == 2


def test_forces_have_one_colour_on_the_page_in_a_window_and_in_films():
    script = resources.files("finger_pin.views.viewer").joinpath("web/scene.js").read_text("utf-8")
    colour = re.search(r"FORCE_COLOUR = 0x(\w{6});", script)[1]
    assert [round(255 * each) for each in FORCE_COLOUR[0]] == list(bytes.fromhex(colour))


def test_a_goal_is_marked_where_it_is_on_a_palm_that_moves(pinched):
    motion = Playback.from_result(pinched)
    film, goal = _Film(new_figure(4.0, 3.0), motion), np.array([0.1, -0.02, 0.03])
    film.mark(goal)
    # The palm moves without turning.
    expected = film.camera[:2] @ (pinched.palm_position.values[-1] + goal)
    assert np.ravel(film.axes.lines[-1].get_data()) == pytest.approx(expected, abs=1e-12)
