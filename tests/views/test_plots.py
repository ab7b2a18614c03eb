"""Figures: their lines against the Dataset and hand-written formulas, for fingers of several sizes."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from finger_pin.description.loading import load_finger
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.views import plots
from finger_pin.views.plots.lines import BINS, extremes
from finger_pin.views.plots.panels import labelled
from finger_pin.views.plots.reach import fingertip_surface, flexion_section
from finger_pin.views.plots.style import BLUE, COLOURS, GREEN, PURPLE, VERMILLION

A1, A2, A3, A4 = 20.2e-3, 45.0e-3, 29.9e-3, 21.8e-3
STORED = ("kinetic", "gravity", "passive_tendon", "limiter", "joint_springs", "tendon_bristles", "joint_bristles")
LOST = (
    "tendon_coulomb",
    "tendon_viscous",
    "tendon_micro_damping",
    "joint_coulomb",
    "joint_viscous",
    "joint_micro_damping",
    "limiter",
    "joint_springs",
    "slack",
)
UNITS = ("(°)", "(N)", "(mN m)", "(mJ)", "(s)", "(mm)", "(mm/s)", "supplied")


def synthetic(joints=4, actuated=4, passive=1, samples=2001, seed=0):
    """A Dataset with the variables and dimensions of a result, of made-up numbers with spikes."""
    random = np.random.default_rng(seed)
    tendons = actuated + passive

    def noise(*shape):
        values = random.normal(size=shape)
        values.reshape(samples, -1)[random.integers(0, samples, 3)] *= 30.0
        return values

    variables = {
        name: (("time", "joint"), 0.01 * noise(samples, joints))
        for name in ("joint_reference", "tracking_error", "joint_torque_command", "joint_torque", "joint_friction")
    }
    for name in ("tendon_command", "tendon_tension"):
        variables[name] = (("time", "tendon"), 5.0 + noise(samples, tendons))
    if passive == 1:
        variables["passive_tension_proximal"] = ("time", 5.0 + noise(samples))
    elif passive:
        variables["passive_tension_proximal"] = (("time", "passive_tendon"), 5.0 + noise(samples, passive))
    total = np.zeros(samples)
    for name in STORED:
        values = 0.0 * total if name == "limiter" else 1e-3 * np.abs(noise(samples))
        variables[f"energy_{name}"] = ("time", values)
        total = total + values - values[0]
    for name in LOST:
        values = 0.0 * total if name == "slack" else 1e-3 * np.cumsum(random.random(samples)) / samples
        variables[f"energy_exchanged_{name}"] = ("time", values)
        total = total + values
    variables["energy_exchanged_actuators"] = ("time", total)
    variables["energy_exchanged_fingertip"] = ("time", 0.0 * total)
    variables["energy_residual"] = ("time", 1e-12 * noise(samples))
    names = [f"T{index + 1}" for index in range(tendons)]
    coordinates = {
        "time": np.arange(samples) * 1e-3,
        "joint": [f"joint_{index}" for index in range(joints)],
        "tendon": names,
    }
    if passive > 1:
        coordinates["passive_tendon"] = names[actuated:]
    return xr.Dataset(variables, coordinates)


SIZES = {
    "paper": (4, 4, 1),
    "planar": (2, 3, 0),
    "two passive": (4, 4, 2),
    "many": (9, 6, 3),
}


@pytest.fixture(scope="module", params=SIZES.values(), ids=SIZES.keys())
def result(request):
    return synthetic(*request.param)


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def columns(figure):
    """Panels of the left and the right column of a figure, each from the top."""
    panels = sorted(figure.axes, key=lambda axes: (round(axes.get_position().x0, 3), -axes.get_position().y0))
    first = round(panels[0].get_position().x0, 3)
    left = [axes for axes in panels if round(axes.get_position().x0, 3) == first]
    return left, panels[len(left) :]


def assert_shows(line, time, values):
    """Every point of the line is a sample, and the ends and extremes of every short window are among them."""
    x, y = line.get_data()
    kept = np.searchsorted(time, x)
    np.testing.assert_array_equal(time[kept], x)
    np.testing.assert_allclose(y, values[kept], rtol=1e-12)
    assert kept[0] == 0 and kept[-1] == len(time) - 1
    assert np.all(np.diff(kept) > 0)
    assert y.max() == pytest.approx(values.max(), rel=1e-12)
    assert y.min() == pytest.approx(values.min(), rel=1e-12)


@pytest.mark.parametrize("size", [1, 2, 7, 2 * BINS, 2 * BINS + 1, 5001, 8001, 20000])
@pytest.mark.parametrize("bins", [3, 50, BINS])
def test_thinning_keeps_the_extremes_of_every_bin(size, bins):
    values = np.random.default_rng(size).standard_cauchy(size)
    kept = extremes(values, bins)
    assert len(kept) <= max(2 * bins + 2, 1)
    assert kept[0] == 0 and kept[-1] == size - 1 and np.all(np.diff(kept) > 0)
    width = max(1, -(-size // bins))
    for start in range(0, size, width):
        inside = kept[(kept >= start) & (kept < start + width)]
        window = values[start : start + width]
        assert values[inside].max() == window.max() and values[inside].min() == window.min()


def test_thinning_keeps_a_spike_of_one_sample():
    values = np.zeros(100_000)
    values[54_321] = 1.0
    assert 54_321 in extremes(values)


def test_fig3_curves_are_the_law_written_out():
    figure = plots.plot_friction_law()
    top, bottom = figure.axes
    kinetic = 0.10
    cases = [(top, label, float(label) * kinetic, 0.010) for label in ("1", "1.5", "2", "3")]
    cases += [(bottom, f"{label} mm/s", 0.20, 1e-3 * label) for label in (2, 5, 10, 20)]
    for axes, label, static, stribeck in cases:
        velocity, force = lines(axes)[label].get_data()
        speed = np.abs(velocity) * 1e-3
        expected = 10.0 * (kinetic + (static - kinetic) * np.exp(-speed / stribeck))
        np.testing.assert_allclose(np.abs(force), expected, rtol=1e-12)
        np.testing.assert_array_equal(np.sign(force), np.sign(velocity))
        # From rest, where the force is F^n M^c, to the edge of the panel.
        assert force.max() == pytest.approx(10.0 * static, rel=1e-3)
        assert velocity[-1] == pytest.approx(50.0)
    assert len(top.get_lines()) == len(bottom.get_lines()) == 4


def test_fig6_shows_references_and_errors_in_degrees(result):
    (references, errors), _ = columns(plots.plot_fig6(result))
    time = result["time"].values
    for axes, variable in ((references, "joint_reference"), (errors, "tracking_error")):
        drawn = lines(axes)
        assert list(drawn) == list(result["joint"].values)
        for name, line in drawn.items():
            assert_shows(line, time, result[variable].sel(joint=name).values * 180.0 / np.pi)


def test_fig6_shows_planned_and_delivered_tension_and_both_sides_of_passive_tendons(result):
    _, panels = columns(plots.plot_fig6(result))
    time, count = result["time"].values, result.sizes["tendon"]
    passive = result.sizes.get("passive_tendon", int("passive_tension_proximal" in result))
    assert len(panels) == count
    for index, axes in enumerate(panels):
        assert axes.get_ylabel() == f"T{index + 1} (N)"
        solid, dashed, *dotted = axes.get_lines()
        assert solid.get_linestyle() == "-" and dashed.get_linestyle() == "--"
        assert_shows(solid, time, result["tendon_tension"].values[:, index])
        assert_shows(dashed, time, result["tendon_command"].values[:, index])
        assert len(dotted) == int(index >= count - passive)
        if dotted:
            assert dotted[0].get_linestyle() == ":"
            proximal = result["passive_tension_proximal"].values.reshape(len(time), -1)
            assert_shows(dotted[0], time, proximal[:, index - (count - passive)])


def test_losses_show_forces_and_torques_before_and_after_friction(result):
    left, right = columns(plots.plot_losses(result))
    time, count = result["time"].values, result.sizes["tendon"]
    assert len(left) == count and len(right) == result.sizes["joint"]
    passive = result.sizes.get("passive_tendon", int("passive_tension_proximal" in result))
    before = result["tendon_command"].values.copy()
    if passive:
        before[:, count - passive :] = result["passive_tension_proximal"].values.reshape(len(time), -1)
    for index, axes in enumerate(left):
        drawn = lines(axes)
        assert_shows(drawn["before"], time, before[:, index])
        assert_shows(drawn["after tendon friction"], time, result["tendon_tension"].values[:, index])
    for axes, name in zip(right, result["joint"].values, strict=True):
        drawn, joint = lines(axes), result.sel(joint=name)
        assert_shows(drawn["commanded"], time, 1e3 * joint["joint_torque_command"].values)
        assert_shows(drawn["of the tendons"], time, 1e3 * joint["joint_torque"].values)
        net = 1e3 * (joint["joint_torque"] - joint["joint_friction"]).values
        assert_shows(drawn["after joint friction"], time, net)


def test_energy_shows_what_is_stored_supplied_and_lost(result):
    left, (balance, residual) = columns(plots.plot_energy(result))
    time = result["time"].values
    shown = [name for name in STORED if np.any(result[f"energy_{name}"])]
    assert "limiter" not in shown and len(left) == len(shown)
    for axes, name in zip(left, shown, strict=True):
        assert_shows(axes.get_lines()[0], time, 1e3 * result[f"energy_{name}"].values)
    supplied = result["energy_exchanged_actuators"].values
    assert_shows(lines(balance)["supplied"], time, 1e3 * supplied)
    # Every loss lies on those before it. The made-up account closes, so the stored energy on top of them all ends where
    # the supplied energy does.
    areas = {each.get_label(): each for each in balance.collections if isinstance(each, PolyCollection)}
    level = np.cumsum([result[f"energy_exchanged_{name}"].values[-1] for name in LOST if name != "slack"])
    assert len(areas) == len(level) + 1
    for area, height in zip(areas.values(), [*level, supplied[-1]], strict=True):
        x, y = area.get_paths()[0].vertices.T
        assert np.isclose(y[x == time[-1]], 1e3 * height).any()
    assert "tensions cut at zero" not in areas and list(areas)[-1] == "change of stored energy"
    assert residual.get_yscale() == "log"
    worst = np.abs(result["energy_residual"].values).max() / np.abs(supplied).max()
    assert residual.get_lines()[0].get_ydata().max() == pytest.approx(worst)


@pytest.mark.parametrize("draw", [plots.plot_fig6, plots.plot_losses, plots.plot_energy])
def test_every_panel_of_a_result_names_its_unit(draw, result):
    figure = draw(result)
    for axes in figure.axes:
        assert any(unit in axes.get_ylabel().replace("\N{NO-BREAK SPACE}", " ") for unit in UNITS), axes.get_ylabel()
    assert sum(axes.get_xlabel() == "time (s)" for axes in figure.axes) == 2


def test_labels_never_break_a_unit():
    assert labelled("abduction", "mN m") == "abduction (mN\N{NO-BREAK SPACE}m)"
    assert labelled("flexor_profundus", "mN m") == "flexor_profundus\n(mN\N{NO-BREAK SPACE}m)"


@pytest.mark.parametrize("samples", [1, 2])
def test_the_shortest_results_can_be_drawn(samples, tmp_path):
    still = synthetic(samples=5).isel(time=slice(samples)) * 0.0
    assert all(path.exists() for path in plots.draw_all(still, tmp_path))


def test_draw_all_writes_whole_pictures_of_a_size_for_the_screen(tmp_path):
    folder = tmp_path / "new" / "figures"
    paths = plots.draw_all(synthetic(), folder)
    assert {path.name for path in paths} == {"fig6.png", "losses.png", "energy.png"}
    assert sorted(folder.iterdir()) == sorted(paths)
    for path in paths:
        picture = imread(path)
        assert 1200 < picture.shape[1] < 1800
        # Nothing is cut off: the margin is blank.
        assert np.all(picture[:2] == 1.0) and np.all(picture[-2:] == 1.0) and np.all(picture[:, :2] == 1.0)


def test_an_earlier_picture_survives_a_figure_that_cannot_be_drawn(tmp_path):
    path = plots.save_figure(plots.plot_friction_law(), tmp_path / "figure.png")
    before = path.read_bytes()
    broken = plots.plot_friction_law()
    broken.axes[0].set_title("$unbalanced_{$")
    with pytest.raises(ValueError):
        plots.save_figure(broken, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def equation_1(theta):
    """Fingertip of the paper's finger, written out."""
    t1, t2, t23, t234 = theta[0], theta[1], theta[1] + theta[2], theta[1] + theta[2] + theta[3]
    reach = A1 + A2 * np.cos(t2) + A3 * np.cos(t23) + A4 * np.cos(t234)
    return np.array([np.cos(t1) * reach, np.sin(t1) * reach, A2 * np.sin(t2) + A3 * np.sin(t23) + A4 * np.sin(t234)])


