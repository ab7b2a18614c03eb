"""Play, pause, scrub, speed, and a simulation watched while it runs."""

import time

import numpy as np
import pytest
from motion import DURATION, joint_position
from pages import seek, until


@pytest.mark.parametrize("speed", ["0.25", "1", "4"])
def test_playing_advances_time_at_the_chosen_speed(page, speed):
    seek(page, 0.2)
    page.find_element("css selector", f"#speed option[value='{speed}']").click()
    # A tenth of a second later, as the browser's clock would say.
    script = "fingerPlayer.play(); fingerPlayer.shown = 1e9; fingerPlayer.due = 0; fingerPlayer.advance(1e9 + 100);"
    shown = page.execute_script(script + "fingerPlayer.pause(); return fingerPlayer.time")
    page.find_element("css selector", "#speed option[value='1']").click()
    assert shown == pytest.approx(0.2 + 0.1 * float(speed), abs=1e-9)


def test_pause_holds_the_time(page):
    # Without a loop a slow machine may reach the end, where it pauses by itself.
    page.execute_script("document.getElementById('loop').click(); fingerPlayer.seek(1.0)")
    play = page.find_element("id", "play")
    play.click()
    until(lambda: play.get_attribute("aria-label") == "Pause")
    until(lambda: page.execute_script("return fingerPlayer.time > 1.2"))
    play.click()
    until(lambda: play.get_attribute("aria-label") == "Play")
    held = page.execute_script("return fingerPlayer.time")
    time.sleep(0.2)
    assert page.execute_script("document.getElementById('loop').click(); return fingerPlayer.time") == held


def test_scrubbing_moves_the_finger_to_that_time(page):
    page.execute_script("""
    const scrub = document.getElementById("scrub"); fingerPlayer.seek(0); fingerPlayer.play();
    scrub.value = 2.75; scrub.dispatchEvent(new Event("input"));""")
    assert page.execute_script("return [fingerPlayer.playing, fingerPlayer.time]") == [False, pytest.approx(2.75)]
    angles = [cell.text for cell in page.find_elements("css selector", "#joints .value")]
    assert angles == [f"{degrees:.1f}°" for degrees in np.degrees(joint_position(2.75))]


def test_playing_stops_at_the_end_unless_it_loops(page):
    page.execute_script("fingerPlayer.seek(3.9); fingerPlayer.play();")
    until(lambda: not page.execute_script("return fingerPlayer.playing"))
    assert page.execute_script("return fingerPlayer.time") == pytest.approx(DURATION)
    page.execute_script("document.getElementById('loop').click(); fingerPlayer.seek(3.9); fingerPlayer.play();")
    until(lambda: page.execute_script("return fingerPlayer.time < 3.5"))
    assert page.execute_script("document.getElementById('loop').click(); return fingerPlayer.playing")


def test_keys_play_step_and_choose_the_view(page):
    body = page.find_element("tag name", "body")
    seek(page, 1.0)
    body.send_keys("\ue014")  # right arrow
    until(lambda: page.execute_script("return fingerPlayer.time") == pytest.approx(1.05))
    body.send_keys(" ")
    until(lambda: page.execute_script("return fingerPlayer.playing"))
    body.send_keys(" ")
    until(lambda: not page.execute_script("return fingerPlayer.playing"))
    page.execute_script("fingerPlayer.scene.frame('side')")
    before = page.execute_script("return fingerPlayer.viewer.camera.position.toArray()")
    body.send_keys("3")
    until(lambda: page.execute_script("return fingerPlayer.viewer.camera.position.toArray()") != before)
