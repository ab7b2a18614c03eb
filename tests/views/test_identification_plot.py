"""The figure of an identification, from made-up readings."""

import numpy as np
import pytest
import xarray as xr

from finger_pin.views.plots.identification import plot_identification


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