@pytest.fixture(scope="module")
def paper_surface():
    return fingertip_surface(Finger(load_finger("ub")), samples=31)


def test_workspace_extremes_are_those_of_equation_1(paper_surface):
    length = A1 + A2 + A3 + A4
    # The least x lies on the edge theta2 = 90 deg, where theta4 = 0.7 theta3 by (4).
    t3 = np.linspace(0.0, np.pi / 2, 100_001)
    least = (A1 - A3 * np.sin(t3) - A4 * np.sin(1.7 * t3)).min()
    expected = {
        0: (least, length),
        1: (-length * np.sin(np.deg2rad(10.0)), length * np.sin(np.deg2rad(10.0))),
        2: (0.0, A2 + A3 + A4),
    }
    for axis, (low, high) in expected.items():
        assert paper_surface[..., axis].min() == pytest.approx(low, abs=5e-5)
        assert paper_surface[..., axis].max() == pytest.approx(high, abs=1e-9)


def test_workspace_surface_bounds_all_that_the_finger_reaches(paper_surface):
    section = flexion_section(Finger(load_finger("ub"))).patches.reshape(-1, 3)
    radius = np.hypot(paper_surface[..., 0], paper_surface[..., 1]).ravel()
    height = paper_surface[..., 2].ravel()
    random = np.random.default_rng(5)
    for _ in range(100):
        t1, t2, t3 = random.uniform([-np.pi / 18, 0.0, 0.0], [np.pi / 18, np.pi / 2, np.pi / 2])
        tip = equation_1([t1, t2, t3, 0.7 * t3])
        assert np.linalg.norm(section - equation_1([0.0, t2, t3, 0.7 * t3]), axis=1).min() < 1.5e-3
        assert abs(np.arctan(tip[1] / tip[0])) <= np.deg2rad(10.0) + 1e-12
        assert np.hypot(tip[0], tip[1]) <= radius.max() and tip[2] <= height.max()


