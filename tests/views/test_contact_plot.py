"""The figure of contacts, from made-up ones."""

import numpy as np
import pytest
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.views.plots import plot_contact, plot_servo


def made(strengths):
    """Contacts that push with up to so many newtons, and rub with half of what their friction of 0.8 can be."""
    time = np.linspace(0.0, 1.0, 11)
    normal = np.outer(np.sin(np.pi * time), strengths)
    signals = {"normal_force": normal, "friction": 0.4 * normal, "level": 0.8 * normal, "slip": 0.0 * normal}
    data = {f"contact_{name}": (("time", "contact"), values) for name, values in signals.items()}
    return xr.Dataset(data, {"time": time, "contact": [f"pad-{index}" for index in range(len(strengths))]})


def test_the_contacts_that_push_hardest_are_shown_and_the_others_are_counted():
    figure = plot_contact(made([1.0, 0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert "(a) contact forces: the 6 of 7 that push hardest" in titles
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert "pad-2 (N)" in labels and "pad-0 (N)" not in labels and "pad-1 (N)" not in labels


def test_the_cone_says_what_its_edge_is():
    cone = next(axes for axes in plot_contact(made([2.0])).axes if "cone" in axes.get_title(loc="left"))
    drawn = {line.get_label(): line.get_data() for line in cone.lines}
    (legend,) = cone.get_figure(root=False).legends
    assert [text.get_text() for text in legend.get_texts()] == ["pad-0", "most that friction can be"]
    np.testing.assert_allclose(drawn["most that friction can be"], [[0.0, 2.0], [0.0, 1.6]])


@pytest.mark.parametrize(("draw", "what"), [(plot_contact, "nothing around it"), (plot_servo, "without servos")])
def test_a_figure_that_a_result_cannot_show_is_refused_in_one_line(draw, what):
    with pytest.raises(InputError, match=what):
        draw(made([1.0]).drop_dims("contact"))


def test_a_result_in_which_nothing_touches_says_so():
    titles = [axes.get_title(loc="left") for axes in plot_contact(made([0.0])).axes]
    assert "(a) contact forces: nothing ever touched" in titles


@pytest.mark.parametrize("count", [1, 2, 3, 10])
def test_few_objects_move_along_three_axes_and_many_move_so_far_as_they_are_from_where_they_were(count):
    result = made([1.0])
    along = {"x": 3.0, "y": 0.0, "z": -4.0}  # mm
    way = np.linspace(0.0, 1e-3, 11)[:, None, None] * np.array(list(along.values()))
    names = [f"ball_{index}" for index in range(count)]
    result["object_position"] = ("time", "object", "axis"), np.broadcast_to(way, (11, count, 3)) + 0.1
    result = result.assign_coords(object=names, axis=list(along))
    panel = next(axes for axes in plot_contact(result).axes if "free" in axes.get_title(loc="left"))
    ends = {line.get_label(): line.get_ydata()[-1] for line in panel.lines}
    if count < 3:
        assert ends == pytest.approx({f"{name} {axis}": mm for name in names for axis, mm in along.items()})
    else:
        assert ends == pytest.approx(dict.fromkeys(names, 5.0))
