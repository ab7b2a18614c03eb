"""The laws that there are, and ways to look at them."""

import importlib
from pathlib import Path

import finger_pin.laws
from finger_pin.laws.law import Law


def every_law():
    """Return all laws of the package by the name that they have in their module."""
    modules = [path.stem for path in sorted(Path(finger_pin.laws.__file__).parent.glob("*.py"))]
    found = [vars(importlib.import_module(f"finger_pin.laws.{name}")) for name in modules]
    return {name: value for names in found for name, value in names.items() if isinstance(value, Law)}
