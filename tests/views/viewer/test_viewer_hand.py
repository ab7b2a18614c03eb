"""The page of a whole hand."""

import numpy as np
import pytest
from pages import console_errors, opened, painted, ring_centres, seek

import finger_pin as fp
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.views.viewer import write_animation

FINGERS = ["thumb", "index", "middle", "ring", "little"]


@pytest.fixture(scope="module")
def hand():
    return fp.simulate(fp.load_scenario("hand", {"simulation.duration": 0.05}))


def test_the_page_of_a_hand_moves_all_fingers_and_has_a_column_for_each(browser, hand, tmp_path):
    page = opened(browser, write_animation(hand, tmp_path / "hand.html").as_uri())
    seek(page, 0.05)
    table = "document.getElementById('tensions')"
    header = page.execute_script(f"return [...{table}.rows[0].cells].map(c => c.textContent)")
    assert header == ["", *FINGERS]
    rows = page.execute_script(f"return [...{table}.rows].map(r => r.cells[0].textContent)")
    assert rows == ["", "T1", "T2", "T3", "T4", "T5 prox.", "T5 dist."]
    shown = page.execute_script(f"return {table}.rows[3].cells[2].textContent")
    assert float(shown) == pytest.approx(float(hand.tendon_tension.sel(tendon="index.T3")[-1]), abs=0.051)
    labels = page.execute_script("return [...document.getElementById('labels').children].map(l => l.textContent)")
    assert sorted(labels) == sorted(FINGERS)
    geometry = TendonGeometry(fp.load_hand("ub_hand"), resolution=11)
    path = next(p for p in geometry.paths(hand.joint_position.values[-1]) if p.name == "little.T4")
    np.testing.assert_allclose(ring_centres(page, "little.T4"), path.points, atol=2e-5)
    panel = page.execute_script(
        "return document.getElementById('panel').scrollWidth <= document.getElementById('panel').clientWidth"
    )
    assert panel and not console_errors(page)


@pytest.mark.parametrize("size, most", [((390, 844), 0.25), ((844, 390), 0.5)])
def test_on_a_phone_the_tables_of_a_hand_are_folded_until_somebody_asks_for_them(browser, hand, tmp_path, size, most):
    shape = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", shape)
    try:
        page = opened(browser, write_animation(hand, tmp_path / "hand.html").as_uri())
        panel, joints = (page.find_element("id", name) for name in ("panel", "joints"))
        assert panel.size["height"] <= most * size[1] and not joints.is_displayed()
        page.find_element("css selector", "#readings summary").click()
        painted(page)
        assert joints.is_displayed() and joints.text.split()[0] == FINGERS[0]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
