"""The set of fingertip forces in the browser: where it stands, how large it is, and what the panel says of it."""

import io
import re

import numpy as np
import pytest
from closed_kinematics import equation_1
from motion import DURATION
from pages import console_errors, opened, painted, seek
from PIL import Image

import finger_pin as fp
from finger_pin.views.viewer import view_forces, write_animation
from finger_pin.views.viewer.animation import posture_page

POSTURE = (0.1, 0.5, 0.6, 0.42)


@pytest.fixture(scope="module")
def polytope(finger):
    return fp.analysis.force_polytope(finger, POSTURE, 20.0)


@pytest.fixture(scope="module")
def forces_page(browser, result, polytope, tmp_path_factory):
    path = tmp_path_factory.mktemp("forces") / "animation.html"
    return opened(browser, write_animation(result, path, forces=polytope).as_uri())


def corners(page, name):
    """Distinct corners of a drawn object in the base frame, m."""
    script = """
    const node = fingerPlayer.viewer.scene_tree.find(["finger_pin", "forces", arguments[0]]);
    let found; node.object.traverse((object) => { if (object.geometry) found = object; });
    fingerPlayer.viewer.scene.updateMatrixWorld(true);
    const base = fingerPlayer.scene.root.matrixWorld.clone().invert().multiply(found.matrixWorld);
    const { position } = found.geometry.attributes, corner = new MeshCat.THREE.Vector3();
    const list = [];
    for (let i = 0; i < position.count; i++)
        list.push(corner.fromBufferAttribute(position, i).applyMatrix4(base).toArray());
    return list;"""
    return np.array(page.execute_script(script, name))


def scale_on_the_panel(page):
    (millimetres,) = re.findall(r"([0-9.]+) mm per N", page.find_element("id", "forces").text)
    return 1e-3 * float(millimetres)


def test_every_vertex_stands_at_the_fingertip_plus_its_force_at_the_scale_that_the_panel_says(forces_page, polytope):
    expected = equation_1(np.array(POSTURE)) + scale_on_the_panel(forces_page) * polytope.vertices
    for name in ("body", "edges"):
        drawn = corners(forces_page, name)
        gaps = np.linalg.norm(drawn[:, None] - expected[None], axis=-1)
        assert gaps.min(axis=1).max() < 1e-6 and gaps.min(axis=0).max() < 1e-6


def test_the_set_is_at_most_half_as_long_as_the_finger_and_not_tiny(forces_page, polytope):
    length = scale_on_the_panel(forces_page) * np.linalg.norm(polytope.vertices, axis=1).max()
    assert 0.02 < length < 0.08


def test_the_force_set_stays_at_its_posture_while_the_finger_moves(forces_page):
    before = corners(forces_page, "body")
    seek(forces_page, 0.5 * DURATION)
    np.testing.assert_array_equal(corners(forces_page, "body"), before)
    assert console_errors(forces_page) == []


def test_the_set_is_visible_and_translucent(forces_page):
    seek(forces_page, 0.5)
    pictures = []
    for visible in (True, False):
        forces_page.execute_script(
            "fingerPlayer.viewer.scene_tree.find(['finger_pin', 'forces']).object.visible = arguments[0];"
            "fingerPlayer.viewer.set_dirty();",
            visible,
        )
        painted(forces_page)
        picture = Image.open(io.BytesIO(forces_page.get_screenshot_as_png())).convert("RGB")
        pictures.append(np.asarray(picture, dtype=float))
    change = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    covered = change > 8
    assert covered.mean() > 0.01
    # What is behind shows through: the change is far from the full colour of the body.
    assert np.median(change[covered]) < 150


def test_all_of_the_set_is_in_view(forces_page):
    forces_page.execute_script("fingerPlayer.viewer.scene_tree.find(['finger_pin', 'forces']).object.visible = true")
    script = """
    const { scene, viewer } = fingerPlayer; scene.frame("oblique"); viewer.render();
    return arguments[0].map((p) => scene.root.localToWorld(new MeshCat.THREE.Vector3(...p)).project(viewer.camera))
        .map((v) => [v.x, v.y]);"""
    projected = np.array(forces_page.execute_script(script, corners(forces_page, "edges").tolist()))
    assert np.abs(projected).max() < 1.0


def test_without_forces_the_panel_does_not_mention_them(page):
    assert not page.find_element("id", "forces").is_displayed()


@pytest.mark.parametrize(("name", "posture"), [("planar", (0.4, 0.9)), ("ub_stand_in", (0.0, 0.0, 0.0, 0.0))])
def test_flat_sets_are_shown_too(browser, tmp_path, name, posture):
    finger = fp.Finger(fp.load_finger(name))
    path = tmp_path / "flat.html"
    path.write_text(
        posture_page(finger.description, fp.analysis.force_polytope(finger, posture, 10.0)), encoding="utf-8"
    )
    shown = opened(browser, path.as_uri())
    assert len(corners(shown, "body")) >= 9
    assert console_errors(shown) == []


def test_a_finger_at_rest_is_served_in_the_posture_of_its_forces_with_the_tensions_of_one(browser, finger, polytope):
    needed = fp.analysis.tension_for_force(finger, POSTURE, [0.0, 0.0, 1.0])
    with view_forces(finger.description, polytope, tension=needed.strands, open_browser=False, block=False) as viewing:
        shown = opened(browser, viewing.url)
        angles = [cell.text for cell in shown.find_elements("css selector", "#joints .value")]
        rows = shown.find_elements("css selector", "#tensions tr .value")
        assert angles == [f"{degrees:.1f}°" for degrees in np.degrees(POSTURE)]
        assert rows[0].text == f"{needed.strands[0]:.2f} N"
