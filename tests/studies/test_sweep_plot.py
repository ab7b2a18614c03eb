"""Figures of sweeps: which kind is drawn, and that what is drawn is what was found."""

import itertools

import matplotlib.collections
import numpy as np
import pytest
import xarray as xr

from finger_pin.views.plots.sweep_metrics import plot_sweep, short_key

RADIUS = "finger.tendons.T3.crossings.medial.radius"


def made(coordinates, dims, **values):
    """A sweep's Dataset, without running one; NaN is a failed run."""
    data = {}
    for name, array in values.items():
        data[name] = (dims, np.asarray(array, dtype=float), {"units": "N", "long_name": f"long {name}"})
    first = np.asarray(next(iter(values.values())), dtype=float)
    status = np.where(np.isnan(first), "failed", "done")
    data["status"], data["reason"] = (dims, status), (dims, np.where(np.isnan(first), "why", ""))
    units = {"units": "m", "long_name": "key"}
    own = {key: (("sample",) if "sample" in dims else (key,), np.asarray(v), units) for key, v in coordinates.items()}
    return xr.Dataset(data, own)


def test_one_key_is_drawn_as_lines_with_failures_marked():
    key = "controller.gain"
    figure = plot_sweep(made({key: [1.0, 2.0, 3.0]}, (key,), a=[5.0, np.nan, 7.0], b=[1.0, np.nan, 2.0]))
    first, second = figure.axes
    np.testing.assert_array_equal(first.lines[0].get_ydata(), [5.0, np.nan, 7.0])
    np.testing.assert_array_equal(second.lines[0].get_ydata(), [1.0, np.nan, 2.0])
    np.testing.assert_array_equal(first.lines[1].get_xdata(), [2.0])
    assert first.get_xscale() == "linear"
    assert first.get_xlabel() == "controller gain (m)"


def test_two_keys_are_drawn_as_a_map_with_each_number_in_its_own_cell():
    keys = {RADIUS: [1.0, 2.0, 4.0], "b": [1.0, 10.0, 100.0, 1000.0]}
    values = np.arange(12.0).reshape(3, 4)
    values[0, 1] = np.nan
    figure = plot_sweep(made(keys, (RADIUS, "b"), a=values))
    axes = figure.axes[0]
    (mesh,) = (each for each in axes.collections if isinstance(each, matplotlib.collections.QuadMesh))
    corners = mesh.get_coordinates()
    for i, x in enumerate(keys[RADIUS]):
        for j, y in enumerate(keys["b"]):
            assert corners[j, i, 0] < x < corners[j + 1, i + 1, 0]
            assert corners[j, i, 1] < y < corners[j + 1, i + 1, 1]
            shown = mesh.get_array()[j, i]
            assert np.ma.is_masked(shown) if np.isnan(values[i, j]) else shown == values[i, j]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    (cross,) = axes.lines
    assert (cross.get_xdata().tolist(), cross.get_ydata().tolist()) == ([1.0], [10.0])


def test_a_map_has_ticks_at_the_values_swept_and_says_in_words_what_is_the_same_everywhere():
    keys = {"a": [0.5, 0.65, 1.3], "b": [1.0, 10.0, 100.0]}
    figure = plot_sweep(made(keys, ("a", "b"), m=np.arange(9.0).reshape(3, 3), same=np.full((3, 3), 2.5)))
    figure.draw_without_rendering()
    varied, same, _ = figure.axes
    assert [label.get_text() for label in varied.get_xticklabels()] == ["0.5", "0.65", "1.3"]
    np.testing.assert_array_equal(varied.get_yticks(), keys["b"])
    assert not any(isinstance(each, matplotlib.collections.QuadMesh) for each in same.collections)
    assert [text.get_text() for text in same.texts] == ["2.5 N\nat every point"]


@pytest.mark.parametrize("kind", ["sample", "grid"])
def test_more_keys_and_samples_are_drawn_as_a_point_per_run_over_each_key_with_failures_marked(kind):
    if kind == "sample":
        keys = {"a": [0.0, 1.0, 3.0], "b": [9.0, 8.0, 7.0]}
        result = made(keys, ("sample",), m=[4.0, np.nan, 6.0], n=[1.0, 0.0, 2.0])
        points = {(0, 0): [(0, 4), (3, 6)], (0, 1): [(7, 6), (9, 4)], (1, 0): [(0, 1), (1, 0), (3, 2)]}
        failures, size = {(0, 0): [1.0], (0, 1): [8.0], (1, 1): [8.0]}, (2, 2)
    else:
        axis, values = [0.0, 2.0], np.arange(8.0).reshape(2, 2, 2)
        values[0, 0, 1] = np.nan
        result = made({"a": axis, "b": axis, "c": axis}, ("a", "b", "c"), m=values)
        # The last key runs fastest.
        points = {(0, 2): [(0, 0), (0, 2), (0, 4), (0, 6), (2, 3), (2, 5), (2, 7)]}
        failures, size = {(0, 0): [0.0], (0, 1): [0.0], (0, 2): [2.0]}, (1, 3)
    figure = plot_sweep(result)
    panels = np.reshape(figure.axes, size)
    for place, expected in points.items():
        drawn = np.stack(panels[place].lines[0].get_data(), axis=1)
        assert sorted(map(tuple, drawn[np.isfinite(drawn).all(axis=1)])) == expected
    for place, expected in failures.items():
        assert panels[place].lines[1].get_xdata().tolist() == expected
    assert figure.get_suptitle() == f"{result.status.size - 1} runs, 1 failed or missing (crosses)"
    assert [axes.get_xlabel() for axes in panels[-1]] == [f"{key} (m)" for key in result.coords]
    assert [axes.get_ylabel() for axes in panels[:, 0]] == ["m (N)", "n (N)"][: size[0]]


