"""The files of the viewer, and its refusals."""

import re

import numpy as np
import pytest
from pages import until

import finger_pin as fp
from finger_pin.views.viewer import write_animation


def test_eight_seconds_of_a_finger_make_a_file_below_a_megabyte(result, tmp_path):
    longer = result.isel(time=np.arange(8001) % len(result.time)).assign_coords(time=np.arange(8001) * 1e-3)
    assert write_animation(longer, tmp_path / "animation.html").stat().st_size < 1e6


def test_the_file_names_no_address_to_load_from(result, tmp_path):
    text = write_animation(result, tmp_path / "animation.html").read_text(encoding="utf-8")
    assert not re.search(r"""<(script|link|img|iframe)[^>]*(src|href)=["']?(?!["']?data:)""", text)
    # The names of XML name spaces are addresses that nobody visits.
    assert set(re.findall(r"https?://[\w.]+", text)) <= {"http://www.w3.org"}


def test_a_result_without_joint_positions_is_refused_and_an_earlier_file_stays(result, tmp_path):
    target = write_animation(result, tmp_path / "animation.html")
    earlier = target.read_bytes()
    with pytest.raises(fp.InputError, match="joint_position"):
        write_animation(result.drop_vars("joint_position"), target)
    assert target.read_bytes() == earlier
    assert [path.name for path in tmp_path.iterdir()] == ["animation.html"]


@pytest.mark.parametrize("finger", [None, "{no json", "{}"])
def test_a_result_without_its_finger_is_refused(result, tmp_path, finger):
    broken = result.copy()
    broken.attrs = {} if finger is None else {"finger": finger}
    with pytest.raises(fp.InputError, match="finger"):
        write_animation(broken, tmp_path / "animation.html")


def test_a_tension_that_is_not_a_number_is_refused(result, tmp_path):
    broken = result.copy(deep=True)
    broken["tendon_tension"][:, 2] = np.nan
    with pytest.raises(fp.InputError, match="tendon_tension"):
        write_animation(broken, tmp_path / "animation.html")


@pytest.mark.parametrize(
    ("without", "missing"),
    [
        ("delete window.DecompressionStream", "DecompressionStream"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "WebGL"),
    ],
)
def test_a_browser_that_cannot_play_the_page_is_told_what_it_lacks(browser, result, tmp_path, without, missing):
    path = write_animation(result, tmp_path / "animation.html")
    script = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": without})
    try:
        browser.get(path.as_uri())
        until(lambda: browser.find_element("id", "title").text)
        told = browser.find_element("id", "title").text
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)
    assert told.startswith("This browser cannot play the page:") and missing in told
