"""Compiled code on disk: it is found again while all that it reaches is the same, and only then."""

import ast
import logging
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import finger_pin as fp
from finger_pin.core.addresses.law_code import addresses
from finger_pin.core.jit import CompiledFunction, functions, njit_inline, njit_reassociate
from finger_pin.laws.law import Law

SOURCE = '''
FACTOR = 2.0

def scale(number):
    """Scale."""
    return FACTOR * number

inner = {decorated}(scale)

def double(address, number):
    return int(inner(number)) + address
'''
DECORATED = {"njit_inline": njit_inline, "njit_reassociate": njit_reassociate}


def unit(change=("", ""), decorated="njit_inline", module=__name__):
    """Return a unit whose source differs in something."""
    known = {"__name__": module, **DECORATED}
    exec(SOURCE.format(decorated=decorated).replace(*change), known)
    return CompiledFunction(known["double"])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of the cache, where nothing is yet."""
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", str(tmp_path / "new" / "cache"))
    return tmp_path / "new" / "cache"


def code_in(folder):
    return [path for path in folder.rglob("*") if path.suffix == ".nbc"]


def test_code_is_found_again_when_a_comment_or_a_docstring_has_changed(folder):
    assert not unit().kept
    assert unit()(1, 21.0) == 43
    (kept,) = code_in(folder)
    stamp = kept.stat().st_mtime_ns
    for change in (("", ""), ("FACTOR = 2.0", "\n# How much.\n\nFACTOR = 2.0"), ("Scale.", "Scale it.")):
        assert unit(change).kept
        assert unit(change)(1, 21.0) == 43
    assert code_in(folder) == [kept] and kept.stat().st_mtime_ns == stamp


@pytest.mark.parametrize(
    ("change", "result"),
    [(("FACTOR = 2.0", "FACTOR = 3.0"), 63), (("FACTOR * number", "FACTOR + number"), 23)],
    ids=["a constant", "a function that is called"],
)
def test_code_is_compiled_anew_when_what_it_reaches_has_changed(folder, change, result):
    assert unit()(0, 21.0) == 42
    assert not unit(change).kept
    assert unit(change)(0, 21.0) == result
    assert unit()(0, 21.0) == 42


def test_a_function_without_a_lasting_identity_runs_all_the_same_and_is_not_kept(folder):
    assert unit(module="of no module")(1, 21.0) == 43
    assert code_in(folder) == []


@pytest.mark.slow
def test_only_core_jit_imports_the_compiler():
    """The rest of the package would depend on a version of it, or keep code that does not hold."""
    root = Path(fp.__file__).parent
    importing = set()
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                if name.partition(".")[0] in ("numba", "llvmlite"):
                    importing.add(path.relative_to(root).parent.as_posix())
                    assert not re.match(r"(numba|llvmlite)\.(core|np|cpython|typed|_)", name), f"{path}: {name}"
    assert importing == {"core/jit"}


def test_code_of_a_module_that_has_moved_is_compiled_anew(folder):
    """What is kept names its modules: where one is gone it could not be read."""
    assert unit(module="pytest")(0, 21.0) == 42
    assert not unit().kept


def test_code_that_may_reorder_sums_is_other_code(folder):
    assert unit()(0, 21.0) == unit(decorated="njit_reassociate")(0, 21.0) == 42
    assert len(code_in(folder)) == 2


def test_threads_that_ask_at_once_get_the_same_code(folder):
    shared = unit()
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda number: shared(0, number), [1.0, 2.0, 3.0, 4.0])) == [2, 4, 6, 8]
    assert len(code_in(folder)) == 1


def test_compiled_arithmetic_keeps_what_is_not_a_number(folder):
    """An optimiser that may assume finite numbers would make both zero."""

    @CompiledFunction
    def nothing(_address, number):
        nothing = number - number + 0.0 * number
        return 1 if nothing == nothing else 0

    assert [nothing(0, number) for number in (float("nan"), float("inf"), 1.0)] == [0, 0, 1]


def test_a_law_of_somebody_else_is_compiled_without_a_word_and_kept(folder, said):
    def force(row, p):
        return -p[0] * row.length, 0.0

    def slopes(row, p, signals):
        return (-p[0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def account(row, p, force, rate, signals):
        return (0.5 * p[0] * row.length**2,)

    assert all(addresses(Law("own spring", ("stiffness",), force, slopes, account)))
    assert said() == [] and len(code_in(folder)) == 3


@pytest.fixture
def said(caplog):
    # A command that was run without a terminal has silenced it.
    caplog.set_level(logging.WARNING, logger="finger_pin")
    functions._warn_once.cache_clear()
    yield lambda: [record.getMessage() for record in caplog.records]
    functions._warn_once.cache_clear()


def test_the_first_compilation_is_announced_once(folder, said):
    first, second = unit(), unit(("2.0", "4.0"))
    assert said() == []
    assert (first(0, 1.0), second(0, 1.0), unit()(0, 2.0)) == (2, 4, 4)
    assert said() == ["Compiling the model, once for this version: about a minute ..."]


def test_code_runs_without_a_cache_folder_and_warns_once(tmp_path, monkeypatch, said):
    """Not even a person who may do anything can make a folder inside a file."""
    file = tmp_path / "file"
    file.write_text("not a folder")
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", str(file))
    assert (unit()(0, 21.0), unit()(0, 1.0)) == (42, 2)
    (line,) = said()
    assert f"in every run, as {file} cannot be written" in line and "FINGER_PIN_CACHE_DIR" in line
    assert file.read_text() == "not a folder"


def test_code_that_a_broken_disk_has_cut_short_is_compiled_anew(folder, said):
    assert unit()(0, 21.0) == 42
    for path in code_in(folder):
        path.write_bytes(path.read_bytes()[:100])
    assert unit()(0, 21.0) == 42
    assert said()[1:] and said()[1].startswith(f"the compile cache {folder} cannot be used: ")


@pytest.mark.slow
def test_a_full_disk_is_named_and_costs_nothing_else(folder):
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))\n"
        "from finger_pin.core.jit import CompiledFunction\n"
        "@CompiledFunction\ndef double(address, number):\n    return int(2.0 * number)\n"
        "print(double(0, 21.0))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "42\n"
    assert f"the compile cache {folder} cannot be used: File too large; " in done.stderr
    assert code_in(folder) == []


DOUBLE = """
import os, pathlib, signal, time
from finger_pin.core.jit import CompiledFunction

