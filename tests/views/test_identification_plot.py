"""The figure of an identification, from made-up readings."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text

from finger_pin.exceptions import InputError
from finger_pin.views.plots.identification import plot_identification, plot_profiles


@pytest.mark.parametrize("sides", [(1.0,), (1.0, -1.0)], ids=["one way", "to and fro"])
def test_what_is_computed_of_steady_readings_is_a_curve_only_where_every_load_has_one_value(sides):
    load, side = (each.ravel() for each in np.meshgrid([9.0, 3.0, 6.0, 3.0], sides))
    computed = load * np.exp(-0.2 * side)
    residual = 0.01 * np.arange(load.size)
    of_reading = {"measured": computed + residual, "residual": residual, "applied": load, "instant": 0.0 * load}
    data = {name: ("reading", values) for name, values in of_reading.items()}
    data["signal_index"] = "reading", np.zeros(load.size, dtype=int)
    data |= {"signal_steady": ("signal", [True]), "signal_units": ("signal", ["N"]), "noise": ("signal", [0.01])}
    met = plot_identification(xr.Dataset(data, {"signal": ["pull.tendon_tension.T1"]})).axes[0]
    drawn = next(line for line in met.lines if line.get_label() == "computed")
    assert (drawn.get_linestyle() == "None") == (len(sides) > 1)
    x, y = drawn.get_data()
    np.testing.assert_allclose(sorted(zip(x, y, strict=True)), sorted(zip(load, computed, strict=True)))
    assert len(sides) > 1 or (np.diff(x) >= 0.0).all()


def test_parameters_without_a_profile_have_no_panel():
    """Of two parameters one has three points, and of the other only the estimate is known."""
    value, rise = np.array([[0.1, 0.2, 0.3], [1.0, np.nan, np.nan]]), np.array([[4.0, 0.0, 4.0], [0.0, np.nan, np.nan]])
    data = {"profile_value": (("parameter", "point"), value), "profile_rise": (("parameter", "point"), rise)}
    data |= {name: ("parameter", [0.2, 1.0]) for name in ("estimate", "lower", "upper")}
    result = xr.Dataset(data | {"units": ("parameter", ["1", "N"])}, {"parameter": ["a.b", "c.d"]})
    said = [text.get_text() for text in plot_profiles(result).findobj(Text)]
    assert "a.b" in said and "c.d" not in said
    with pytest.raises(InputError, match="has no profiles"):
        plot_profiles(result.isel(parameter=[1]))
