"""Digests of what a run depends on: alike for the same code and values, and different for any other."""

import functools
import os
import subprocess
import sys
import threading
import tomllib
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.studies.fingerprint import UnknownDependency, digest, source_digest
from finger_pin.studies.metrics import METRICS
from finger_pin.views.summary import summarize


def defined(text, **values):
    """Return the function ``f`` of a text, in a module of its own."""
    space = {"__name__": "of_ones_own", **values}
    exec(compile(text, "of_ones_own.py", "exec"), space)
    return space["f"]


PAIRS = {
    "a constant": ("def f(x): return x + 1", "def f(x): return x + 2"),
    "an operation": ("def f(x): return x + 1", "def f(x): return x - 1"),
    "a name": ("def f(x): return min(x)", "def f(x): return max(x)"),
    "a default": ("def f(x, y=1): return x", "def f(x, y=2): return x"),
    "a global": ("A = [1, {'a': 2}]\ndef f(x): return A", "A = [1, {'a': 3}]\ndef f(x): return A"),
    "a helper": ("def g(): return 1\ndef f(x): return g()", "def g(): return 2\ndef f(x): return g()"),
    "a class": (
        "class A:\n  def g(self): return 1\ndef f(x): return A().g()",
        "class A:\n  def g(self): return 2\ndef f(x): return A().g()",
    ),
    "an enclosed value": (
        "def make(a):\n  return lambda x: a\nf = make(1)",
        "def make(a):\n  return lambda x: a\nf = make(2)",
    ),
    "an inner function": (
        "def f(x):\n  def g(): return 1\n  return g()",
        "def f(x):\n  def g(): return 2\n  return g()",
    ),
    "an array": (
        "import numpy as np\nA = np.array([1.0])\ndef f(x): return A",
        "import numpy as np\nA = np.array([2.0])\ndef f(x): return A",
    ),
}


CLASS = """
class A:
  def __init__(self): self.here, self.sizes = self, {'a': %s}
  def __call__(self, x): return x
f = A()
"""
PAIRS |= {
    "an object": (CLASS % 1, CLASS % 2),
    "a property": tuple(f"class A:\n  @property\n  def b(self): return {n}\nf = A()" for n in (1, 2)),
    "a compiled function": tuple(f"import numba\n@numba.njit\ndef f(x): return {n}" for n in (1, 2)),
    "how it is compiled": tuple(f"import numba\n@numba.njit(fastmath={n})\ndef f(x): return x" for n in (True, False)),
    "a function with a memory": tuple(f"import functools\nf = functools.lru_cache(lambda x: {n})" for n in (1, 2)),
    "a NumPy function": ("import numpy\nf = numpy.sin", "import numpy\nf = numpy.cos"),
    "random numbers": tuple(f"import numpy\nf = numpy.random.default_rng({n}).normal" for n in (1, 2)),
    "a zero's sign": ("f = 0.0", "f = -0.0"),
    "the kind of a number": ("f = 1", "f = 1.0"),
    "a scenario": tuple(
        f"import finger_pin\nf = finger_pin.load_scenario('reversals', {{'controller.gain': {n}}})" for n in (1, 2)
    ),
}


@pytest.mark.parametrize("what", PAIRS)
def test_a_digest_tells_apart_what_differs_in(what):
    one, other = PAIRS[what]
    assert digest(defined(one)) == digest(defined(one))
    assert digest(defined(one)) != digest(defined(other))


def test_a_partial_is_told_by_its_arguments():
    function = defined("def f(a, b): return a + b")
    digests = {digest(functools.partial(function, number)) for number in (1, 2, 2)}
    assert len(digests) == 2


def test_a_module_of_ones_own_counts_by_what_is_used_of_it(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    texts = {"first": "A = 1\nB = 1\n", "second": "A = 1\nB = 2\n", "third": "A = 2\nB = 1\n"}
    found = {}
    for name, text in texts.items():
        (tmp_path / f"helper_{name}.py").write_text(text)
        module = __import__(f"helper_{name}")
        module.__name__ = "helper"
        found[name] = digest(defined("def f(x): return helper.A", helper=module))
    assert found["first"] == found["second"] != found["third"]


MYSTERIES = [threading.Lock(), (each for each in ()), np.frompyfunc(abs, 1, 1)]


@pytest.mark.parametrize("mystery", MYSTERIES)
def test_a_value_that_cannot_be_compared_has_no_digest(mystery):
    with pytest.raises(UnknownDependency):
        digest(defined("def f(x): return A", A=mystery))


def test_all_metrics_of_the_package_have_digests_of_their_own():
    assert len({digest(metric.measure) for metric in METRICS.values()}) == len(METRICS)
    assert source_digest() == source_digest()


LAYERS = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
ROOMS = next(each["layers"] for each in LAYERS if "studies" in each["layers"])


@pytest.mark.parametrize("room", ROOMS[: ROOMS.index("studies") + 2])
def test_an_edit_above_the_studies_keeps_stored_runs_and_one_below_does_not(room, monkeypatch):
    read = Path.read_bytes
    before = source_digest.__wrapped__()
    monkeypatch.setattr(Path, "read_bytes", lambda path: read(path) + b"#" * (path.parts.count(room) > 0))
    assert (source_digest.__wrapped__() == before) == (ROOMS.index(room) < ROOMS.index("studies"))


def test_a_metric_that_calls_a_room_above_the_studies_depends_on_its_code(monkeypatch):
    def measure(run):
        return len(summarize(run.result))

    before = digest(measure)
    monkeypatch.setattr(summarize, "__code__", (lambda result: "").__code__)
    assert digest(measure) != before


def test_runs_with_a_law_of_ones_own_are_kept_under_a_digest_of_it():
    law = fp.Law("none", ("k",), lambda row, p: (0.0 * row.length, 0.0), lambda row, p, s: ((0,) * 7, (0,) * 6), abs)
    fingers = [
        fp.Finger("ub_stand_in", rows=[fp.Rows("none", law, ("a",), [[number]], np.zeros((1, 5)))])
        for number in (1.0, 2.0, 1.0)
    ]
    first, other, again = map(digest, fingers)
    assert first == again != other and first != digest(fp.Finger("ub_stand_in"))


ALIKE = """
import sys
sys.path[:0] = sys.argv[1:]
import finger_pin as fp
from test_fingerprint import PAIRS, defined
from finger_pin.studies.fingerprint import digest

texts = [text for pair in PAIRS.values() for text in pair]
constants = "def f(x): return x in {'a', 'b', 'c', 'd'} or x == S, (1, 2), (1, 2), float('nan')"
things = [*map(defined, texts), defined(constants, S={"a", "b", "c"}), fp.Finger("ub_stand_in")]
print(list(map(digest, things)))
"""


@pytest.mark.slow
def test_equal_values_have_equal_digests_in_processes_that_order_sets_and_texts_otherwise():
    told = []
    for seed in ("1", "2"):
        command = [sys.executable, "-c", ALIKE, str(Path(__file__).parent)]
        environment = os.environ | {"PYTHONHASHSEED": seed}
        told.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert told[0] == told[1] != ""
