"""The figure of the energy account, from made-up results of fingers of several sizes."""

import numpy as np
import pytest
from made_up import LOST, SIZES, STORED, assert_shows, booked, columns, lines, synthetic
from matplotlib.collections import PolyCollection

from finger_pin.views import plots


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES.keys())
def test_energy_shows_what_is_stored_supplied_and_lost(size):
    result = synthetic(*size)
    left, (balance, residual) = columns(plots.plot_energy(result))
    time = result["time"].values
    shown = [name for name in STORED if np.any(result[f"energy_{name}"])]
    assert "limiter" not in shown and len(left) == len(shown)
    for axes, name in zip(left, shown, strict=True):
        assert_shows(axes.get_lines()[0], time, 1e3 * result[f"energy_{name}"].values)
    supplied = result["energy_exchanged_actuators"].values
    assert_shows(lines(balance)["supplied"], time, 1e3 * supplied)
    # Every loss lies on those before it; what was put into store is on top, and ends where the supplied energy does.
    areas = {each.get_label(): each for each in balance.collections if isinstance(each, PolyCollection)}
    level = np.cumsum([result[f"energy_exchanged_{name}"].values[-1] for name in LOST if name != "slack"])
    # Where less is supplied than lost, the rest comes from the store.
    x, y = areas.pop("taken from store").get_paths()[0].vertices.T
    least = np.argmin(result[[f"energy_{name}" for name in STORED]].to_array().sum("variable").values)
    assert y[x == time[least]].min() == pytest.approx(1e3 * supplied[least])
    assert len(areas) == len(level) + 1
    for area, height in zip(areas.values(), [*level, max(level[-1], supplied[-1])], strict=True):
        x, y = area.get_paths()[0].vertices.T
        assert np.isclose(y[x == time[-1]], 1e3 * height).any()
    assert "slack" not in areas and list(areas)[-1] == "put into store"
    assert residual.get_yscale() == "log"
    stored = result[[f"energy_{name}" for name in STORED]].to_array().sum("variable").values
    came_in = np.max(np.abs(supplied) + np.maximum(stored[0] - stored, 0.0))
    worst = np.abs(result["energy_residual"].values).max() / came_in
    assert residual.get_lines()[0].get_ydata().max() == pytest.approx(worst)


def test_what_rows_of_ones_own_store_lose_and_supply_is_in_the_account():
    result, bare = synthetic(), synthetic()
    own = 1e-2 * np.linspace(0.0, 1.0, result.sizes["time"])
    result["energy_band"] = booked(own, "stored", "band")
    result["energy_exchanged_band_damping"] = booked(own, "lost", "band damping")
    result["energy_exchanged_band_pump"] = booked(2.0 * own, "supplied", "band pump")
    left, (balance, _) = columns(plots.plot_energy(result))
    assert_shows(
        next(axes for axes in left if "band" in axes.get_ylabel()).get_lines()[0], result.time.values, 1e3 * own
    )
    assert "band damping" in [each.get_label() for each in balance.collections]
    _, (before, _) = columns(plots.plot_energy(bare))
    added = lines(balance)["supplied"].get_ydata()[-1] - lines(before)["supplied"].get_ydata()[-1]
    assert added == pytest.approx(2e3 * own[-1])


def test_what_is_unexplained_of_things_that_only_fall_is_a_part_of_what_they_took_from_store():
    result = synthetic()
    share = np.linspace(0.0, 1.0, result.sizes["time"])
    for name in result.data_vars:
        if result[name].attrs.get("account"):
            result[name][:] = 0.0
    result["energy_gravity"][:] = 0.05 * (1.0 - share)
    result["energy_exchanged_joint_coulomb"][:] = 0.05 * share
    result["energy_exchanged_actuators"][:] = 1e-5 * share
    result["energy_residual"][:] = 1e-8 * share
    _, (_, residual) = columns(plots.plot_energy(result))
    assert residual.get_lines()[0].get_ydata().max() == pytest.approx(1e-8 / 0.05001)
