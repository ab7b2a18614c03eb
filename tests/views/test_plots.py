"""Figures: their lines against the Dataset and hand-written formulas, for fingers of several sizes."""

import numpy as np
import pytest
from made_up import SIZES, assert_shows, columns, lines, synthetic
from matplotlib.image import imread
from paper.plot_friction_law import plot_friction_law

import finger_pin as fp
from finger_pin.exceptions import InputError
from finger_pin.views import plots
from finger_pin.views.plots.figure_files import figures_by_name
from finger_pin.views.plots.hands import plot_hand_motion
from finger_pin.views.plots.lines import BINS, extremes
from finger_pin.views.plots.panels import labelled

A1, A2, A3, A4 = 20.2e-3, 45.0e-3, 29.9e-3, 21.8e-3
UNITS = ("(°)", "(N)", "(mN m)", "(mJ)", "(\N{MICRO SIGN}J)", "(J)", "(s)", "(mm)", "(mm/s)", "/ intake")


@pytest.fixture(scope="module", params=SIZES.values(), ids=SIZES.keys())
def result(request):
    return synthetic(*request.param)


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
    figure = plot_friction_law()
    top, bottom = figure.axes
    kinetic = 0.10
    cases = [(top, label, float(label) * kinetic, 1e-3) for label in ("1.1", "1.4", "1.7", "2")]
    cases += [(bottom, f"{omega:g} m/s", 0.20, omega) for omega in (1e-4, 1e-3, 1e-2, 1.0)]
    for axes, label, static, stribeck in cases:
        velocity, force = lines(axes)[label].get_data()
        speed = np.abs(velocity) * 1e-3
        expected = 10.0 * (kinetic + (static - kinetic) * np.exp(-speed / stribeck))
        np.testing.assert_allclose(np.abs(force), expected, rtol=1e-12)
        np.testing.assert_array_equal(np.sign(force), np.sign(velocity))
        # From rest, where the force is F^n M^c, to the edge of the panel.
        assert force.max() == pytest.approx(10.0 * static, rel=1e-3)
        assert velocity[-1] == pytest.approx(5.0)
    assert len(top.get_lines()) == len(bottom.get_lines()) == 4


@pytest.mark.slow
def test_fig6_shows_angles_over_references_and_errors_in_degrees(result):
    (angles, errors), _ = columns(plots.plot_fig6(result))
    time, count = result["time"].values, result.sizes["joint"]
    shown = {
        "joint_position": angles.get_lines()[:count],
        "joint_reference": angles.get_lines()[count:],
        "tracking_error": errors.get_lines(),
    }
    for variable, drawn in shown.items():
        assert len(drawn) == count
        for name, line in zip(result["joint"].values, drawn, strict=True):
            assert_shows(line, time, result[variable].sel(joint=name).values * 180.0 / np.pi)
            assert variable == "joint_reference" or line.get_label() == name


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


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("draw", [plots.plot_fig6, plots.plot_losses, plots.plot_energy])
def test_every_panel_of_a_result_names_its_unit(draw, result):
    figure = draw(result)
    for axes in figure.axes:
        assert any(unit in axes.get_ylabel().replace("\N{NO-BREAK SPACE}", " ") for unit in UNITS), axes.get_ylabel()
    assert sum(axes.get_xlabel() == "time (s)" for axes in figure.axes) == 2


def test_labels_never_break_a_unit():
    assert labelled("medial", "mN m") == "medial (mN\N{NO-BREAK SPACE}m)"
    assert labelled("flexor_profundus", "mN m") == "flexor_profundus\n(mN\N{NO-BREAK SPACE}m)"


def test_long_names_break_at_dots_and_hyphens_so_that_labels_of_strips_do_not_meet():
    lines = labelled("middle.abduction-cylinder.0", "N").split("\n")
    assert "".join(lines) == "middle.abduction-cylinder.0(N)"
    assert max(map(len, lines)) <= 13


def test_a_tendon_that_is_wound_has_no_planned_tension():
    wound = fp.plot_fig6(fp.simulate(fp.load_scenario("wound", {"simulation.duration": 0.4})))
    assert {line.get_label() for line in wound.axes[-1].get_lines()} == {"delivered"}


def test_positions_and_forces_of_a_hand_stand_in_panels_by_their_units():
    hand = fp.simulate(fp.load_scenario("underactuated", {"simulation.duration": 0.05}))
    shown = {axes.get_ylabel(): [line.get_label() for line in axes.get_lines()] for axes in plot_hand_motion(hand).axes}
    assert shown["position (m)"] == ["block"]
    assert shown["angle (°)"] == ["left_proximal", "left_distal", "right_proximal", "right_distal"]
    assert shown["tension (N)"] == ["trunk"] and shown["cord tension (N)"] == ["cord"]


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 2])
def test_the_shortest_results_can_be_drawn(samples, tmp_path):
    still = synthetic(samples=5).isel(time=slice(samples)) * 0.0
    assert all(path.exists() for path in plots.draw_all(still, tmp_path))


