"""A finger on a model of the user's own: figures take it, the viewer says that it does not."""

import example_robot_data
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.analysis import force_polytope, self_locking_map
from finger_pin.views import LiveView, plots, view_forces

POSITION = (0.1, 0.5, 0.6, 0.4)


@pytest.fixture(scope="module")
def foreign(network):
    """The index finger of the Allegro hand, pulled by five tendons."""
    hand = example_robot_data.load("allegro_right_hand").model
    joints = {name: f"joint_{index}.0" for index, name in enumerate(("spread", "proximal", "medial", "distal"))}
    tendons = {
        "T1": {"spread": 10.0, "proximal": 10.0},
        "T2": {"spread": -10.0, "proximal": 10.0},
        "T3": {"medial": 9.0},
        "T4": {"proximal": -8.0, "medial": -7.0, "distal": -6.0},
        "T5": {"medial": -5.0, "distal": 7.0},
    }
    description = network(list(joints), tendons, passive=["T5"])
    return fp.Finger.from_model(description, hand, joints, "link_3.0_tip", base_axis=(0.0, 0.0, 1.0))


def test_every_figure_of_a_finger_takes_it(foreign):
    figures = [
        plots.plot_workspace(foreign),
        plots.plot_force_polytope(foreign, POSITION, 20.0),
        plots.plot_radius_sensitivity(foreign, POSITION, (0.0, 0.0, 0.5)),
        plots.plot_critical_friction(foreign),
        plots.plot_self_locking_map(self_locking_map(foreign, samples=3)),
    ]
    for figure in figures:
        figure.canvas.draw()
    # The workspace is that of the fingertip of the model.
    tip = 1e3 * foreign.rigid_body.tip_position(np.zeros(4))
    low, high = np.array([getattr(figures[0].axes[0], f"get_{axis}lim")() for axis in "xyz"]).T
    assert np.all((low < tip) & (tip < high))


def test_the_viewer_says_in_a_line_that_it_does_not(foreign):
    polytope = force_polytope(foreign, POSITION, 20.0)
    for show in (
        lambda: view_forces(foreign, polytope, open_browser=False, block=False),
        lambda: LiveView(foreign, open_browser=False),
    ):
        with pytest.raises(fp.InputError, match="another model") as caught:
            show()
        assert "\n" not in str(caught.value)
    with pytest.raises(fp.InputError, match=r"joints\.spread\.link.*viewer"):
        LiveView(foreign.description, open_browser=False)