def test_the_section_lies_in_the_flexion_plane_and_obeys_equation_4():
    section = flexion_section(Finger(load_finger("ub")), samples=11)
    assert section.plane == (0, 2)
    assert section.patches.shape == (1, 11, 11, 3)
    angles = np.linspace(0.0, np.pi / 2, 11)
    for (i, t2), (j, t3) in itertools.product(enumerate(angles), enumerate(angles)):
        np.testing.assert_allclose(section.patches[0, i, j], equation_1([0.0, t2, t3, 0.7 * t3]), atol=1e-12)
    joints = [[0.0, 0.0, 0.0], [A1, 0.0, 0.0], [A1 + A2, 0.0, 0.0], [A1 + A2 + A3, 0.0, 0.0], equation_1(np.zeros(4))]
    np.testing.assert_allclose(section.poses[0], joints, atol=1e-12)


def test_a_driven_joint_that_would_leave_its_range_bounds_the_workspace():
    finger = Finger(load_finger("ub", {"finger.joints.distal.range": [0.0, 0.35]}))
    section = flexion_section(finger, samples=61)
    flexed = np.linspace(0.0, np.pi / 2, 61)
    outside = np.isnan(section.patches[0, ..., 0]).all(axis=0)
    np.testing.assert_array_equal(outside, 0.7 * flexed > 0.35 + 1e-9)