@pytest.mark.slow
@pytest.mark.parametrize("width", ["column", "page", None])
def test_the_text_of_many_keys_overlaps_at_no_width(width):
    keys = {name: 1e-3 * np.arange(1.0, 6.0) for name in (RADIUS, "controller.gain", "c", "simulation.method")}
    keys["d"] = ["Rodas5P", "BDF", "Rodas5P", "BDF", "BDF"]
    figure = plot_sweep(made(keys, ("sample",), m=np.arange(5.0)), width=width)
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for axes in figure.axes for text in (axes.xaxis.label, axes.yaxis.label)]
    for axes in figure.axes:
        low, high = axes.get_xlim()
        boxes += [each.get_window_extent() for each in axes.get_xticklabels() if low <= each.get_position()[0] <= high]
    for first, second in itertools.combinations(boxes, 2):
        assert not first.padded(-1.0).overlaps(second.padded(-1.0))


def test_names_stand_side_by_side_in_lines_maps_and_points():
    methods, switch = ["Rodas4", "Rodas5P", "BDF"], [True, False]
    (axes,) = plot_sweep(made({"simulation.method": methods}, ("simulation.method",), m=[3.0, 1.0, 2.0])).axes
    (line,) = axes.lines
    assert line.get_linestyle() == "None"
    assert [label.get_text() for label in axes.get_xticklabels()] == methods
    np.testing.assert_array_equal(axes.get_xticks(), line.get_xdata())
    np.testing.assert_array_equal(line.get_ydata(), [3.0, 1.0, 2.0])
    values = np.arange(6.0).reshape(3, 2)
    axes = plot_sweep(made({"a": switch, "b": [1.0, 2.0, 4.0]}, ("a", "b"), m=values.T)).axes[0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["true", "false"]
    axes = plot_sweep(made({"a": methods, "b": switch}, ("a", "b"), m=values)).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["true", "false"]
    (mesh,) = (each for each in axes.collections if isinstance(each, matplotlib.collections.QuadMesh))
    np.testing.assert_array_equal(mesh.get_array(), values.T)
    axes = plot_sweep(made({"a": ["x", "y", "x"], "b": [1.0, 2.0, 3.0]}, ("sample",), m=[4.0, 5.0, 6.0])).axes[0]
    assert axes.lines[0].get_xdata().tolist() == [0.0, 1.0, 0.0]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["x", "y"]


def test_keys_of_one_value_take_no_part():
    figure = plot_sweep(made({"a": [1.0], "b": [1.0, 2.0]}, ("a", "b"), m=[[3.0, 4.0]]))
    np.testing.assert_array_equal(figure.axes[0].lines[0].get_ydata(), [3.0, 4.0])


def test_a_sweep_of_failures_alone_is_drawn_without_a_number():
    def drawn(*shape):
        keys = {name: np.arange(1.0, 1.0 + size) for name, size in zip("abc", shape, strict=False)}
        figure = plot_sweep(made(keys, tuple(keys), m=np.full(shape, np.nan)))
        figure.draw_without_rendering()
        return figure

    values, failures = drawn(1).axes[0].lines[:2]
    assert np.isnan(values.get_ydata()).all() and failures.get_xdata().tolist() == [1.0]
    plane = drawn(2, 2).axes[0]
    (crosses,) = plane.lines
    assert np.stack(crosses.get_data(), axis=1).tolist() == [[1.0, 1.0], [1.0, 2.0], [2.0, 1.0], [2.0, 2.0]]
    assert not plane.collections
    assert drawn(2, 2, 2).get_suptitle().startswith("0 runs, 8 failed")


def test_infinite_metrics_leave_the_finite_ones_drawn():
    for keys in ({"a": [1.0, 2.0]}, {"a": [1.0, 2.0], "b": [1.0]}, {"a": [1.0], "b": [1.0], "c": [1.0, 2.0]}):
        shape = tuple(len(v) for v in keys.values())
        figure = plot_sweep(made(keys, tuple(keys), m=np.array([np.inf, 1.0]).reshape(shape)))
        figure.draw_without_rendering()
        assert any(1.0 in np.asarray(line.get_ydata()) for line in figure.axes[0].lines)
        assert np.isfinite([figure.axes[0].get_xlim(), figure.axes[0].get_ylim()]).all()


def test_labels_say_what_a_key_is_and_not_where_it_lies():
    assert short_key(RADIUS) == "T3 medial radius"
    assert short_key("finger.joints.distal.link.length") == "distal length"
    assert short_key("finger.tendon_friction.coulomb") == "tendon friction coulomb"
