"""A whole hand in figures, summary and space: what each finger shows is that finger's."""

import numpy as np
import pytest
from palm_cases import TREE, scenario_of

import finger_pin as fp
from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.views import plots
from finger_pin.views.plots.hands import finger_of, fingers_of
from finger_pin.views.summary import summarize

FINGERS = ["thumb", "index", "middle", "ring", "little"]


@pytest.fixture(scope="module")
def hand():
    return fp.simulate(fp.load_scenario("hand", {"simulation.duration": 0.05}))


def test_the_part_of_a_result_about_a_finger_has_its_own_names_and_values(hand):
    assert fingers_of(hand) == FINGERS
    ring = finger_of(hand, "ring")
    assert list(ring.joint.values) == ["abduction", "proximal", "medial", "distal"]
    np.testing.assert_array_equal(ring.tendon_tension.sel(tendon="T3"), hand.tendon_tension.sel(tendon="ring.T3"))
    np.testing.assert_array_equal(ring.fingertip_position, hand.fingertip_position.sel(finger="ring"))
    proximal = hand.passive_tension_proximal.sel(passive_tendon="ring.T5")
    np.testing.assert_array_equal(ring.passive_tension_proximal.squeeze(), proximal)
    with pytest.raises(InputError, match="did you mean ring"):
        finger_of(hand, "rin")
    with pytest.raises(InputError, match="one finger"):
        finger_of(ring, "ring")


@pytest.mark.slow
@pytest.mark.parametrize("draw_figure", [plots.plot_fig6, plots.plot_losses])
def test_figures_have_a_row_for_each_finger_or_show_one_as_a_finger(hand, draw_figure):
    figure = draw_figure(hand)
    figure.canvas.draw()
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert all(sum(name in label for label in labels) == len(labels) / 5 for name in FINGERS)
    lines = next(axes for axes in figure.axes if "little" in axes.get_ylabel()).get_lines()
    assert 4 <= len(lines) <= 5
    one = draw_figure(hand, finger="little")
    assert len(one.axes) > len(figure.axes) / 5 and not any("little" in axes.get_ylabel() for axes in one.axes)


def test_lines_of_fingers_that_differ_look_as_their_names_in_the_legend(hand):
    tips = hand.sel(joint=["thumb.distal", "index.medial", "index.distal"])
    figure = plots.plot_fig6(tips.drop_dims("tendon").assign(tendon_tension=hand.tendon_tension))
    (legend,) = figure.axes[0].get_figure(root=False).legends
    looks = {
        text.get_text(): handle.get_color() for text, handle in zip(legend.get_texts(), legend.get_lines(), strict=True)
    }
    assert set(looks) == {"distal", "medial"} and looks["distal"] != looks["medial"]
    rows = [axes for axes in figure.axes if any(name in axes.get_ylabel() for name in ("thumb (°)", "index (°)"))]
    drawn = [(line.get_label(), line.get_color()) for axes in rows for line in axes.get_lines()]
    assert len(drawn) == 6 and all(looks[name] == colour for name, colour in drawn)


def test_the_summary_names_every_finger(hand):
    text = summarize(hand)
    assert all(f"{name}.medial" in text and f"{name}.T5, distal half" in text for name in FINGERS)


def test_tendons_and_solids_of_a_placed_finger_are_its_own_moved_to_its_place():
    described = fp.load_hand("ub_hand")
    whole, own = TendonGeometry(described), TendonGeometry(described.hand.built()["thumb"])
    theta = np.array([0.1, 0.3, 0.5, 0.4])
    all_joints = np.zeros(20)
    all_joints[:4] = theta
    placed = described.hand.fingers["thumb"]
    for path in own.paths(theta):
        found = next(each for each in whole.paths(all_joints) if each.name == f"thumb.{path.name}")
        np.testing.assert_allclose(found.points, path.points @ placed.rotation.T + placed.position, atol=1e-14)
    assert {"palm", *(f"thumb.{each.name}" for each in own.visuals)} <= {each.name for each in whole.visuals}
    finger = fp.Finger(described)
    poses = whole.poses(all_joints)
    link, offset = whole.tips[0]
    tip = poses.rotation[link] @ offset + poses.translation[link]
    np.testing.assert_allclose(tip, finger.motion(all_joints, np.zeros(20)).tip[0], atol=1e-15)


def test_figures_show_what_slides_of_a_finger_in_metres():
    result = fp.simulate(scenario_of({"left": TREE, "right": "ub"}))
    labels = [axes.get_ylabel().replace("\xa0", " ") for axes in fp.plot_fig6(result).axes]
    assert labels[:2] == ["left (° or m)", "right (°)"]
    assert fp.plot_fig6(result, finger="left").axes[0].get_ylabel() == "position θ (° or m)"
    drawn = fp.plot_fig6(result).axes[0].get_lines()[3].get_ydata()
    assert drawn[-1] == result.joint_position[-1].sel(joint="left.thrust")
