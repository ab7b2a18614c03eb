"""The style of all figures: colours that everybody tells apart, no windows, a look that ends with the figure."""

import itertools
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
import xarray as xr
from made_up import synthetic
from matplotlib.colors import to_rgb
from matplotlib.figure import SubFigure
from matplotlib.transforms import Bbox
from paper.plot_friction_law import plot_friction_law

import finger_pin as fp
from finger_pin.analysis import self_locking_map
from finger_pin.exceptions import InputError
from finger_pin.views import plots
from finger_pin.views.plots.style import BLUE, COLOURS, GREEN, PURPLE, VERMILLION


def lab(rgb):
    """CIELAB of linear sRGB under D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ rgb
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


# Machado, Oliveira and Fernandes (2009), severity 1.0, for linear RGB.
BLINDNESS = {
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "none": np.eye(3),
}


@pytest.mark.parametrize("blindness", BLINDNESS.values(), ids=BLINDNESS.keys())
def test_colour_blind_people_tell_the_joints_apart(blindness):
    assert COLOURS[:4] == (BLUE, VERMILLION, GREEN, PURPLE)
    seen = []
    for colour in COLOURS[:4]:
        srgb = np.array(to_rgb(colour))
        linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        seen.append(lab(np.clip(np.array(blindness) @ linear, 1e-6, 1.0)))
    # Two points of CIELAB are just noticeable side by side; thin lines need ten or so.
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) > 12.0


@pytest.mark.slow
def test_figures_open_no_windows_and_leave_settings_alone():
    code = """
import sys
import matplotlib

def settings():
    # Looking at the backend would choose one.
    return {key: matplotlib.rcParams[key] for key in matplotlib.rcParams if key != "backend"}

before = settings()
from finger_pin.exceptions import InputError
from finger_pin.views import plots
plots.plot_critical_friction("ub_stand_in")
print("matplotlib.pyplot" in sys.modules, "tkinter" in sys.modules, settings() == before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False", "True"]


def test_what_a_user_has_set_for_figures_is_above_the_style_and_sizes_follow_it():
    own = {"font.size": 7.0, "lines.linewidth": 3.0, "axes.prop_cycle": matplotlib.cycler(color=["#123456", "#abcdef"])}
    with matplotlib.rc_context(own | {"figure.figsize": (4.0, 3.0), "axes.grid": False, "text.color": "#ff0000"}):
        figure = plots.plot_fig6(synthetic())
    assert figure.get_figwidth() == 4.0
    angles = figure.axes[0]
    assert angles.yaxis.label.get_size() == 7.0
    joints = ["#123456", "#abcdef", "#123456", "#abcdef"]
    assert [line.get_color() for line in angles.lines] == [*joints, *4 * ["#ff0000"]]
    assert angles.lines[0].get_linewidth() == 3.0
    (delivered, planned) = figure.axes[2].lines
    assert (delivered.get_color(), planned.get_color()) == ("#123456", "#ff0000")
    # What is not the user's is the style's.
    assert not angles.spines["top"].get_visible()


def nothing_overlaps(figure):
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    boxes += [legend.get_window_extent() for part in figure.findobj(SubFigure) for legend in part.legends]
    boxes += [figure._suptitle.get_window_extent()] if figure.get_suptitle() else []
    for box in boxes:
        assert figure.bbox.padded(1.0).count_contains([box.min, box.max]) == 2
    for first, second in itertools.combinations(boxes, 2):
        shared = Bbox.intersection(first, second)
        assert shared is None or min(shared.width, shared.height) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("width", "titles"), [("column", True), ("column", False), ("page", True)])
@pytest.mark.parametrize("draw", [plots.plot_fig6, plots.plot_losses, plots.plot_energy])
def test_nothing_overlaps_and_nothing_is_cut_off_at_any_width_and_after_enlarging(draw, width, titles):
    figure = draw(synthetic(), width=width, titles=titles)
    assert figure.get_figwidth() == {"column": 3.5, "page": 7.16}[width]
    assert titles or not any(axes.get_title(loc="left") for axes in figure.axes)
    for factor in (1.0, 1.4):
        figure.set_size_inches(factor * figure.get_size_inches())
        nothing_overlaps(figure)