@pytest.mark.parametrize("draw", figures_by_name(synthetic(*SIZES["paper"])).values())
def test_a_result_without_time_is_refused_in_one_line(draw, result):
    for timeless in (result.drop_vars("time"), result.isel(time=-1)):
        with pytest.raises(InputError, match=r"^result\.time: is missing; give a result of simulate"):
            draw(timeless)


@pytest.mark.slow
def test_draw_all_writes_whole_pictures_of_a_size_for_the_screen(tmp_path):
    folder = tmp_path / "new" / "figures"
    paths = plots.draw_all(synthetic(), folder)
    assert {path.name for path in paths} == {"fig6.png", "losses.png", "energy.png"}
    assert sorted(folder.iterdir()) == sorted(paths)
    for path in paths:
        picture = imread(path)
        assert 1200 < picture.shape[1] < 1800
        # Nothing is cut off: the margin is blank.
        assert (
            np.all(picture[:2] == 1.0)
            and np.all(picture[-2:] == 1.0)
            and np.all(picture[:, :2] == 1.0)
            and np.all(picture[:, -2:] == 1.0)
        )


def test_a_figure_that_a_result_does_not_have_is_named_and_nothing_is_drawn(tmp_path):
    with pytest.raises(InputError, match='names = "fig7": the figures of this result are fig6, losses, energy'):
        plots.draw_all(synthetic(), tmp_path / "figures", ["fig6", "fig7"])
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_an_earlier_picture_survives_a_figure_that_cannot_be_drawn(tmp_path):
    path = plots.save_figure(plot_friction_law(), tmp_path / "figure.png")
    before = path.read_bytes()
    broken = plot_friction_law()
    broken.axes[0].set_title("$unbalanced_{$")
    with pytest.raises(ValueError):
        plots.save_figure(broken, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
def test_two_results_lie_over_each_other_each_on_its_own_time(result):
    other = 2.0 * result.isel(time=slice(0, 1000, 2))
    angles, rest = columns(plots.compare(result, other, ("one", "two")))
    time = result["time"].values
    for axes, name in zip(angles, result["joint"].values, strict=True):
        drawn = lines(axes)
        assert_shows(drawn["one"], time, np.rad2deg(result["joint_position"].sel(joint=name).values))
        assert_shows(drawn["two"], other["time"].values, np.rad2deg(other["joint_position"].sel(joint=name).values))
        assert axes.get_xlim() == (time[0], time[-1])
    for axes, name in zip(rest[-result.sizes["tendon"] :], result["tendon"].values, strict=True):
        assert_shows(lines(axes)["one"], time, result["tendon_tension"].sel(tendon=name).values)


def test_results_of_fingers_with_other_joints_are_not_compared():
    with pytest.raises(InputError, match="joint_0"):
        plots.compare(synthetic(4), synthetic(2, 3, 0))


def test_a_joint_that_no_torque_turns_but_rounding_shows_a_flat_line():
    result = synthetic()
    for name in ("joint_torque_command", "joint_torque", "joint_friction"):
        result[name][:, 0] *= 1e-18
    panel = next(
        axes for axes in plots.plot_losses(result).axes if axes.get_ylabel().startswith(str(result.joint[0].item()))
    )
    assert panel.get_ylim() == (-1.0, 1.0)


def test_an_angle_that_lies_on_another_one_is_dashed_so_that_both_are_seen():
    result = synthetic()
    result["joint_position"][:, 2] = result["joint_position"][:, 1]
    angles = columns(plots.plot_fig6(result))[0][0]
    assert [line.is_dashed() for line in angles.get_lines()[:4]] == [False, False, True, False]


def test_of_constant_references_the_angles_are_shown():
    result = synthetic()
    result["joint_reference"][:] = 0.2
    axes = columns(plots.plot_fig6(result))[0][0]
    assert "angle" in axes.get_ylabel()
    assert_shows(axes.get_lines()[0], result["time"].values, np.rad2deg(result["joint_position"].values[:, 0]))


def test_a_spike_of_one_sample_leaves_the_panel_of_a_torque():
    result = synthetic()
    time = result["time"].values
    for name in ("joint_torque_command", "joint_torque", "joint_friction"):
        result[name][:, 0] = 1e-3 * np.sin(2.0 * np.pi * time / time[-1])
    result["joint_torque_command"][0, 0] = 1.0
    low, high = columns(plots.plot_losses(result))[1][0].get_ylim()
    # A tenth of the range beyond it: +-1.2 mN m.
    np.testing.assert_allclose((low, high), (-1.2, 1.2), rtol=0.01)
