"""What measures the observer: postures by lengths in closed form, rms, bands and delays by hand, and the command."""

import numpy as np
import pytest
import xarray as xr
from validate import validate
from validation import observer
from validation.observer import CASES, Case, Run

from finger_pin.commands.application import run_function

pytestmark = pytest.mark.slow


def test_postures_by_lengths_share_the_cord_as_springs_without_friction_do():
    """Of k theta = r f and f = K (r_s theta_m - sum r theta) along all joints."""
    radius, spring, stiffness = np.array([0.010, 0.008, 0.006]), np.array([0.08, 0.05, 0.03]), 6000.0 / 0.3
    angle = np.linspace(0.0, 2.8, 29)[:, None]
    tension = stiffness * 0.008 * angle / (1.0 + stiffness * np.sum(radius**2 / spring))
    rest = observer.by_lengths(observer.model(CASES["wound"]), angle)
    # Between angles of the motor what is linear is exact.
    np.testing.assert_allclose(rest["joint_position"], tension * radius / spring, atol=1e-9)
    np.testing.assert_allclose(rest["tendon_tension"], tension, atol=1e-6)
    np.testing.assert_allclose(rest["spool_tension"], tension, atol=1e-6)


def constant(value, half, touched=False):
    """Return estimates that are the same over 200 ms, with bands of a half width."""
    columns = {}
    for name in observer.QUANTITIES:
        for end, number in (("", value), ("_low", value - half), ("_high", value + half)):
            columns[name + end] = (("time", "part"), np.full((200, 2), number))
    columns["motor_position"] = ("time", "motor"), np.zeros((200, 1))
    columns["touched"] = "time", np.full(200, touched)
    return xr.Dataset(columns)


def test_a_line_has_rms_share_inside_and_band_of_known_errors(monkeypatch):
    truth = constant(1.0, 0.0)
    # One is off by 0.1, within its band of 1.5 deviations; the other by 0.3, beyond 0.2.
    runs = [
        Run(truth, constant(1.1, 0.294, touched=True), constant(2.0, 0.0)),
        Run(truth, constant(1.3, 0.2), constant(2.0, 0.0)),
    ]
    monkeypatch.setattr(observer, "SPREADS", (1.0,))
    monkeypatch.setattr(observer, "by_lengths", lambda _, angles: dict.fromkeys(observer.QUANTITIES, 1.5 + 0 * angles))
    line = observer.quantity_lines("wound", [runs])[0]
    error = np.sqrt((0.1**2 + 0.3**2) / 2.0)
    expected = [f"{error:.3f}", "0.500", "1.000", "50.0%", f"{0.247 / 1.96 / error:.2f}", "50.0%"]
    assert line.split()[-6:] == expected


def test_delays_are_counted_from_the_ends_of_a_force():
    time = np.arange(1, 2001) * 1e-3

    def told(*spans):
        touched = np.zeros(2000, dtype=bool)
        for begin, end in spans:
            touched |= (time >= begin) & (time < end)
        return xr.Dataset({"touched": ("time", touched)}, {"time": time})

    np.testing.assert_allclose(observer.delays(told((1.07, 1.45)), 1.0, 1.4), (0.07, 1.0, 0.05), atol=2e-3)
    np.testing.assert_allclose(observer.delays(told((1.07, 1.2)), 1.0, 1.4), (0.07, 0.0, np.nan), atol=2e-3)
    np.testing.assert_allclose(observer.delays(told((0.2, 0.5), (1.5, 1.6)), 1.0, 1.4), (np.inf, 0.0, np.nan))


@pytest.fixture
def run(capsys):
    def run(*arguments):
        code = run_function(validate, [*arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


def test_the_command_prints_a_line_by_spread_and_quantity(run, monkeypatch):
    monkeypatch.setitem(CASES, "wound", Case("wound", {"simulation.duration": 0.4}))
    code, out, err = run("--observer", "wound", "--seeds", "1")
    assert (code, err) == (0, "")
    head, *lines, _ = out.splitlines()
    assert head.split()[:3] == ["finger", "seeds", "part"]
    parts = [line.split()[1:4] for line in lines]
    assert parts == [["1", f"{spread:g}", name] for spread in (1.0, 0.3) for name in ("angles,", "tendons,", "spools,")]


def test_a_case_that_does_not_exist_is_named_with_the_nearest(run):
    code, _, err = run("--observer", "wind")
    assert code == 2
    assert "did you mean wound?" in err
