"""Made-up results of fingers of several sizes, and readers of figures of them."""

import numpy as np
import pytest
import xarray as xr

import finger_pin as fp
from finger_pin.simulation.frames import scene_metadata

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


def booked(values, kind, label):
    """An energy over time as it stands in a result's account."""
    return "time", values, {"units": "J", "account": kind, "label": label}


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
        for name in (
            "joint_position",
            "joint_reference",
            "tracking_error",
            "joint_torque_command",
            "joint_torque",
            "joint_friction",
        )
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
        variables[f"energy_{name}"] = booked(values, "stored", name)
        total = total + values - values[0]
    for name in LOST:
        values = 0.0 * total if name == "slack" else 1e-3 * np.cumsum(random.random(samples)) / samples
        variables[f"energy_exchanged_{name}"] = booked(values, "lost", name)
        total = total + values
    variables["energy_exchanged_actuators"] = booked(total, "supplied", "actuators")
    variables["energy_exchanged_fingertip"] = booked(0.0 * total, "supplied", "force")
    variables["energy_residual"] = ("time", 1e-12 * noise(samples))
    names = [f"T{index + 1}" for index in range(tendons)]
    coordinates = {
        "time": np.arange(samples) * 1e-3,
        "joint": [f"joint_{index}" for index in range(joints)],
        "tendon": names,
    }
    if passive > 1:
        coordinates["passive_tendon"] = names[actuated:]
    return xr.Dataset(variables, coordinates, scene_metadata(fp.load_scenario("reversals")))


SIZES = {"paper": (4, 4, 1), "planar": (2, 3, 0), "two passive": (4, 4, 2), "many": (9, 6, 3)}


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def columns(figure):
    """Panels of the first part of a figure, and those of the others, each from the top."""
    panels = figure.axes
    left = [axes for axes in panels if axes.get_figure(root=False) is panels[0].get_figure(root=False)]
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