@CompiledFunction
def double(address, number):
    return int(2.0 * number) + address
"""


@pytest.mark.slow
def test_of_processes_that_start_at_once_on_an_empty_folder_one_compiles_and_a_later_one_finds_the_code(
    folder, tmp_path
):
    gate = tmp_path / "gate"
    code = (
        f"{DOUBLE}\nfrom finger_pin.core.jit.functions import _kept_alive\n"
        f"kept = double.kept\n(pathlib.Path({str(tmp_path)!r}) / str(os.getpid())).touch()\n"
        f"while not pathlib.Path({str(gate)!r}).exists():\n    time.sleep(0.001)\n"
        "print(kept, double(1, 21.0), _kept_alive[-1].cache_hits)"
    )
    running = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    while not all((tmp_path / str(each.pid)).exists() for each in running):
        assert all(each.poll() is None for each in running)
        time.sleep(0.001)
    gate.touch()
    assert sorted(each.communicate()[0] for each in running) == ["False 43 0\n", "False 43 1\n"]
    assert list(folder.glob("*.lock")) == []
    later = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (later.stdout, later.stderr) == ("True 43 1\n", "")


@pytest.mark.slow
@pytest.mark.parametrize("file", [1, 2], ids=["the first file", "the last one"])
def test_a_process_that_is_killed_as_it_puts_code_in_place_leaves_none_that_is_broken(folder, file):
    """The cache writes two files for a function: what code there is, and the code."""
    killed = (
        f"{DOUBLE}\nreplace, left = os.replace, [{file}]\n"
        "def put(*names):\n"
        "    left[0] -= 'compiled' in str(names[1])\n"
        "    return replace(*names) if left[0] else os.kill(os.getpid(), signal.SIGKILL)\n"
        "os.replace = put\ndouble(1, 21.0)"
    )
    assert subprocess.run([sys.executable, "-c", killed], capture_output=True).returncode == -signal.SIGKILL
    assert code_in(folder) == [] and len(list(folder.rglob("*.nbi"))) == file - 1
    for kept in (False, True):
        code = f"{DOUBLE}\nprint(double.kept, double(1, 21.0))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
        assert done.stdout == f"{kept} 43\n"


@pytest.mark.slow
def test_code_compiled_by_one_process_runs_in_a_later_one_without_a_warning():
    """With servos, whose laws read loads as NumPy's `load` is called, with objects, and several fingers."""
    code = (
        "import finger_pin as fp\n"
        "for name in ('reversals', 'servo', 'press', 'hand'):\n"
        "    fp.simulate(fp.load_scenario(name, {'simulation.duration': 0.002}))"
    )
    exec(code)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.slow
def test_importing_the_core_compiles_nothing(tmp_path):
    environment = os.environ | {"FINGER_PIN_CACHE_DIR": str(tmp_path)}
    code = "import finger_pin.core.signals.state_batches, finger_pin.core.steps.rosenbrock"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr, list(tmp_path.iterdir())) == ("", "", [])
