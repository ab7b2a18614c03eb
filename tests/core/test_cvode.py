"""CVODE of SUNDIALS as another way to the same trajectory."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.stepping.solve_ivp import integrate

TIGHT = {"simulation.duration": 0.2, "simulation.rtol": 1e-8, "simulation.atol_scale": 1e-8}


def oscillate(time: float, x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -x[0]])


def test_an_oscillator_follows_its_closed_form_between_the_steps_too() -> None:
    found = integrate(oscillate, np.array([0.0, 1.0]), 6.0, method="CVODE", rtol=1e-9, atol=np.full(2, 1e-9))
    times = np.linspace(0.0, 6.0, 501)
    np.testing.assert_allclose(found.interpolate(times), np.stack([np.sin(times), np.cos(times)], axis=1), atol=1e-6)
    assert found.breakpoints[-1] == 6.0 and not found.failure


def test_a_stop_keeps_what_was_computed() -> None:
    seen: list[float] = []
    found = integrate(
        oscillate,
        np.array([0.0, 1.0]),
        6.0,
        method="CVODE",
        rtol=1e-6,
        atol=np.full(2, 1e-6),
        watch=lambda time, x: seen.append(time),
        stop=lambda: len(seen) == 20,
    )
    assert found.interrupted and len(found.breakpoints) == 21
    np.testing.assert_array_equal(found.breakpoints[1:], seen)


def test_a_simulation_with_cvode_agrees_with_the_compiled_method() -> None:
    expected = fp.simulate(fp.load_scenario("fig6", TIGHT))
    found = fp.simulate(fp.load_scenario("fig6", {**TIGHT, "simulation.method": "CVODE"}))
    assert found.method == "CVODE"
    np.testing.assert_allclose(found.joint_position, expected.joint_position, atol=1e-7)
    supplied = float(abs(found.energy_exchanged_actuators).max())
    assert float(abs(found.energy_residual).max()) < 1e-5 * supplied


def test_without_its_package_the_method_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(fp.InputError, match=r"simulation\.method = .*CVODE.*scikit-sundae"):
        fp.simulate(fp.load_scenario("fig6", {**TIGHT, "simulation.method": "CVODE"}))
