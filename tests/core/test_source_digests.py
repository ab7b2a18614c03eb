"""Digests of code: others whenever something that it reaches has changed, so that compiled code is found again."""

import math
import re
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.core.jit import digests
from finger_pin.core.jit.digests import Undigestible, source_digest


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
def test_what_a_later_process_could_not_recognise_has_no_digest(thing):
    with pytest.raises(Undigestible):
        spring("def force(x):\n    return THING", THING=thing)


def test_a_changed_file_of_the_core_or_below_is_compiled_anew_and_one_above_is_not(monkeypatch):
    kept, own = Path.read_bytes, digests._package_digest.__wrapped__

    def changed_in(room):
        def read(path):
            return kept(path) + (b"# changed" if f"finger_pin/{room}" in path.as_posix() else b"")

        monkeypatch.setattr(Path, "read_bytes", read)
        return own()

    found = {
        room: changed_in(room) for room in ("nowhere", "core/jit", "laws/bristle.py", "mujoco", "files.py", "views")
    }
    assert len(set(found.values())) == 5 and found["nowhere"] == found["views"]


def test_every_room_that_the_core_may_import_is_part_of_the_digest():
    """By the import contract: the layers from that of the core on."""
    contract, *_ = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = contract["layers"]
    (core,) = [place for place, layer in enumerate(layers) if "core" in layer.split(" : ")]
    below = {room for layer in layers[core:] for room in re.split(r"\W+", layer)}
    root = Path(fp.__file__).parent
    assert {room for room in below if (root / room).is_dir()} <= set(digests.ROOMS)
