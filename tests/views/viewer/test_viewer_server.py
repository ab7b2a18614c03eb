"""Pages in service: on the loopback address only, for as long as they are wanted."""

import html
import http.client
import re
import socket
import sys
import threading

import pytest

from finger_pin.views.viewer import view, write_animation
from finger_pin.views.viewer.animation import animation_page


def fetch(url, path="/", host=None):
    address = url.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(address, timeout=120)
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


def test_view_opens_the_browser_at_its_own_address_also_where_ipykernel_was_imported(result, monkeypatch):
    opened = []
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    monkeypatch.setattr("webbrowser.open", lambda url, new: opened.append(url))
    with view(result, block=False) as viewing:
        assert opened == [viewing.url]


def test_a_blocking_view_ends_with_an_interrupt(result, monkeypatch, capsys):
    monkeypatch.setattr("threading.Thread.join", interrupted_join)
    viewing = view(result, open_browser=False, block=True)
    assert viewing.url in capsys.readouterr().out
    with pytest.raises(OSError, match="refused"):
        fetch(viewing.url)


def test_without_a_browser_a_view_waits_only_if_it_was_asked_to(result, monkeypatch, capsys):
    monkeypatch.setattr("webbrowser.open", lambda url, new: False)
    monkeypatch.setattr("threading.Thread.join", interrupted_join)
    with view(result) as viewing:
        assert viewing.url.encode() and fetch(viewing.url)
        told = capsys.readouterr()
        assert "block=True" in told.err and viewing.url in told.err and not told.out
    view(result, block=True)
    assert "Ctrl-C ends this" in capsys.readouterr().out


def interrupted_join(thread, timeout=None, join=threading.Thread.join):
    """Wait for a thread; Ctrl-C comes while somebody waits only for a while."""
    if timeout is not None:
        raise KeyboardInterrupt
    join(thread)


def test_a_notebook_shows_the_page_in_its_cell_and_opens_no_window(result, kernel, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url, new: opened.append(url))
    with view(result) as viewing:
        (page,) = re.findall(r'<iframe srcdoc="([^"]*)"', viewing._repr_html_())
        # All of it stands in the cell: where a hub runs the notebook, an address of its machine leads nowhere.
        assert html.unescape(page) == animation_page(result) and viewing.url not in viewing._repr_html_()
        assert viewing.url in repr(viewing)
    assert opened == []