def touched(**options):
    """A figure of contacts and objects with long names."""
    time, names = np.linspace(0.0, 1.0, 11), [f"middle.abduction-cylinder.{index}" for index in range(4)]
    force = np.outer(np.sin(np.pi * time), np.arange(1.0, 5.0))
    signals = {"normal_force": force, "friction": 0.4 * force, "level": 0.8 * force, "slip": 0.0 * force}
    data = {f"contact_{name}": (("time", "contact"), values) for name, values in signals.items()}
    data["object_position"] = ("time", "object", "axis"), np.random.default_rng(0).normal(size=(11, 2, 3))
    coordinates = {"time": time, "contact": names, "object": ["marble", "cylinder"], "axis": list("xyz")}
    return plots.plot_contact(xr.Dataset(data, coordinates), **options)


def swept(**options):
    """A figure of the metrics whose names are longest."""
    metrics = sorted(fp.studies.METRICS.values(), key=lambda metric: len(metric.long_name))[-4:]
    data = {
        m.name: ("controller.gain", 0.1 * np.arange(3.0), {"units": "N", "long_name": m.long_name}) for m in metrics
    }
    data |= {"status": ("controller.gain", ["done"] * 3), "reason": ("controller.gain", [""] * 3)}
    return plots.plot_sweep(xr.Dataset(data, {"controller.gain": [1.0, 2.0, 3.0]}), **options)


def identified(**options):
    """A figure of two signals, one over time."""
    time = np.tile(np.arange(5.0), 2)
    data = {name: ("reading", np.sin(time)) for name in ("measured", "residual")}
    data |= {"applied": ("reading", np.full(10, np.nan)), "instant": ("reading", time)}
    data |= {"signal_index": ("reading", np.repeat([0, 1], 5)), "signal_steady": ("signal", [True, False])}
    data |= {"signal_units": ("signal", ["N", "rad"]), "noise": ("signal", [0.1, 0.2])}
    names = ["pull.tendon_tension.flexor_profundus", "swing.joint_position.medial"]
    return plots.plot_identification(xr.Dataset(data, {"signal": names}), **options)


def compared(**options):
    labels = ("as it is, with all frictions", "without the friction of the tendons")
    return plots.compare(synthetic(), synthetic(seed=1), labels, **options)


def mapped(**options):
    bent = fp.load_finger("ub_stand_in", {"finger.tendons.T5.crossings.distal.bends": True})
    return plots.plot_self_locking_map(self_locking_map(fp.Finger(bent), samples=3), **options)


def sensitivity(**options):
    finger = fp.Finger(fp.load_finger("ub_stand_in"))
    return plots.plot_radius_sensitivity(finger, (0.1, 0.5, 0.6, 0.42), (0.3, 0.2, 0.8), **options)


def critical(**options):
    return plots.plot_critical_friction("ub_stand_in", **options)


# Two panels of a sweep stand side by side from 5.71 in on, and there as close to each other as ever.
@pytest.mark.slow
@pytest.mark.parametrize("width", ["column", 5.75])
@pytest.mark.parametrize("draw", [touched, swept, identified, compared, mapped, sensitivity, critical])
def test_long_names_are_broken_before_they_meet_or_leave_the_figure(draw, width):
    nothing_overlaps(draw(width=width))


def test_a_width_that_is_none_is_refused():
    with pytest.raises(InputError, match="'column' or 'page'"):
        plots.plot_fig6(synthetic(), width="narrow")


@pytest.mark.slow
def test_figures_are_written_in_the_format_that_was_asked_for(tmp_path):
    beginnings = {"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}
    for name, begins in beginnings.items():
        (path,) = plots.draw_all(synthetic(samples=5), tmp_path, ["energy"], format=name)
        assert path.name == f"energy.{name}" and path.read_bytes().startswith(begins)
    with matplotlib.rc_context({"savefig.format": "svg"}):
        assert plots.draw_all(synthetic(samples=5), tmp_path, ["energy"]) == [tmp_path / "energy.svg"]
    with pytest.raises(InputError, match="must be png, pdf, svg"):
        plots.draw_all(synthetic(samples=5), tmp_path, format="gif")


@pytest.mark.slow
def test_a_notebook_shows_a_figure_though_it_belongs_to_no_window():
    assert plot_friction_law()._repr_png_().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_png_is_drawn_once_and_the_figure_keeps_its_layout(tmp_path, monkeypatch):
    figure = plots.plot_energy(synthetic(samples=5))
    line, engine, drawn = figure.axes[0].lines[0], figure.get_layout_engine(), []
    monkeypatch.setattr(line, "draw", drawn.append)
    plots.save_figure(figure, tmp_path / "energy.png")
    assert len(drawn) == 1 and figure.get_layout_engine() is engine
