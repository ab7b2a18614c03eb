"""Digests of what a run depends on: alike for the same code and values, and different for any other."""

import functools
import threading

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, finger_digest, source_digest
from finger_pin.studies.metrics import METRICS


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


@pytest.mark.parametrize("what", PAIRS)
def test_a_digest_tells_apart_what_differs_in(what):
    one, other = PAIRS[what]
    assert code_digest(defined(one)) == code_digest(defined(one))
    assert code_digest(defined(one)) != code_digest(defined(other))


def test_a_partial_is_told_by_its_arguments():
    function = defined("def f(a, b): return a + b")
    digests = {code_digest(functools.partial(function, number)) for number in (1, 2, 2)}
    assert len(digests) == 2


def test_a_module_of_ones_own_counts_by_what_is_used_of_it(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    texts = {"first": "A = 1\nB = 1\n", "second": "A = 1\nB = 2\n", "third": "A = 2\nB = 1\n"}
    found = {}
    for name, text in texts.items():
        (tmp_path / f"helper_{name}.py").write_text(text)
        module = __import__(f"helper_{name}")
        module.__name__ = "helper"
        found[name] = code_digest(defined("def f(x): return helper.A", helper=module))
    assert found["first"] == found["second"] != found["third"]


@pytest.mark.parametrize("mystery", [object(), threading.Lock(), np.array([None]), functools.lru_cache(lambda: 1)])
def test_what_cannot_be_compared_has_no_digest(mystery):
    with pytest.raises(UnknownDependency):
        code_digest(defined("def f(x): return A", A=mystery))


def test_all_metrics_of_the_package_have_digests_of_their_own():
    assert len({code_digest(metric.measure) for metric in METRICS.values()}) == len(METRICS)
    assert source_digest() == source_digest()


def test_runs_with_a_law_of_ones_own_are_kept_under_a_digest_of_it():
    law = fp.Law("none", ("k",), lambda row, p: (0.0 * row.length, 0.0), lambda row, p, s: ((0,) * 7, (0,) * 6), abs)
    fingers = [
        fp.Finger("ub_stand_in", rows=[fp.Rows("none", law, ("a",), [[number]], np.zeros((1, 5)))])
        for number in (1.0, 2.0, 1.0)
    ]
    first, other, again = map(finger_digest, fingers)
    assert first == again != other and first != finger_digest(fp.Finger("ub_stand_in"))
