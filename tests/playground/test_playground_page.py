"""Who may play on the page of the playground, and what messages with wrong values do to the playing."""

import contextlib
import http.client
import math
import socket
import time
from unittest.mock import MagicMock
from urllib.parse import urlsplit

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario

viser = pytest.importorskip("viser", reason="needs viser, which the extra 'play' brings")
msgspec, zstandard = pytest.importorskip("msgspec"), pytest.importorskip("zstandard")
websockets = pytest.importorskip("websockets.sync.client")
from websockets.exceptions import InvalidStatus  # noqa: E402

from finger_pin.playground.player import own_page_only  # noqa: E402
from finger_pin.playground.session import Session  # noqa: E402
from finger_pin.playground.stage import ROOT, Stage  # noqa: E402


@pytest.fixture(scope="module")
def playground(tmp_path_factory):
    folder = tmp_path_factory.mktemp("play")
    with fp.play("reversals", block=False, open_browser=False, folder=folder) as playing:
        yield playing


@contextlib.contextmanager
def connected(playground, host, origin):
    """A WebSocket as a browser opens it for a page of an origin, which believes to be at a host."""
    address = urlsplit(playground.url)
    more = {"subprotocols": [f"viser-v{viser.__version__}"], "compression": None, "max_size": None, "proxy": None}
    with (
        socket.create_connection((address.hostname, address.port)) as line,
        websockets.connect(f"ws://{host}/", sock=line, origin=origin, **more) as page,
    ):
        yield page


def port(playground):
    return urlsplit(playground.url).port


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:{port}", "https://example.com"),
        ("127.0.0.1:{port}", "http://127.0.0.1:1"),
        ("127.0.0.1:{port}", "null"),
        ("127.0.0.1:{port}", None),
        # A stranger's name that is led to this machine: page and server have one name.
        ("example.com:{port}", "http://example.com:{port}"),
        ("127.0.0.1.example.com:{port}", "http://127.0.0.1.example.com:{port}"),
    ],
)
def test_pages_from_elsewhere_cannot_play(playground, host, origin):
    number = port(playground)
    with (
        pytest.raises(InvalidStatus, match="403"),
        connected(playground, host.format(port=number), origin and origin.format(port=number)),
    ):
        pass


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "localhost:{port}", "[::1]:{port}", "localhost:1234"])
def test_the_page_itself_plays_also_through_a_tunnel(playground, host):
    netloc = host.format(port=port(playground))
    with connected(playground, netloc, f"http://{netloc}") as page:
        assert page.recv(timeout=60)


@pytest.mark.parametrize(("host", "status"), [("localhost", 200), ("example.com", 403), ("", 403)])
def test_files_are_served_under_names_of_this_machine(playground, host, status):
    connection = http.client.HTTPConnection("127.0.0.1", port(playground))
    connection.request("GET", "/", headers={"Host": host})
    answer = connection.getresponse()
    assert answer.status == status
    assert status == 200 or f"Host {host}:" in answer.read().decode()
    connection.close()


def test_a_server_that_cannot_be_guarded_is_refused():
    with pytest.raises(fp.FingerPinError, match="viser"), own_page_only("127.0.0.1"):
        pass


