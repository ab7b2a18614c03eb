"""The compiler's cache: where it is, when it is thrown away, and that nothing is compiled before it is needed."""

import importlib
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import NamedTuple

import numpy as np
import pytest
from law_cases import every_law

import finger_pin as fp
from finger_pin.core import compilation, law_code
from finger_pin.core.binding import Kind, Matrix, bound_at, call

PACKAGE = Path(compilation.__file__).parent.parent


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """A copy of the package's source that the digest is taken of."""
    copy = tmp_path / "finger_pin"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(compilation, "__file__", str(copy / "core" / "compilation.py"))
    return copy


@pytest.mark.parametrize("name", ["laws/bristle.py", "laws/capstan.py", "laws/limiter.py", "core/dynamics.py"])
def test_a_changed_law_has_a_cache_of_its_own(sources, name):
    before = compilation._digest()
    assert compilation._digest() == before
    source = sources / name
    source.write_text(source.read_text() + "\n# The same law, another file.\n")
    assert compilation._digest() != before


def test_a_change_of_what_is_not_compiled_keeps_the_cache(sources):
    before = compilation._digest()
    source = sources / "simulation" / "recording.py"
    source.write_text(source.read_text() + "\n# Not compiled.\n")
    assert compilation._digest() == before


def test_the_digest_covers_every_module_whose_functions_are_compiled():
    """Those of the core itself, and those of laws that are kept on disk, with all that these call."""
    seen = {*PACKAGE.glob("core/*.py"), *PACKAGE.glob("laws/*.py")}
    found = set()

    def collect(function):
        if function not in found:
            found.add(function)
            called = [function.__globals__.get(name) for name in function.__code__.co_names]
            for each in called:
                if isinstance(each, FunctionType):
                    collect(each)

    for law in every_law().values():
        for function in (law.value, law.slopes, law.account):
            collect(function)
    for path in PACKAGE.glob("core/*.py"):
        module = importlib.import_module(f"finger_pin.core.{path.stem}")
        found |= {value.function for value in vars(module).values() if isinstance(value, compilation._Inlined)}
    assert len(found) > 60
    for function in found:
        assert Path(function.__code__.co_filename) in seen, function


def test_the_cache_lies_in_the_folder_that_the_environment_names(tmp_path, monkeypatch):
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", str(tmp_path / "new" / "cache"))
    folder = compilation._cache_folder()
    assert folder == str(tmp_path / "new" / "cache" / compilation._digest())
    assert list(Path(folder).iterdir()) == []


def test_where_no_folder_can_be_made_there_is_no_cache(tmp_path, monkeypatch):
    """Not even a person who may do anything can make a folder inside a file."""
    file = tmp_path / "file"
    file.write_text("not a folder")
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", str(file))
    assert compilation._cache_folder() is None
    assert file.read_text() == "not a folder"


def doubled(name="double"):
    """Return a unit of the package, so to say, that is compiled on first use."""

    def double(address, number):
        return int(2.0 * number) + address

    double.__module__, double.__qualname__ = "finger_pin.core.double", name
    return compilation.Unit(double)


def test_without_a_cache_code_compiles_and_runs_all_the_same(monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "CACHE_FOLDER", None)
    monkeypatch.chdir(tmp_path)
    assert doubled()(0, 21.0) == 42
    assert list(tmp_path.iterdir()) == []


def test_compiled_arithmetic_keeps_what_is_not_a_number():
    """An optimiser that may assume finite numbers would make both zero."""

    @compilation.Unit
    def nothing(_address, number):
        nothing = number - number + 0.0 * number
        return 1 if nothing == nothing else 0

    assert [nothing(0, number) for number in (float("nan"), float("inf"), 1.0)] == [0, 0, 1]


def test_what_one_process_has_compiled_another_runs_without_the_compiler(monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path))
    assert doubled()(0, 21.0) == 42
    (kept,) = tmp_path.iterdir()
    monkeypatch.setitem(sys.modules, "finger_pin.core.compiler", None)
    assert doubled()(0, 21.0) == 42
    with pytest.raises(ImportError):
        doubled("another")(0, 21.0)
    assert list(tmp_path.iterdir()) == [kept]


class Table(NamedTuple):
    matrix: Matrix


TABLE = Kind(Table)


def test_code_that_calls_the_compiler_s_own_library_is_not_kept(monkeypatch, tmp_path):
    """Another process, which has no compiler, could not load it."""

    @compilation.Unit
    def last(address, _number):
        return int(bound_at(address, TABLE).matrix.reshape(-1)[5])

    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path))
    assert call(last, Table(np.arange(6.0).reshape(2, 3)), TABLE) == 5
    assert list(tmp_path.iterdir()) == []


def test_a_simulation_whose_code_is_kept_imports_no_compiler():
    code = "import sys, finger_pin as fp; fp.simulate(fp.load_scenario('fig6', {'simulation.duration': 0.01}))"
    fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 0.01}))
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; print('numba' in sys.modules)"], capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ("False\n", "")


def test_importing_the_package_compiles_nothing_and_opens_no_cache_file(tmp_path):
    code = "import sys, finger_pin, finger_pin.core.signals; print('numba' in sys.modules)"
    environment = os.environ | {"FINGER_PIN_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=PACKAGE.parent, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False"]
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.fixture
def said(caplog):
    # A command that was run without a terminal has silenced it.
    caplog.set_level(logging.WARNING, logger="finger_pin")
    compilation._say.cache_clear()
    yield lambda: [record.getMessage() for record in caplog.records]
    compilation._say.cache_clear()


def test_the_first_compilation_is_announced_once(said, monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path))
    units = [doubled("one"), doubled("two")]
    assert said() == []
    for unit in units:
        unit(0, 1.0)
    assert said() == ["Compiling the model, once for this version: about half a minute ..."]


def test_where_nothing_can_be_cached_it_is_said_once_that_every_run_compiles(said, monkeypatch):
    monkeypatch.setattr(compilation, "CACHE_FOLDER", None)
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", "/proc/nowhere")
    doubled()(0, 1.0)
    doubled()(0, 1.0)
    (line,) = said()
    assert "in every run, as /proc/nowhere cannot be written" in line and "FINGER_PIN_CACHE_DIR" in line


def test_a_cache_on_a_full_disk_is_named_and_costs_nothing_else(said, monkeypatch, tmp_path):
    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path))
    monkeypatch.setattr(Path, "write_bytes", full)
    assert doubled()(0, 21.0) == 42
    (told,) = said()[1:]
    assert told.startswith(f"the compile cache {tmp_path} cannot be written: No space left on device; ")
    assert list(tmp_path.iterdir()) == []


def test_a_law_that_is_not_of_the_package_is_compiled_without_a_word_and_not_kept(said, monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "CACHE_FOLDER", str(tmp_path))
    law = every_law()["JOINT_SPRING"]
    own = FunctionType(law.value.__code__, {**law.value.__globals__, "__name__": "own"}, "value")
    assert law_code._address(law, law_code._value, own) > 0
    assert said() == [] and list(tmp_path.iterdir()) == []
    assert law_code._address(law, law_code._value, law.value) > 0
    assert len(said()) == len(list(tmp_path.iterdir())) == 1


def test_python_says_on_standard_error_that_it_compiles():
    code = "from finger_pin.core import compilation; compilation._say('Compiling'); compilation._say('Compiling')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "Compiling\n"
