"""One parser for all commands, as scripts, as a module, and in Python; and one list of public names."""

import inspect
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import pytest

import finger_pin as fp
from finger_pin.commands import application
from finger_pin.commands.options import folder_name

ROOT = Path(__file__).resolve().parents[2]
NAMES = [each.__name__ for each in application.COMMANDS]


def told(function, capsys):
    """Return the exit code of a command made of a function, and the lines of standard error."""
    return application.run_function(function, []), capsys.readouterr().err.splitlines()


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (fp.InputError("a.b", "must be 1", 2), 2, "a.b = 2: must be 1"),
        (fp.IntegrationError(0.5, "stuck", "less"), 3, "the integration stopped at t = 0.5 s: stuck; try less"),
        (fp.exceptions.Interrupted(0.5), 130, "interrupted at t = 0.5 s"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (fp.exceptions.FingerPinError("no"), 1, "no"),
        (OSError(28, "No space left on device", "a.nc"), 1, "the results cannot be written: a.nc: No space left on"),
    ],
)
def test_an_error_of_the_package_becomes_one_line_with_its_notes_and_an_exit_code(error, code, says, capsys):
    error.add_note("a note\nof two lines")

    def broken():
        raise error

    found, lines = told(broken, capsys)
    assert found == code
    (line,) = lines
    assert line.startswith(f"broken.py: {says}")
    assert line.endswith("; a note\\nof two lines")


def test_a_warning_is_one_line_and_no_failure(capsys):
    def warning():
        warnings.simplefilter("always")
        warnings.warn("the motion\nis sensitive", fp.exceptions.ScenarioWarning, stacklevel=1)

    assert told(warning, capsys) == (0, ["warning.py: warning: the motion\\nis sensitive"])


def test_a_defect_of_the_program_is_not_told_as_a_wrong_input(capsys):
    def defective():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        told(defective, capsys)


@pytest.mark.parametrize("name", NAMES)
def test_every_command_tells_its_options_as_a_script_and_as_a_part_of_the_package(name, capsys):
    script = ROOT / "scripts" / f"{name}.py"
    assert len(script.read_text(encoding="utf-8").splitlines()) < 15
    assert application.run(name, ["--help"]) == 0
    alone = capsys.readouterr().out
    assert application.run(None, [name.replace("_", "-"), "--help"]) == 0
    assert capsys.readouterr().out.replace(f"finger-pin {name.replace('_', '-')}", f"{name}.py") == alone
    assert alone.startswith(f"Usage: {name}.py [OPTIONS]") and ("--output" in alone or "[FILE]" in alone)


def test_without_a_command_all_of_them_are_listed_and_a_misspelt_one_is_told_the_nearest(capsys):
    assert application.run(None, []) == 0
    out = capsys.readouterr().out
    assert all(name.replace("_", "-") in out for name in NAMES)
    assert application.run(None, ["simulat"]) == 2
    assert capsys.readouterr().err == "finger-pin: No such command 'simulat'. Did you mean 'simulate'?\n"


