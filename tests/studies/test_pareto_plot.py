"""Figures of searches: every design that keeps the bounds, the front, the start."""

import numpy as np
import pytest
import xarray as xr

from finger_pin.views.plots.pareto import plot_pareto


def made(minimise, maximise=(), feasible=(True, True, True, False)):
    values = {"a": [3.0, 1.0, 2.0, 0.5], "b": [3.0, 2.0, 1.0, 0.5], "c": [1.0, 2.0, 3.0, 4.0]}
    names = [*minimise, *maximise]
    data = {name: ("sample", values[name], {"units": "N", "long_name": f"long {name}"}) for name in names}
    data["status"] = ("sample", ["done", "done", "done", "done"])
    data["feasible"] = ("sample", list(feasible))
    data["front"] = ("sample", [0, 1, 2, 0] if any(feasible) else [0, 0, 0, 0])
    return xr.Dataset(data, attrs={"minimise": ", ".join(minimise), "maximise": ", ".join(maximise)})


def test_designs_front_and_start_lie_where_they_are_and_what_breaks_a_bound_is_left_out():
    axes, close = plot_pareto(made(["a", "b"])).axes
    drawn = {line.get_label(): np.stack(line.get_data(), axis=1).tolist() for line in axes.lines}
    assert drawn["kept bounds"] == [[3.0, 3.0]]
    assert drawn["front"] == [[1.0, 2.0], [2.0, 1.0]]
    assert drawn["start"] == [[3.0, 3.0]]
    assert [text.get_text() for text in close.texts] == ["1", "2"]
    for x, y in ([1.0, 2.0], [2.0, 1.0]):
        assert close.get_xlim()[0] < x < close.get_xlim()[1]
        assert close.get_ylim()[0] < y < close.get_ylim()[1]
    # The frame of the magnified part ends with the panel.
    (frame,) = axes.patches
    assert frame.get_clip_box() is not None and frame.get_bbox().x0 == close.get_xlim()[0]
    assert axes.get_xlabel() == "long a (N)"


def test_designs_whose_numbers_would_be_printed_over_each_other_have_one_number():
    front = made(["a", "b"])
    close = front.isel(sample=[1]).assign(a=front.a[[1]] + 1e-3, front=("sample", [3]))
    _, magnified = plot_pareto(xr.concat([front, close], "sample", combine_attrs="override")).axes
    assert [text.get_text() for text in magnified.texts] == ["1", "2"]


def test_what_lies_far_out_is_counted_and_left_out_of_view():
    near = made(["a", "b"]).isel(sample=[0])
    far = near.copy(deep=True)
    far["a"][:] = 1e4
    result = xr.concat([made(["a", "b"]), *[near] * 60, far], "sample", combine_attrs="override")
    axes, _ = plot_pareto(result).axes
    assert axes.get_xlim()[1] < 10.0
    assert axes.get_title(loc="left") == "64 designs, 1 beyond the edges"


def test_three_objectives_are_drawn_pair_by_pair():
    figure = plot_pareto(made(["a", "b"], ["c"]))
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    assert labels == [("long a (N)", "long b (N)"), ("long a (N)", "long c (N)"), ("long b (N)", "long c (N)")]


def test_one_objective_is_drawn_as_the_best_so_far():
    (axes,) = plot_pareto(made(["b"])).axes
    best = next(line for line in axes.lines if line.get_label() == "best so far")
    assert best.get_ydata().tolist() == [3.0, 2.0, 1.0]
    (axes,) = plot_pareto(made([], ["c"])).axes
    best = next(line for line in axes.lines if line.get_label() == "best so far")
    assert best.get_ydata().tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("minimise", [["a"], ["a", "b"]])
def test_a_search_in_vain_is_drawn_without_a_front(minimise):
    figure = plot_pareto(made(minimise, feasible=(False,) * 4))
    figure.draw_without_rendering()
    assert "front" not in {line.get_label() for axes in figure.axes for line in axes.lines if len(line.get_xdata())}


def test_one_design_is_one_panel_and_nothing_is_magnified():
    alone = made(["a", "b"]).isel(sample=[1])
    figure = plot_pareto(alone)
    (axes,) = figure.axes
    assert axes.get_title(loc="left") == "1 design" and not axes.patches
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["front", "start"]
