"""The page of a whole hand."""

import numpy as np
import pytest
from pages import console_errors, opened, ring_centres, seek

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
