"""A result played in meshcat's own window, where the user may have put other things."""

from dataclasses import dataclass, field

import matplotlib
import numpy as np
import pytest
from closed_kinematics import equation_1, frames
from motion import DURATION, joint_position, tensions
from pages import Clock

import finger_pin as fp
from finger_pin.views import draw


@dataclass
class Window:
    """The messages that a `meshcat.Visualizer` sends, with their times."""

    clock: Clock
    sent: list = field(default_factory=list)

    def send(self, command):
        self.sent.append((self.clock.now, command.lower()))


@pytest.fixture
def played(result, monkeypatch):
    meshcat = pytest.importorskip("meshcat")
    clock = Clock()
    monkeypatch.setattr("finger_pin.views.viewer.drawing.time", clock)
    window = Window(clock)

    def play(**options):
        draw(meshcat.Visualizer(window=window)["bench"], result, **options)
        return window.sent

    return play


def test_playback_keeps_real_time_and_changes_nothing_but_the_finger(played):
    sent = played(speed=2.0, rate=20.0)
    times = np.unique([when for when, _ in sent]) - 1000.0
    np.testing.assert_allclose(times, np.arange(0.0, DURATION / 2.0 + 0.01, 0.05), atol=2e-3)
    assert all(command["path"].startswith("/meshcat/bench/finger_pin/") for _, command in sent)
    assert {command["type"] for _, command in sent} == {"set_object", "set_transform"}


@pytest.mark.slow
def test_links_stand_where_the_kinematics_say_and_tendons_have_the_colour_of_their_tension(played):
    sent = dict((command["path"], command) for _, command in played())
    q = joint_position(DURATION)
    for name, (rotation, origin) in zip(fp.load_finger("ub_stand_in").joints, frames(q), strict=False):
        matrix = np.reshape(sent[f"/meshcat/bench/finger_pin/{name}_link"]["matrix"], (4, 4)).T
        np.testing.assert_allclose(matrix[:3, :3], rotation, atol=1e-9)
        np.testing.assert_allclose(matrix[:3, 3], origin, atol=1e-9)
    for index, name in enumerate(["T1", "T2", "T3", "T4"]):
        attributes = sent[f"/meshcat/bench/finger_pin/tendons/{name}"]["object"]["geometries"][0]["data"]["attributes"]
        colours = np.frombuffer(attributes["color"]["array"].data, "<f4").reshape(-1, 3)
        assert np.ptp(colours, axis=0).max() < 1e-6
        # T1 is slack, and the largest tension of the motion is 9 N, so that colours reach to 10 N.
        expected = matplotlib.colormaps["viridis"](0.25 + 0.75 * tensions(DURATION)[index] / 10.0)[:3]
        np.testing.assert_allclose(colours[0], [0.62, 0.64, 0.67] if name == "T1" else expected, atol=0.01)


def test_speeds_that_stand_still_are_refused(played):
    with pytest.raises(fp.InputError, match="speed"):
        played(speed=0.0)


def test_meshcat_shows_it(result, browser):
    meshcat = pytest.importorskip("meshcat")
    visualizer = meshcat.Visualizer()
    try:
        browser.get(visualizer.url())
        draw(visualizer, result, speed=np.inf)
        script = """
        const node = viewer.scene_tree.find(["meshcat", "finger_pin", "distal_link"]).object;
        viewer.scene.updateMatrixWorld(true);
        return node.localToWorld(new MeshCat.THREE.Vector3(0.0218, 0, 0)).toArray();"""
        x, y, z = equation_1(joint_position(DURATION))
        assert browser.execute_script(script) == pytest.approx([x, z, -y], abs=1e-6)
    finally:
        visualizer.window.zmq_socket.close()
        visualizer.window.server_proc.kill()
        visualizer.window.server_proc.wait()