def test_the_workspace_of_a_planar_finger_lies_in_its_plane():
    finger = Finger(load_finger("planar"))
    section = flexion_section(finger, samples=21)
    assert section.plane == (0, 1)
    l1, l2 = (joint.link.length for joint in finger.description.joints.values())
    tips = section.patches.reshape(-1, 3)
    np.testing.assert_allclose(tips.max(axis=0), [l1 + l2, l1 + l2, 0.0], atol=1e-12)
    np.testing.assert_allclose(tips.min(axis=0), [-l2, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("name", ["ub", "planar"])
def test_fig2_prints_ranges_in_millimetres_and_accepts_finger_and_description(name, tmp_path):
    description = load_finger(name)
    for finger in (Finger(description), description):
        figure = plots.plot_workspace(finger)
        space, plane = figure.axes
        labels = [space.get_xlabel(), space.get_ylabel(), space.get_zlabel(), plane.get_xlabel(), plane.get_ylabel()]
        assert all(label.endswith("(mm)") for label in labels)
        texts = [text.get_text() for text in figure.texts]
        assert all("mm" in text for text in texts)
        assert all(("(4) imposed" in text) == (name == "ub") for text in texts)
    if name == "ub":
        assert "x: \N{MINUS SIGN}27.3 to 116.9 mm,   y: \N{MINUS SIGN}20.3 to 20.3 mm,   z: 0.0 to 96.7 mm" in texts[0]
    plots.save_figure(figure, tmp_path / "fig2.png")


def test_fig2_needs_links(network):
    with pytest.raises(InputError):
        plots.plot_workspace(network(("one",), {"T1": {"one": 5.0}, "T2": {"one": -5.0}}))


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


def run_python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_importing_the_package_is_light_and_figures_open_no_windows_and_leave_settings_alone():
    code = """
import sys
import finger_pin
print("matplotlib" in sys.modules)
import matplotlib

def settings():
    # Looking at the backend would choose one.
    return {key: matplotlib.rcParams[key] for key in matplotlib.rcParams if key != "backend"}

before = settings()
from finger_pin.views import plots
plots.plot_friction_law()
print("matplotlib.pyplot" in sys.modules, "tkinter" in sys.modules, settings() == before)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False", "False", "True"]
