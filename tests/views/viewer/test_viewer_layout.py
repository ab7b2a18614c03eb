"""The page on a phone and on a desk, and another result as a ghost."""

import numpy as np
import pytest
import xarray as xr
from closed_kinematics import equation_1
from motion import joint_position
from pages import opened, painted, seek
from selenium.webdriver.support.ui import WebDriverWait

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario
from finger_pin.exchange.from_mujoco import from_mujoco
from finger_pin.simulation.frames import scene_metadata
from finger_pin.views.plots.style import new_figure
from finger_pin.views.viewer import write_animation
from finger_pin.views.viewer.animation import Playback
from finger_pin.views.viewer.video import _Film


@pytest.fixture(scope="module")
def other(result):
    """The same motion, half as far."""
    return result.assign(joint_position=0.5 * result["joint_position"])


@pytest.fixture(scope="module")
def both(browser, result, other, tmp_path_factory):
    path = tmp_path_factory.mktemp("both") / "animation.html"
    return opened(browser, write_animation(result, path, ghost=other).as_uri())


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (1400, 900), (1000, 900)])
def test_in_a_window_of_any_size_nothing_overflows_and_the_finger_is_clear_of_panel_and_bar(both, size):
    width, height = size
    both.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500},
    )
    try:
        both.execute_script("window.dispatchEvent(new Event('resize'))")
        # On a slow machine the page is laid out a moment later.
        shown = "return document.querySelector('#ticks span').getBoundingClientRect().width > 0"
        WebDriverWait(both, 60).until(lambda page: page.execute_script(shown))
        places = both.execute_script("""
        const inside = (selector) => [...document.querySelectorAll(selector)].map((e) => e.getBoundingClientRect());
        const box = (r) => [r.left, r.top, r.right, r.bottom];
        const { camera } = fingerPlayer.viewer;
        camera.updateMatrixWorld(true);
        const seen = fingerPlayer.config.inView.map(([x, y, z]) => {
          const at = new MeshCat.THREE.Vector3(x, z, -y).project(camera);
          return [((at.x + 1) / 2) * innerWidth, ((1 - at.y) / 2) * innerHeight];
        });
        return { panel: inside("#panel").map(box)[0], bar: inside("#bar").map(box)[0],
                 ticks: inside("#ticks span").map(box),
                 parts: inside("#bar *, #panel h1, #panel table").filter((r) => r.width).map(box), seen,
                 window: [innerWidth, document.documentElement.scrollWidth] };""")
    finally:
        both.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert places["window"] == [width, width]
    parts = np.array([*places["parts"], places["panel"], places["bar"]])
    assert parts[:, 0].min() >= 0.0 and parts[:, 2].max() <= width
    ticks = np.array(places["ticks"])
    assert np.all(ticks[:-1, 2] + 4.0 < ticks[1:, 0])
    x, y = np.array(places["seen"]).T
    assert np.all((x > 0.0) & (x < width) & (y > 0.0) & (y < places["bar"][1]))
    _, _, right, bottom = places["panel"]
    assert np.all((x > right) | (y > bottom))


def test_the_ghost_moves_as_the_other_result_does(both):
    seek(both, 1.3)
    x, y, z = equation_1(0.5 * joint_position(1.3))
    tip = both.execute_script("""
    fingerPlayer.viewer.scene.updateMatrixWorld(true);
    return fingerPlayer.scene.ghostLinks.at(-1).localToWorld(new MeshCat.THREE.Vector3(0.0218, 0, 0)).toArray()""")
    assert tip == pytest.approx([x, z, -y], abs=1e-5)
    assert both.find_element("id", "ghost").text == "ghost: a <test> motion"


JOINT_ALONE = """<mujoco><worldbody><body><joint name="knuckle" axis="0 1 0" range="-10 90"/>
<geom type="capsule" size="0.01" fromto="0 0 0 0.1 0 0"/></body></worldbody>
<tendon><fixed name="gear"><joint joint="knuckle" coef="1"/></fixed></tendon>
<actuator><motor name="servo" joint="knuckle"/></actuator></mujoco>"""


def test_a_hand_that_no_tendon_pulls_shows_its_joints_and_no_scale_of_tensions(browser, tmp_path):
    (tmp_path / "alone.xml").write_text(JOINT_ALONE)
    scenario = read_scenario(demo_motion(from_mujoco(tmp_path / "alone.xml", "alone")), {})
    still = {
        "joint_position": (("time", "joint"), np.zeros((2, 1))),
        "tendon_tension": (("time", "tendon"), np.zeros((2, 0))),
    }
    result = xr.Dataset(still, {"time": [0.0, 1.0]}, scene_metadata(scenario))
    film = _Film(figure := new_figure(4.0, 3.0), Playback.from_result(result))
    film.show(0)
    assert figure.axes == [film.axes]
    page = opened(browser, write_animation(result, tmp_path / "alone.html").as_uri())
    assert page.find_element("id", "joints").text.startswith("knuckle")
    assert [each.is_displayed() for each in page.find_elements("css selector", "#legend, #tensions")] == [False, False]


@pytest.mark.parametrize("pull", [0.0, 2.0])
def test_colours_of_tensions_have_a_scale_only_where_there_is_tension(browser, result, tmp_path, pull):
    still = result.isel(time=slice(3)).copy(deep=True)
    for name in ("tendon_tension", "passive_tension_proximal"):
        still[name][:] = pull
    page = opened(browser, write_animation(still, tmp_path / "still.html").as_uri())
    shown = [page.find_element("id", each).is_displayed() for each in ("legend", "tensions")]
    assert shown == [pull > 0.0, True]


@pytest.mark.parametrize("whole", [False, True], ids=["a finger", "a hand"])
def test_no_table_is_cut_and_nothing_lies_over_the_page(browser, tmp_path, result, whole):
    shown = fp.simulate(fp.load_scenario("hand", {"simulation.duration": 0.01})) if whole else result
    page = opened(browser, write_animation(shown, tmp_path / "page.html").as_uri())
    # A joint that rounding has turned by less than nothing.
    page.execute_script("fingerPlayer.frames.columns.joint.data.fill(-1e-5)")
    try:
        for width, height in ((390, 844), (844, 390), (1400, 900)):
            shape = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
            page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", shape)
            painted(page)
            page.execute_script("document.getElementById('readings').open = true; fingerPlayer.seek(0)")
            assert page.find_elements("css selector", "#joints td.value")[-1].text in ("0°", "0.0°")
            panel, table, over = page.execute_script("""
            const bottom = (id) => document.getElementById(id).getBoundingClientRect().bottom;
            const bars = [...document.querySelectorAll(".dg")].filter((each) => each.offsetHeight > 0);
            return [bottom("panel"), bottom("joints"), bars.length];""")
            assert table <= panel and not over
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
