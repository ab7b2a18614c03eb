"""The command simulate with a wrong input: one line, and everything is left as it was."""

import os

import pytest
from harness import refused
from test_files import contents
from wrong_inputs import FILES, OTHER_OVERRIDES, PLANAR


@pytest.mark.slow
@pytest.mark.parametrize(("text", "entry", "says"), OTHER_OVERRIDES, ids=[text[:50] for text, _, _ in OTHER_OVERRIDES])
def test_a_wrong_value_ends_with_one_line_and_leaves_everything_as_it_was(run, here, text, entry, says):
    (here / "results" / "reversals").mkdir(parents=True)
    (here / "results" / "reversals" / "trajectory.nc").write_text("earlier")
    before = contents(here)
    answer = run("reversals", "--set", text)
    refused(answer, entry)
    assert any(each in answer[2][0] for each in ((says,) if isinstance(says, str) else says))
    assert contents(here) == before


@pytest.mark.slow
@pytest.mark.parametrize("case", FILES)
def test_a_wrong_file_ends_with_one_line_and_writes_nothing(run, here, case):
    data, names, says = FILES[case]
    (here / "case.toml").write_bytes(data)
    refused(run("case.toml"), names, says)
    assert set(contents(here)) == {"s.toml", "case.toml"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--hlep"], "did you mean --help?"),
        (["--figure"], "did you mean --figures?"),
        (["--no-figure"], "did you mean --no-figures?"),
        (["--durations", "1"], "did you mean --duration?"),
        (["--out", "x"], "--out: no such option"),
        (["-x"], "-x: no such option"),
        (["--bogus=1\n2"], "--bogus"),
        (["reversals", "reversals"], "unexpected extra argument(s) (reversals)"),
        (["--set"], "'--set' requires an argument"),
        (["--duration"], "'--duration' requires an argument"),
        (["--output"], "'--output' requires an argument"),
        (["--view=yes"], "--view"),
        (["--quiet=1"], "--quiet"),
        (["--set", "controller.gain"], "controller.gain: must be KEY=VALUE"),
        (["--set", "=2"], "must be KEY=VALUE"),
        (["--set", ""], "must be KEY=VALUE"),
        (["--set", "controller.gain="], "controller.gain: : must be TOML"),
        (["--set", "controller.gain=[1,"], "controller.gain: [1,: must be TOML"),
        (["--set", "controller.gain=1.0.0"], "controller.gain: 1.0.0: must be TOML"),
        (["--set", "controller.gain=1,2"], "controller.gain: 1,2: must be TOML"),
        (["--set", 'title="open'], "must be TOML"),
        (["--set", "controller.gain=1\nother = 2"], "must be TOML"),
        (["--set", "controller.gain=1\n[simulation]\nduration = 2"], "must be TOML"),
        (["--set", "controller.gain=" + "[" * 5000], "must be TOML"),
        (["--set", "controller.gain=" + "9" * 5000], "must be TOML"),
        (["--set", "controller.gain=two"], 'controller.gain = "two": must be a number'),
        (["--duration", "long"], 'simulation.duration = "long": must be a number'),
        (["--duration", "-1"], "simulation.duration = -1: must be above 0"),
        (["--duration", "0"], "simulation.duration = 0: must be above 0"),
        (["--duration", "nan"], "simulation.duration = nan: must be a finite number"),
        (["--duration", ""], "simulation.duration"),
        (["--method", "radau5"], "did you mean Radau?"),
        (["--method", "3"], "simulation.method = 3: must be one of"),
        (["fgi6"], "did you mean fig6?"),
        (["absent.toml"], "absent.toml: there is no such file"),
        (["."], "no such scenario"),
        (["./"], "cannot be read"),
        ([""], "no such scenario"),
        (["../../etc/passwd"], "scenario file ../../etc/passwd"),
        (["s.toml", "--set", "title=\udcff"], "title"),
        (["s.toml", "--output", "s.toml"], 'output = "s.toml": s.toml is a file'),
        (["s.toml", "--output", "."], "holds a s"),
    ],
    ids=lambda value: " ".join(value)[:50].encode("unicode_escape").decode() if isinstance(value, list) else "",
)
def test_a_wrong_command_line_ends_with_one_line_and_writes_nothing(run, here, arguments, says):
    if says == "holds a s":
        # Somebody's own scenario must not be replaced by the resolved one.
        (here / "scenario.toml").write_text(PLANAR)
    before = contents(here)
    refused(run(*arguments), says)
    assert contents(here) == before


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_simulated(run, here, monkeypatch):
    mkdir = os.mkdir

    def refuse(path, *arguments):
        if str(path).startswith("a/b"):
            raise PermissionError(13, "Permission denied", str(path))
        mkdir(path, *arguments)

    monkeypatch.setattr(os, "mkdir", refuse)
    monkeypatch.setattr("finger_pin.simulation.simulate.run", lambda *a, **o: pytest.fail("simulated"))
    for output, says in (("a/b", "Permission denied"), ("s.toml/c", "Not a directory"), ("o" * 300, "too long")):
        code, out, lines = run("s.toml", "--output", output)
        assert (code, out, len(lines)) == (1, "", 1)
        assert "the results cannot be written: " in lines[0] and says in lines[0] and output in lines[0]
        assert set(contents(here)) == {"s.toml"}
