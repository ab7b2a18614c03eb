"""Progress bars: in a notebook by themselves where something takes long, on a terminal where a command asks."""

import re
import sys

import pytest

import finger_pin as fp
from finger_pin import progress
from finger_pin.commands.console import count_bar, progress_bar, runs_bar
from finger_pin.core.stepping import integrator
from finger_pin.exceptions import SlowRunWarning

SHORT = {"simulation.duration": 0.01}


@pytest.fixture
def notebook(kernel, monkeypatch):
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)


def simulated(text, total):
    return [float(each) for each in re.findall(rf"([\d.]+) of {total} s simulated", text)]


def test_a_notebook_shows_how_far_a_simulation_and_a_study_are(notebook, capsys):
    fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 1.5}))
    values = simulated(capsys.readouterr().err, "1.5")
    assert values == sorted(values) and (values[0], values[-1]) == (0.0, 1.5)
    gains = [1.0, 1.2, 1.4, 1.6, 1.8, 2.0]
    fp.simulate_many([fp.load_scenario("reversals", SHORT | {"controller.gain": gain}) for gain in gains])
    assert "6/6" in capsys.readouterr().err


def test_a_notebook_shows_nothing_of_what_is_over_within_its_patience_and_a_script_nothing_at_all(
    notebook, capsys, monkeypatch
):
    monkeypatch.setattr(progress, "_PATIENCE", 1e6)
    fp.simulate(fp.load_scenario("reversals", SHORT))
    monkeypatch.delitem(sys.modules, "IPython")
    fp.simulate(fp.load_scenario("reversals", SHORT))
    assert progress.notebook_bar("s", 1.0) is None and capsys.readouterr() == ("", "")


def test_a_slow_run_says_its_steps_a_second_and_what_keeps_them_short_while_it_runs(monkeypatch):
    monkeypatch.setattr(integrator, "_PATIENCE", 0.0)
    monkeypatch.setattr(integrator, "_SLOW_SHARE", 1e9)
    with pytest.warns(SlowRunWarning) as caught:
        result = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 1.0}))
    (text,) = [str(each.message) for each in caught]
    time, steps, rate, name = re.search(
        r"t = (\S+) s of 1 s .*: (\d+) steps, (\S+) a second, .* short is (.*)", text
    ).groups()
    assert 0.0 < float(time) < 1.0 and 0 < int(steps) < result.attrs["solver_steps"]
    assert float(rate) > result.attrs["solver_steps"] / result.attrs["solver_wall_time"] / 100.0
    assert name in fp.Finger(fp.load_scenario("reversals").finger).layout.names


def test_bars_of_commands_are_on_standard_error_if_asked_for_and_leave_nothing_on_a_terminal(capsys):
    with progress_bar(True, 8.0) as show:
        show(8.0)
    out, err = capsys.readouterr()
    assert out == "" and simulated(err, "8")[0] == 0.0 and err.endswith(" \r")
    with count_bar(True, 4) as advance:
        advance(1)
        advance(3)
    out, err = capsys.readouterr()
    # Before it the last line is cleared.
    assert out == "" and "0/4" in err and err.endswith(" \r")
    with progress_bar(False, 8.0) as show, runs_bar(False, "sweep") as count, count_bar(False, 4) as advance:
        assert show is None and count is None
        advance(1)
    assert capsys.readouterr() == ("", "")


def test_what_was_finished_before_takes_no_part_in_the_rate_of_a_study():
    bar = progress.ProgressBar("runs")
    bar(7, 2, 10, text="sweep", note="2 failed")
    shown = bar._bar.format_dict
    bar.close()
    assert (shown["initial"], shown["n"], shown["total"], shown["postfix"]) == (7, 7, 10, "2 failed")
    assert shown["prefix"].startswith("sweep") and not shown["rate"]