def received(page, seconds):
    """Yield the messages that a page receives."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            data = page.recv(timeout=1.0)
        except TimeoutError:
            continue
        size = int.from_bytes(data[8:16], "little")
        yield from msgspec.msgpack.decode(zstandard.decompress(data[16 : 16 + size]))["messages"]


def until(condition, patience=30.0):
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.05)


@pytest.mark.slow
def test_a_message_with_a_wrong_value_does_not_end_the_playing(playground):
    """Every control of the page is sent every wrong value, as by a page that has gone wrong."""
    session, netloc = playground.session, urlsplit(playground.url).netloc
    wrong = [math.nan, math.inf, 1e300, -1e300, "nonsense", "", None, [], [1.0], {"a": 1}, "-1"]
    with connected(playground, netloc, f"http://{netloc}") as page:
        look = {"wxyz": [1.0, 0.0, 0.0, 0.0], "look_at": [0.0] * 3, "up_direction": [0.0, 0.0, 1.0], "fov": 0.8}
        look |= {"position": [1.0, 0.0, 0.0], "near": 0.01, "far": 10.0, "image_height": 800, "image_width": 1200}

        def send(kind, **content):
            page.send(msgspec.msgpack.encode({"type": kind, **content}))

        # Time runs for those who look.
        send("ViewerCameraMessage", **look)
        messages = list(received(page, 3.0))
        controls = [each["uuid"] for each in messages if "value" in each and "uuid" in each]
        crosses = [each["name"] for each in messages if each["type"] == "TransformControlsMessage"]
        assert len(controls) > 10 and crosses

        for uuid in controls:
            for value in wrong:
                send("GuiUpdateMessage", uuid=uuid, updates={"value": value})
        for name in crosses:
            for value in (math.nan, 1e300):
                send("TransformControlsUpdateMessage", name=name, wxyz=[1.0, 0, 0, 0], position=[value] * 3, owner="")
        list(received(page, 1.0))
        playground.schedule(lambda: playground.press("Reset"))
        playground.schedule(lambda: playground.press("Play"))
        list(received(page, 0.5))
        before = session.simulator.time
        until(lambda: list(received(page, 0.1)) is not None and session.simulator.time > before + 0.05)
        assert session.stiffness == 20.0 and not any(handle is not None for handle in session.handles)
        # A right value still acts, and what is wrong is told.
        playground.schedule(lambda: {}["nonsense"])
        until(lambda: list(received(page, 0.1)) is not None and "nonsense" in playground.message)


EGG = """<mujoco><worldbody><body><joint name="knuckle" axis="0 1 0" range="-0.2 1.5"/>
<geom type="ellipsoid" size=".01 .02 .03" euler="0 0 90" mass=".01"/></body></worldbody>
<tendon><fixed name="cord"><joint joint="knuckle" coef="0.01"/></fixed></tendon>
<actuator><motor tendon="cord" ctrlrange="0 5"/></actuator></mujoco>"""


def test_an_ellipsoid_is_drawn_with_its_radii_and_turned_as_it_is():
    mujoco = pytest.importorskip("mujoco")
    finger = fp.from_mujoco(mujoco.MjModel.from_xml_string(EGG))
    server = MagicMock()
    Stage(server, Session(read_scenario(demo_motion(finger, 0.05))))
    (drawn,) = [call.kwargs for call in server.scene.add_icosphere.call_args_list]
    # A ball of the library's radius of 1 m, stretched; a quarter turn about z is cos 45 deg + k sin 45 deg.
    np.testing.assert_allclose(drawn["scale"], [0.01, 0.02, 0.03])
    np.testing.assert_allclose(drawn["wxyz"], np.sqrt([0.5, 0.0, 0.0, 0.5]), atol=1e-12)


def test_the_page_has_objects_and_contacts_where_the_simulator_has_them():
    server, session, frames = MagicMock(), Session("pinch"), {}
    server.scene.add_frame.side_effect = lambda path, **_: frames.setdefault(path, MagicMock())
    stage = Stage(server, session)
    while not (touching := session.signals().mechanism.touching).force.any():
        session.step()
    stage.show(session.reading())
    ball, pose = frames[f"{ROOT}/object_ball"], session.simulator.state.object_pose
    np.testing.assert_array_equal(ball.position, pose[:3])
    # viser has the real part of a quaternion first.
    np.testing.assert_array_equal(ball.wxyz, pose[[6, 3, 4, 5]])
    closed = touching.force.any(axis=-1)
    arrows = server.scene.add_arrows.return_value.points
    np.testing.assert_allclose(arrows[:, 0], touching.point[closed], atol=1e-7)
    assert arrows.shape == (closed.sum(), 2, 3)
    drawn = arrows[:, 1] - arrows[:, 0]
    lengths = np.linalg.norm(drawn, axis=1) * np.linalg.norm(touching.force[closed], axis=1)
    np.testing.assert_allclose(np.sum(drawn * touching.force[closed], axis=1), lengths, rtol=1e-3)
