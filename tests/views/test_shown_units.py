"""Units of figures: angles in degrees, energies with a prefix, and no power of ten on a panel's title."""

import numpy as np
import pytest
import xarray as xr
from made_up import lines, synthetic
from matplotlib.text import Text

import finger_pin as fp
from finger_pin.views import plots
from finger_pin.views.plots.identification import plot_identification
from finger_pin.views.shown_units import prefixed

# Half a turn and less, rad, and what they are in degrees.
ANGLES, DEGREES = np.pi * np.array([1.0, 0.5, 0.25]), [180.0, 90.0, 45.0]
TRACKING = {"units": "rad", "long_name": "tracking error"}


def swept():
    status = ("offset", ["done"] * 3)
    data = {"error": ("offset", ANGLES, TRACKING), "status": status, "reason": ("offset", [""] * 3)}
    return plots.plot_sweep(xr.Dataset(data, {"offset": ("offset", ANGLES, {"units": "rad"})}))


def searched():
    data = {"error": ("sample", ANGLES, TRACKING), "front": ("sample", [0, 0, 1])}
    data |= {"feasible": ("sample", [True] * 3), "status": ("sample", ["done"] * 3)}
    return plots.plot_pareto(xr.Dataset(data, attrs={"minimise": "error", "maximise": ""}))


def identified():
    of_reading = {"measured": ANGLES, "residual": np.zeros(3), "applied": np.full(3, np.nan), "instant": np.arange(3.0)}
    data = {name: ("reading", values) for name, values in of_reading.items()}
    data |= {"signal_index": ("reading", [0, 0, 0]), "signal_steady": ("signal", [True])}
    data |= {"signal_units": ("signal", ["rad"]), "noise": ("signal", [np.pi / 180.0])}
    return plot_identification(xr.Dataset(data, {"signal": ["swing.joint_position.medial"]}))


def checked():
    time = np.arange(3.0)
    attrs = {"convergence_limit": np.pi, "convergence_parting_time": np.inf, "convergence_rtol": 1e-7}
    difference = xr.Dataset({"convergence_difference": (("time", "joint"), ANGLES[:, None])}, {"time": time}, attrs)
    result = synthetic(1, 1, 0, samples=3).assign_coords(time=time)
    return plots.plot_convergence(result.merge(difference).assign_attrs(attrs))


def moved():
    hand = fp.simulate(fp.load_scenario("underactuated", {"simulation.duration": 0.002}))
    angles = np.stack([np.interp(np.arange(hand.sizes["time"]), np.arange(3.0), ANGLES)] * hand.sizes["joint"], axis=-1)
    return plots.plot_hand_motion(hand.assign(joint_position=(("time", "joint"), angles)))


@pytest.mark.parametrize("draw", [swept, searched, checked, moved])
def test_angles_are_drawn_in_degrees_and_no_text_says_rad(draw):
    figure = draw()
    drawn = [line.get_ydata() for axes in figure.axes for line in axes.lines]
    assert any(len(values) >= 3 and np.allclose(sorted(values[:3]), sorted(DEGREES)) for values in drawn)
    said = [text.get_text() for text in figure.findobj(Text)]
    assert any("°" in text for text in said)
    assert not [text for text in said if "rad" in text.replace("N m/rad", "")]


def test_an_identification_is_drawn_in_the_units_of_its_tables_and_its_bench():
    figure = identified()
    assert any(np.array_equal(line.get_ydata(), ANGLES) for line in figure.axes[0].lines)
    said = [text.get_text() for text in figure.findobj(Text)]
    assert "(rad)" in said and not [text for text in said if "°" in text]


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-7, 1e7])
@pytest.mark.parametrize("draw", [plots.plot_fig6, plots.plot_losses, plots.plot_energy])
def test_no_power_of_ten_stands_on_a_title_however_large_the_numbers(draw, factor):
    result = synthetic(samples=50)
    figure = draw(
        xr.Dataset({name: factor * each for name, each in result.items()}, attrs=result.attrs).pipe(booked, result)
    )
    figure.draw_without_rendering()
    assert {axis.get_offset_text().get_text() for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)} == {""}


def booked(scaled, result):
    """Return scaled variables with the attributes of those that they come from."""
    return scaled.assign({name: each.assign_attrs(result[name].attrs) for name, each in scaled.items()})


@pytest.mark.parametrize(
    "largest, unit", [(0.0, "mJ"), (2e-5, "µJ"), (0.5, "mJ"), (1.0, "J"), (4e4, "kJ"), (1e12, "MJ")]
)
def test_energies_have_the_prefix_that_makes_them_between_one_and_a_thousand(largest, unit):
    factor, shown = prefixed(np.array([0.1 * largest, -largest]), "J")
    assert shown.replace("\N{MICRO SIGN}", "µ") == unit
    assert largest in (0.0, 1e12) or 1.0 <= factor * largest < 1000.0


def test_strips_of_energies_are_in_the_units_of_their_labels():
    result = synthetic(samples=50)
    result["energy_kinetic"][:] = np.linspace(0.0, 5e-5, 50)
    strip = next(axes for axes in plots.plot_energy(result).axes if axes.get_ylabel().startswith("kinetic"))
    assert strip.get_ylabel() == "kinetic (µJ)".replace("µ", "\N{MICRO SIGN}")
    assert next(iter(lines(strip).values())).get_ydata().max() == pytest.approx(50.0)
