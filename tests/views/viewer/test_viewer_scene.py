"""The picture in the browser, against Table I, equation (1), the tendon geometry and matplotlib's colours."""

import io
import json

import matplotlib
import numpy as np
import pytest
import xarray as xr
from closed_kinematics import equation_1, frames
from motion import DURATION, joint_position, table, tensions
from pages import console_errors, opened, painted, ring_centres, seek, tendon_colour
from PIL import Image

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.views.viewer import write_animation
from finger_pin.views.viewer.animation import Playback
from finger_pin.views.viewer.scene import Scene


def test_the_page_loads_without_console_messages_and_without_a_network(browser, loaded, result, tmp_path):
    page = opened(browser, write_animation(result, tmp_path / "animation.html").as_uri())
    for t in (0.5, 1.5, DURATION):
        seek(page, t)
    painted(page)
    assert console_errors(page) == []
    assert loaded() == [(tmp_path / "animation.html").as_uri()]


def test_the_finger_and_five_tendons_are_in_the_scene(page):
    script = """
    const root = fingerPlayer.viewer.scene_tree.find(["finger_pin"]);
    const meshes = (node) => {
        const found = [];
        node.object.traverse((object) => { if (object.isMesh && object.visible) found.push(object); });
        return found.length;
    };
    return Object.fromEntries(Object.entries(root.children).map(([name, node]) =>
        [name, [meshes(node), Object.keys(node.children)]]));"""
    scene = page.execute_script(script)
    assert sorted(scene["tendons"][1]) == ["T1", "T2", "T3", "T4", "T5"]
    assert scene["tendons"][0] == 5
    for link in ("base", "abduction_link", "proximal_link", "medial_link", "distal_link", "fingertip_trace"):
        assert scene[link][0] >= 2, link


@pytest.mark.parametrize("t", [0.0, 0.4375, 1.7, 3.3, DURATION])
def test_the_links_stand_where_table_i_puts_them(page, t):
    seek(page, t)
    script = """
    const { scene } = fingerPlayer; const { THREE } = MeshCat;
    fingerPlayer.viewer.scene.updateMatrixWorld(true);
    const base = scene.root.matrixWorld.clone().invert();
    return scene.links.map((link) => base.clone().multiply(link.matrixWorld).transpose().elements);"""
    matrices = np.reshape(page.execute_script(script), (5, 4, 4))
    assert matrices[0] == pytest.approx(np.eye(4), abs=1e-7)
    # Frames are 1/60 s apart, and positions between them are interpolated.
    for matrix, (rotation, origin) in zip(matrices[1:], frames(joint_position(t)), strict=False):
        assert matrix[:3, :3] == pytest.approx(rotation, abs=5e-4)
        assert matrix[:3, 3] == pytest.approx(origin, abs=2e-5)


def test_the_scene_stands_upright_in_meshcat_which_has_z_up(page):
    script = """
    const world = fingerPlayer.scene.root.localToWorld(new MeshCat.THREE.Vector3(0, 0, 1));
    return world.toArray();"""
    # Three.js has y up.
    assert page.execute_script(script) == pytest.approx([0.0, 1.0, 0.0], abs=1e-7)


@pytest.mark.parametrize("t", [0.0, 1.25, 2.4])
def test_tendons_are_drawn_along_their_paths(page, t):
    seek(page, t)
    geometry = TendonGeometry(fp.load_finger("ub_stand_in"), resolution=60)
    for path in geometry.paths(joint_position(t)):
        if path.name == "T1" and tensions(t)[0] < 0.05:
            continue
        drawn = ring_centres(page, path.name)
        distance = np.linalg.norm(drawn[:, None] - path.points[None], axis=-1).min(axis=1)
        # Between the points of the fine path there are up to 0.4 mm.
        assert distance.max() < 0.5e-3, path.name


def test_a_tendon_without_tension_is_grey_and_hangs(page):
    seek(page, 0.5)
    taut, colour = ring_centres(page, "T1"), tendon_colour(page, "T1")
    assert max(colour) - min(colour) > 0.2
    seek(page, 1.5)
    slack, colour = ring_centres(page, "T1"), tendon_colour(page, "T1")
    assert max(colour) - min(colour) < 0.06
    # The first ten rings are the span behind the base, which only moves by hanging.
    assert (slack - taut)[:10, 2].min() < -2e-3
    assert page.find_element("css selector", "#tensions tr:first-child .value").text == "slack"


@pytest.mark.parametrize(("t", "tendon", "ring"), [(0.0, "T3", 0), (2.0, "T3", 5), (3.0, "T4", 0), (1.0, "T5", -1)])
def test_tension_has_its_colour_on_the_upper_three_quarters_of_viridis(page, t, tendon, ring):
    seek(page, t)
    count = len(ring_centres(page, tendon))
    tension = tensions(t)[int(tendon[1]) - 1]
    expected = matplotlib.colormaps["viridis"](0.25 + 0.75 * tension / 10.0)[:3]
    assert tendon_colour(page, tendon, ring % count) == pytest.approx(expected, abs=0.02)


def test_the_proximal_half_of_the_passive_tendon_has_its_own_colour(page):
    seek(page, 1.0)
    expected = matplotlib.colormaps["viridis"](0.25 + 0.75 * 0.5 * tensions(1.0)[4] / 10.0)[:3]
    assert tendon_colour(page, "T5", 0) == pytest.approx(expected, abs=0.02)


