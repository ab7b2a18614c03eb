"""The laws that there are, rows for them, and laws that take complex numbers."""

import importlib
from pathlib import Path
from types import FunctionType

import numpy as np

import finger_pin.laws
from finger_pin.laws.law import Law, Row

#: Where a parameter is drawn from, by its name; others from 0.1 to 2.
RANGES = {
    "lower": (-1.5, -0.1),
    "least": (-1.5, -0.1),
    "lowest": (-0.4, 0.5),
    "least_state": (-1.5, -0.1),
    "one_way": (-1.0, 1.0),
    "drag_asymmetry": (-1.0, 1.0),
    "surface": (0.1, 0.8),
    "ratio": (1.0, 2.0),
    "lag": (0.0, 0.5),
    "floor": (1e-3, 1.0),
    "shortest": (0.1, 0.9),
    "longest": (1.1, 2.0),
    "lengthening": (1.1, 2.0),
}


def every_law():
    """Return all laws of the package by the name that they have in their module."""
    modules = [path.stem for path in sorted(Path(finger_pin.laws.__file__).parent.glob("*.py"))]
    found = [vars(importlib.import_module(f"finger_pin.laws.{name}")) for name in modules]
    return {name: value for names in found for name, value in names.items() if isinstance(value, Law)}


def random_parameters(law, rng, count):
    """Return numbers of order one for rows of a law, shape (parameters, count)."""
    drawn = {name: rng.uniform(*RANGES.get(name, (0.1, 2.0)), count) for name in law.parameters}
    if "stribeck_exponent" in drawn:
        drawn["stribeck_exponent"] = rng.integers(1, 3, count)
    return np.array(list(drawn.values()), dtype=float)


def random_rows(rng, count):
    """Return arguments of rows, all of order one: to and fro, pushed and pulled, pressed."""
    length, speed, state = rng.normal(size=(3, count))
    load, command, curvature = rng.uniform([[0.0], [-0.5], [0.0]], 3.0, (3, count))
    return Row(length, speed, state, load, command, curvature, reading=0.3 * length)


class ComplexNumPy:
    """NumPy for numbers whose tiny imaginary part carries a derivative."""

    def __getattr__(self, name):
        """Return NumPy's function, which is the same for complex numbers."""
        return getattr(np, name)

    @staticmethod
    def sign(x):
        return np.sign(np.real(x))

    @staticmethod
    def abs(x):
        return x * np.sign(np.real(x))

    @staticmethod
    def maximum(a, b):
        return np.where(np.real(a) >= np.real(b), a, b)

    @staticmethod
    def minimum(a, b):
        return np.where(np.real(a) <= np.real(b), a, b)

    @staticmethod
    def hypot(a, b):
        return np.sqrt(a * a + b * b)


def for_complex(function):
    """Return a function of a law, with all that it calls, for complex numbers."""
    code, known = function.__code__, function.__globals__
    called = {name: known[name] for name in code.co_names if isinstance(known.get(name), FunctionType)}
    world = {**known, **{name: for_complex(each) for name, each in called.items()}, "np": ComplexNumPy()}
    return FunctionType(code, world, function.__name__, function.__defaults__, function.__closure__)
