"""Digests of code: others whenever something that it reaches has changed, so that compiled code is found again."""

import ast
import gc
import importlib
import math
import pkgutil
import re
import sys
from functools import cache
from inspect import isfunction
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numba.extending import is_jitted

import finger_pin as fp
import finger_pin.core
import finger_pin.laws
import finger_pin.mechanism.gaps
import finger_pin.mechanism.spans
from finger_pin.core.jit import digests
from finger_pin.core.jit.digests import Undigestible, source_digest
from finger_pin.core.jit.functions import CompiledFunction
from finger_pin.mujoco import kernel

# Parsing all files takes a second.
syntax = cache(digests._syntax)


def spring(law, **known):
    """Return the digest of a law of a user's, whose text and whose globals are given."""
    known |= {"__name__": __name__, "np": np, "math": math}
    exec(law, known)
    return source_digest(known["force"])


LAW = """
def near(number):
    return abs(number) < LIMIT

def bent(stiffness, power=3.0):
    def force(number):
        return [stiffness * each ** power for each in (number, np.exp(number)) if near(each)][0]
    return force

force = bent(2.0)
"""


@pytest.mark.parametrize(
    ("change", "limit"),
    [
        (("stiffness * each", "stiffness / each"), 1.0),
        (("abs(number)", "abs(2 * number)"), 1.0),
        (("bent(2.0)", "bent(3.0)"), 1.0),
        (("bent(2.0)", "bent(2.0, power=2.0)"), 1.0),
        (("np.exp", "np.log"), 1.0),
        (("np.exp", "math.exp"), 1.0),
        (("", ""), 2.0),
        (("", ""), -0.0),
        (("", ""), np.float32(1.0)),
        (("", ""), (1.0, 2.0)),
    ],
    ids=str,
)
def test_a_law_that_has_changed_with_all_that_it_reaches_has_another_digest(change, limit):
    unchanged = spring(LAW, LIMIT=1.0)
    assert spring(LAW, LIMIT=1.0) == unchanged
    assert spring(LAW.replace(*change), LIMIT=limit) not in (unchanged, spring(LAW.replace(*change), LIMIT=0.0))


def test_functions_that_change_places_have_another_digest():
    """A digest of the set of functions that are reached would be the same."""
    law = "def one(x):\n    return x\ndef two(x):\n    return 2 * x\n{}\ndef force(x):\n    return f(g(x) + 1)"
    assert spring(law.format("f, g = one, two")) != spring(law.format("f, g = two, one"))


def test_an_attribute_of_a_module_of_a_user_s_is_part_of_the_digest():
    helper = ModuleType("helper")
    digests = set()
    for factor in (1.0, 2.0, 1.0):
        helper.FACTOR = factor
        digests.add(spring("def force(x):\n    return [helper.FACTOR * x for _ in range(2)]", helper=helper))
    assert len(digests) == 2


def test_lambdas_on_one_line_are_told_apart():
    plus, minus = lambda x: x + 1.0, lambda x: x - 1.0
    assert source_digest(plus) != source_digest(minus)
    assert source_digest(plus) == source_digest(plus)


THINGS = {"object": object(), "list": [1.0], "ufunc": np.frompyfunc(abs, 1, 1), "objects": np.array([None])}


@pytest.mark.parametrize("thing", THINGS.values(), ids=THINGS)
def test_a_value_that_a_later_process_could_not_recognise_has_no_digest(thing):
    with pytest.raises(Undigestible):
        spring("def force(x):\n    return THING", THING=thing)


@pytest.fixture
def digest_with(monkeypatch, tmp_path):
    """Return a function that gives the digest of the package with the text of files in a room changed."""
    monkeypatch.setenv("FINGER_PIN_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(digests, "_syntax", syntax)
    unchanged = Path.read_bytes

    def digest(room, change):
        def read(path):
            text = unchanged(path)
            if f"finger_pin/{room}" in path.as_posix():
                changed = change(text)
                assert changed != text
                return changed
            return text

        monkeypatch.setattr(Path, "read_bytes", read)
        return digests._package_digest.__wrapped__()

    return digest


@pytest.mark.slow
def test_changed_code_that_is_compiled_is_compiled_anew_and_other_code_is_not(digest_with):
    rooms = (
        "nowhere",
        "core/jit/calls.py",
        "laws/bristle.py",
        "mujoco/registration.py",
        "mechanism/gaps/prism.py",
        "views",
    )
    found = {room: digest_with(room, lambda text: text + b"x = 1\n") for room in rooms}
    assert len(set(found.values())) == 5 and found["nowhere"] == found["views"]
    assert digest_with("laws/bristle.py", lambda text: text.replace(b"scale=1e-2", b"scale=2e-2")) not in found.values()


def test_a_changed_comment_or_docstring_of_the_core_compiles_nothing(digest_with):
    unchanged = digest_with("nowhere", None)
    for change in (
        lambda text: b"# A word.\n\n" + text,
        lambda text: re.sub(rb"(?m)^(.*),$", rb"\1,  # A word.", text),
        lambda text: re.sub(rb'((^|def .*:\n    )""")', rb"\1A word. ", text),
    ):
        assert digest_with("laws/bristle.py", change) == unchanged
    # The docstring of a function that is compiled itself is one of its constants.
    law = 'def force(x):\n    """Return {0}."""\n    return (x, "{1}")[0]'
    assert spring(law.format("a", "b")) == spring(law.format("c", "b")) != spring(law.format("a", "c"))


def test_all_that_compiled_functions_name_is_part_of_the_digest():
    """By a walk over the compiled functions, and over the import statements of the names in their code."""
    for module in pkgutil.walk_packages(fp.core.__path__, "finger_pin.core."):
        importlib.import_module(module.name)
    unread = [each for each in gc.get_objects() if isinstance(each, CompiledFunction)]
    pending = [each._function for each in unread] + [kernel.advance.py_func, kernel.compute.py_func]
    # Laws and shapes are compiled for the mechanisms that have them.
    for package in (fp.laws, fp.mechanism.gaps, fp.mechanism.spans):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            pending += [each for each in vars(importlib.import_module(module.name)).values() if isfunction(each)]
    functions = set()
    while pending:
        function = pending.pop()
        if function in functions or not function.__module__.startswith("finger_pin."):
            continue
        functions.add(function)
        values = [function.__globals__.get(name) for name in digests._names(function.__code__)]
        values += [cell.cell_contents for cell in function.__closure__ or ()]
        pending += [each.py_func if is_jitted(each) else each for each in values if is_jitted(each) or isfunction(each)]
    assert len(functions) > 250
    origins = {function.__module__ for function in functions}
    for function in functions:
        for statement in ast.walk(ast.parse(Path(sys.modules[function.__module__].__file__).read_text())):
            if isinstance(statement, ast.ImportFrom) and statement.module.startswith("finger_pin."):
                imported = {each.asname or each.name for each in statement.names}
                if imported & {*digests._names(function.__code__)}:
                    origins.add(statement.module)
    assert "finger_pin.references.signal" in origins
    assert {each for each in origins if not each.startswith(digests.COMPILED_MODULES)} == set()