def test_the_trace_follows_equation_1_and_ends_at_the_present(page):
    script = """
    const { past } = fingerPlayer.scene.traces[0];
    return [Array.from(past.geometry.attributes.position.array), past.geometry.drawRange.count];"""
    seek(page, 2.5)
    positions, count = page.execute_script(script)
    centres = np.reshape(positions, (-1, 10, 3)).mean(axis=1)
    assert centres[0] == pytest.approx(equation_1(joint_position(0.0)), abs=1e-4)
    assert centres[-1] == pytest.approx(equation_1(joint_position(DURATION)), abs=1e-4)
    assert centres[count // 60] == pytest.approx(equation_1(joint_position(2.5)), abs=2e-3)


@pytest.mark.parametrize("name", ["oblique", "side", "top"])
def test_the_camera_frames_the_finger_beside_the_panel(page, name):
    script = """
    const { scene, viewer } = fingerPlayer;
    scene.frame(arguments[0]); viewer.render();
    return arguments[1].map((p) => scene.root.localToWorld(new MeshCat.THREE.Vector3(...p)).project(viewer.camera))
        .map((v) => [(v.x + 1) / 2 * innerWidth, (1 - v.y) / 2 * innerHeight, v.z]);"""
    points = [origin.tolist() for t in np.linspace(0, 4, 30) for _, origin in frames(joint_position(t))]
    pixels = np.array(page.execute_script(script, name, points))
    width = page.execute_script("return innerWidth")
    panel = page.find_element("id", "panel").rect
    assert pixels[:, 0].min() > panel["x"] + panel["width"]
    assert pixels[:, 0].max() < width
    assert pixels[:, 1].min() > 0
    assert pixels[:, 1].max() < page.find_element("id", "bar").rect["y"]
    assert np.abs(pixels[:, 2]).max() < 1
    assert np.ptp(pixels[:, 0]) > 0.35 * width


def test_the_finger_is_visible_in_the_picture(page):
    seek(page, 0.5)
    pictures = []
    for visible in (True, False):
        page.execute_script("fingerPlayer.scene.root.visible = arguments[0]; fingerPlayer.viewer.set_dirty();", visible)
        painted(page)
        pictures.append(np.asarray(Image.open(io.BytesIO(page.get_screenshot_as_png())).convert("RGB"), dtype=int))
    page.execute_script("fingerPlayer.scene.root.visible = true; fingerPlayer.viewer.set_dirty();")
    changed = (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 12).mean()
    assert changed > 0.03


def test_the_legend_says_what_the_colours_mean_in_newtons(page):
    # The largest tension is 9 N.
    assert page.find_element("id", "ticks").text.split() == ["0", "5", "10", "N"]
    seek(page, 2.0)
    rows = [row.text.replace("\n", " ") for row in page.find_elements("css selector", "#tensions tr")]
    assert rows[3] == "T4 2.50 N"
    assert rows[4:] == ["T5 proximal 1.75 N", "T5 distal 3.50 N"]
    assert page.find_element("id", "clock").text == "2.00 / 4.00 s"
    assert page.find_element("id", "title").text == "a <test> motion"


def test_a_finger_of_two_joints_and_three_tendons_is_shown(browser, tmp_path):
    t = np.linspace(0, 1, 101)
    planar = xr.Dataset(
        {
            "joint_position": (("time", "joint"), np.stack([t, 0.5 * t], -1)),
            "tendon_tension": (("time", "tendon"), np.ones((101, 3))),
        },
        coords={"time": t},
        attrs={"finger": json.dumps(table("planar"))},
    )
    page = opened(browser, write_animation(planar, tmp_path / "planar.html").as_uri())
    assert page.execute_script("return fingerPlayer.scene.tendons.length") == 3
    # Its gravity is along -y, so y is up; three.js has y up as well.
    up = page.execute_script(
        "return fingerPlayer.scene.root.localToWorld(new MeshCat.THREE.Vector3(0, 1, 0)).toArray()"
    )
    assert up == pytest.approx([0.0, 1.0, 0.0], abs=1e-7)
    assert console_errors(page) == []


CORDS = """<mujoco><compiler angle="radian"/><worldbody><site name="a" pos=".01 0 -.05"/><body>
<joint name="turn" axis="0 1 0"/><geom type="capsule" size=".005" fromto="0 0 0 0 0 .05" mass=".01"/>
<site name="b" pos=".01 0 .02"/></body></worldbody><tendon>
<spatial name="cord" STIFF><site site="a"/><site site="b"/></spatial></tendon><actuator>DRIVE</actuator></mujoco>"""


@pytest.mark.parametrize(
    ("stiff", "drive", "pulls"),
    [
        ("", '<muscle tendon="cord" ctrllimited="true" ctrlrange="0 1" lengthrange=".05 .09"/>', "muscles"),
        ("", '<position tendon="cord" kp="10" ctrlrange="0 .1"/>', "actuators"),
        ('stiffness="10"', "", "springs"),
    ],
)
def test_cords_show_their_tension_and_those_without_are_named_by_what_pulls_them(stiff, drive, pulls):
    mujoco = pytest.importorskip("mujoco")
    text = CORDS.replace("STIFF", stiff).replace("DRIVE", drive)
    finger = fp.from_mujoco(mujoco.MjModel.from_xml_string(text))
    result = fp.simulate(read_scenario(demo_motion(finger, 0.05)))
    motion = Playback.from_result(result)
    shown = np.interp(motion.time, result.time, result.cord_tension.sel(cord="cord"))
    assert motion.scene.strands == ("cord",) and motion.tension[:, 0] == pytest.approx(shown)
    assert set(motion.scene.tendons[0]["strand"]) == {0}
    assert motion.scene.header("", motion.position, motion.largest)["cords"] == ""
    scene = Scene(finger)
    assert scene.header("", np.zeros((1, 1)), 1.0)["cords"] == f"cords that {pulls} pull; their tension is not shown"
