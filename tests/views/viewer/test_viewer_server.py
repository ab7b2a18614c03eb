"""Pages in service: on the loopback address only, for as long as they are wanted."""

import base64
import html
import http.client
import json
import re
import socket
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from motion import joint_position, tensions
from pages import Clock

import finger_pin as fp
from finger_pin.views.viewer import LiveView, view, write_animation
from finger_pin.views.viewer.animation import animation_page


def fetch(url, path="/", host=None):
    address = url.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(address, timeout=5)
    try:
        connection.request("GET", path, headers={"Host": host or address})
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def test_view_serves_the_page_that_write_animation_writes(result, tmp_path):
    with view(result, open_browser=False, block=False) as viewing:
        status, text = fetch(viewing.url)
    assert status == 200
    assert text == write_animation(result, tmp_path / "animation.html").read_text(encoding="utf-8")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a second loopback address tell")
def test_the_server_listens_on_the_loopback_address_alone(result):
    with view(result, open_browser=False, block=False) as viewing:
        port = int(viewing.url.rstrip("/").rsplit(":", 1)[1])
        with socket.socket() as other:
            # Were it listening on every address, this one would be taken too.
            other.bind(("127.0.0.2", port))
        with socket.socket() as same, pytest.raises(OSError, match="in use"):
            same.bind(("127.0.0.1", port))


def test_the_server_answers_nobody_who_reached_it_under_another_name(result):
    with view(result, open_browser=False, block=False) as viewing:
        assert fetch(viewing.url, host="example.org")[0] == 403
        assert fetch(viewing.url, path="/etc/passwd")[0] == 404
        assert fetch(viewing.url, path="/frames")[0] == 404


def test_closing_leaves_neither_threads_nor_an_open_port(result):
    before = threading.active_count()
    viewing = view(result, open_browser=False, block=False)
    viewing.close()
    viewing.close()
    assert threading.active_count() == before
    with pytest.raises(OSError, match="refused"):
        fetch(viewing.url)


def test_view_opens_the_browser_at_its_own_address(result, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url, new: opened.append(url))
    with view(result, block=False) as viewing:
        assert opened == [viewing.url]


def test_a_blocking_view_ends_with_an_interrupt(result, monkeypatch, capsys):
    monkeypatch.setattr("finger_pin.views.viewer.server.PageServer.join", interrupt)
    viewing = view(result, open_browser=False, block=True)
    assert viewing.url in capsys.readouterr().out
    with pytest.raises(OSError, match="refused"):
        fetch(viewing.url)


def interrupt(_):
    raise KeyboardInterrupt


def test_a_live_view_is_throttled_and_shows_the_last_state():
    times = np.linspace(0.0, 1.0, 2001)
    live = LiveView(fp.load_finger("ub"), open_browser=False, rate=20.0)
    streamed = []
    reader = threading.Thread(target=lambda: streamed.append(fetch(live.url, "/frames")[1]))
    reader.start()
    start = time.monotonic()
    for t in times:
        live.update(t, joint_position(t), tensions(t))
    took = time.monotonic() - start
    time.sleep(0.1)
    live.close()
    reader.join()
    frames = re.findall(r"^data: (\{.*)$", streamed[0], flags=re.MULTILINE)
    assert 2 <= len(frames) <= 2 + 20.0 * took + 1
    assert "event: end" in streamed[0]
    last = np.frombuffer(base64.b64decode(json.loads(frames[-1])["joint"]), "<f4")
    assert last == pytest.approx(joint_position(1.0), abs=1e-6)


def test_a_simulation_that_is_watched_is_never_ahead_of_real_time(monkeypatch, capsys, finger):
    clock = Clock()
    monkeypatch.setattr("finger_pin.views.viewer.viewing.time", clock)
    signals = finger.evaluate(finger.rest_state(joint_position(0.0)), np.ones(4))
    seen = []
    with LiveView(finger.description, open_browser=False) as live:
        assert live.url in capsys.readouterr().out
        # The step from 0.5 s on takes 2 s to compute; the others take a hundredth of what they simulate.
        for t, work in ((0.0, 0.0), (0.25, 0.0025), (0.5, 0.0025), (0.75, 2.0), (1.0, 0.0025), (1.5, 0.005)):
            clock.now += work
            live.observe(t, SimpleNamespace(finger=signals))
            seen.append(clock.now - 1000.0)
    np.testing.assert_allclose(seen, [0.0, 0.25, 0.5, 2.5, 2.75, 3.25])


def test_a_live_view_refuses_tensions_of_another_finger():
    with LiveView(fp.load_finger("planar"), open_browser=False) as live, pytest.raises(fp.InputError, match="3"):
        live.update(0.0, np.zeros(2), np.ones(5))


def test_a_notebook_shows_the_page_in_its_cell_and_opens_no_window(result, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url, new: opened.append(url))
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    with view(result) as viewing:
        (page,) = re.findall(r'<iframe srcdoc="([^"]*)"', viewing._repr_html_())
        # All of it stands in the cell: where a hub runs the notebook, an address of its machine leads nowhere.
        assert html.unescape(page) == animation_page(result) and viewing.url not in viewing._repr_html_()
        assert viewing.url in repr(viewing)
    assert opened == []