@pytest.mark.slow
def test_the_package_runs_as_a_module_and_by_the_name_that_is_installed_and_lists_without_what_draws(tmp_path):
    command = [sys.executable, "-X", "importtime", "-m", "finger_pin", "simulate", "--list"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "reversals" in done.stdout
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "pydantic" in imported and not {"matplotlib", "meshcat", "netCDF4"} & imported
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module, _, name = project["scripts"]["finger-pin"].partition(":")
    assert getattr(sys.modules[module], name) is application.run


@pytest.mark.slow
def test_every_public_name_can_be_had_and_nothing_is_imported_that_is_not_asked_for():
    assert len(fp.__all__) <= 45
    for name in fp.__all__:
        assert getattr(fp, name) is not None
    assert fp.plots.plot_fig6 is fp.plot_fig6 and fp.views.view is fp.view
    code = (
        "import sys, finger_pin; print({'numpy', 'pydantic', 'matplotlib', 'numba'} & set(sys.modules))\n"
        "import finger_pin.views.viewer, finger_pin.exchange.mjcf\n"
        "print({'meshcat', 'IPython', 'zmq', 'tornado', 'mujoco'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\nset()\n"
    with pytest.raises(AttributeError, match="simulat"):
        _ = fp.simulat


def test_a_command_sets_up_its_process_before_it_imports_numpy_and_overrules_no_variable():
    code = (
        "import gc, os, sys\n"
        "os.environ.pop('OPENBLAS_NUM_THREADS', None); os.environ['OMP_NUM_THREADS'] = '3'\n"
        "from finger_pin.commands.application import run\n"
        "early = {'numpy', 'pydantic'} & set(sys.modules)\n"
        "assert gc.get_threshold()[0] < 10_000 and run(None, ['--version']) == 0\n"
        "print(early, gc.get_threshold()[0], os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[1] == "set() 2000000 1 3"


@pytest.mark.parametrize(
    ("variants", "name"),
    [
        ((), "reversals"),
        (("controller.gain=2",), "reversals-gain-2"),
        (("controller.gain = [1.1, 0.7]", "duration=1"), "reversals-gain-1.1_0.7-duration-1"),
        (
            ("finger.tendon_friction.coulomb=0.08", "reference.kind=x"),
            "reversals-tendon_friction.coulomb-0.08-reference.kind-x",
        ),
        (("controller.gain=0.5:2:7",), "reversals-gain-0.5to2to7"),
    ],
)
def test_a_folder_is_named_so_that_it_can_be_read(variants, name):
    assert folder_name("reversals", *variants) == name


def test_names_that_a_path_cannot_hold_differ_by_a_digest_and_none_is_too_long():
    names = [
        folder_name("reversals", each) for each in ("finger=a/b", "finger=a\\b", "title=é", "x=" + "1" * 400, "x\udcff")
    ]
    assert len({*names}) == len(names)
    assert all(len(each) < 70 and each.isascii() and "/" not in each for each in names)


def test_the_version_is_told_and_options_of_all_commands_are_listed(capsys):
    assert application.run_function(None, ["--version"]) == 0
    assert capsys.readouterr().out == f"finger-pin {fp.__version__}\n"
    assert application.run_function(None, ["--verson"]) == 2
    assert capsys.readouterr().err.endswith("--show-completion, --version, --help; did you mean --version?\n")


def test_an_unknown_bench_is_refused_with_the_list_of_benches_that_ship(capsys):
    assert application.run("identify", ["transmision"]) == 2
    said = capsys.readouterr().err
    assert (
        'bench = "transmision": no such bench; there are fig6, instrument, postures' in said
        and "did you mean transmission?" in said
    )


NEEDS = {
    "sweep": ["reversals", "--over", "controller.gain=1,2"],
    "identify": ["transmission"],
    "observe": ["wound", "log.csv"],
}


@pytest.mark.parametrize("command", application.COMMANDS, ids=NAMES)
def test_an_option_that_another_one_makes_idle_is_refused_by_every_command_that_has_both(command, capsys):
    name, options = command.__name__, inspect.signature(command).parameters
    cases = []
    if {"figures", "format"} <= {*options}:
        cases.append((["--no-figures", "--format", "pdf"], "--format: has no effect"))
    if "settings" in options:
        twice = ["--set", "controller.gain=1", "--set", "controller.gain=2"]
        cases.append((twice, "--set: controller.gain=2: an earlier one sets the same entry"))
    for arguments, says in cases:
        assert application.run(name, [*NEEDS.get(name, []), *arguments]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert says in line


@pytest.mark.parametrize(
    ("name", "arguments", "says"),
    [
        ("simulate", ["reversals", "--mujoco", "hand.xml"], "SCENARIO: reversals: --mujoco takes its place"),
        ("simulate", ["--meshes", "box"], "--meshes: has no effect without --mujoco"),
        ("simulate", ["--duration", "1", "--set", "simulation.duration=2"], "--duration sets the same entry"),
        ("sweep", [*NEEDS["sweep"], "--set", "controller.gain=3"], "controller.gain = 3: has no effect"),
        ("sweep", [*NEEDS["sweep"], "--restart", "--retry-failed"], "--retry-failed: has no effect"),
        ("sweep", ["hand", "--over", "finger.gravity[2]=1,2"], "there is a hand"),
        (
            "sweep",
            ["reversals", "--over", "finger=ub,planar", "--set", "finger.joint_friction.viscous=0.1"],
            "finger.joint_friction.viscous = 0.1: has no effect where finger is varied",
        ),
        ("self_locking", ["wound", "--format", "pdf"], "--format: has no effect"),
        ("self_locking", ["wound", "--output", "here"], "--output: has no effect"),
        ("force_capability", ["hand"], "is a hand; take one of its fingers"),
    ],
)
def test_an_argument_that_would_be_ignored_is_refused_in_one_line(name, arguments, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert application.run(name, arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line and not any(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_sections")
def test_the_force_script_takes_a_scenario_a_file_that_extends_one_and_their_finger_alike(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text("extends = 'reversals'\n[simulation]\nduration = 0.1\n")
    monkeypatch.setattr("finger_pin.views.plots.save_figure", lambda *given: None)
    printed = []
    for given in ("ub_stand_in", "reversals", "mine.toml"):
        assert application.run("force_capability", [given]) == 0
        printed.append(capsys.readouterr().out)
    assert "friction hindering" in printed[0] and printed[1:] == printed[:1] * 2
