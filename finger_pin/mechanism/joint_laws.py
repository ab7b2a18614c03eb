"""Laws of joint friction by name: the package's, and a user's "module:NAME"."""

from __future__ import annotations

import importlib
import os
import sys

from finger_pin.exceptions import InputError
from finger_pin.laws.bristle import PIN_FRICTION
from finger_pin.laws.law import Law
from finger_pin.laws.pin import PIN_LAWS, SIGNALS

#: Environment variable with the modules that a scenario may import, separated by commas.
LAWS = "FINGER_PIN_LAWS"
# Parameters of the joints that a law may name.
_PARAMETERS = (*PIN_FRICTION.parameters, "reversal_speed")


def joint_law(name: str) -> Law:
    """Return a law of joint friction by its name, or a user's law as "module:NAME"."""
    if name in PIN_LAWS:
        return PIN_LAWS[name]
    law = _imported(name)
    if not isinstance(law, Law):
        raise InputError("finger.joint_friction.law", f"must be a Law, not {type(law).__name__}", name)
    for kind, has, required in (("parameters", _PARAMETERS, law.parameters), ("signals", law.signals, SIGNALS)):
        if lacking := [each for each in required if each not in has]:
            allowed = f"the law's {kind} must be some of" if kind == "parameters" else "the law must have the signals"
            names = ", ".join(_PARAMETERS if kind == "parameters" else SIGNALS)
            raise InputError("finger.joint_friction.law", f"{allowed} {names}: see {', '.join(lacking)}", name)
    return law


def _imported(name: str) -> object:
    """Return the object "module:NAME"; no module is imported unless `LAWS` allows it, since that runs its code."""
    module, _, attribute = name.partition(":")
    allowed = {text.strip() for text in os.environ.get(LAWS, "").split(",")}
    if module not in sys.modules and module not in allowed:
        text = f"runs code of the module {module}: if you trust it, import {module} first or set {LAWS}={module}"
        raise InputError("finger.joint_friction.law", text, name)
    try:
        # Attributes that a module computes when asked would run its code, too.
        return vars(importlib.import_module(module))[attribute]
    except ImportError as error:
        raise InputError("finger.joint_friction.law", f"cannot be imported: {error}", name) from None
    except KeyError:
        text = f"cannot be imported: {module} has no {attribute}"
        raise InputError("finger.joint_friction.law", text, name) from None
