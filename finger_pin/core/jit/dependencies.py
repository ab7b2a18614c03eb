"""Dependencies of a compiled function: all functions that it calls, and the values that it takes for constants.

Code on disk holds as long as this is the same. Comments, docstrings and line numbers are not part of it.
"""

from __future__ import annotations

import dis
import hashlib
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.extending import is_jitted

_PLAIN = (int, float, complex, str, bytes, bool, type(None), slice)


class Unknown(Exception):
    """A thing without a lasting identity: a later process cannot recognise it."""


def reached(function: FunctionType) -> str:
    """Return a digest of a function with all that it reaches.

    Raises:
        Unknown: If it takes for a constant what is none, or stands in no module that another process could import.
    """
    parts, seen, waiting = {_own_digest(), numba.__version__}, set[int](), [function]
    while waiting:
        each = waiting.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        if each.__module__ not in sys.modules:
            raise Unknown(f"{each.__qualname__} stands in no module")
        # What is kept names the modules that it is of.
        text = [each.__module__, _text(each.__code__, each.__doc__), str(vars(each).get("loose"))]
        for name, value in _values(each):
            if is_jitted(value):
                value = value.py_func
            if isinstance(value, FunctionType):
                waiting.append(value)
            else:
                text.append(f"{name} = {_described(value)}")
        parts.add("\n".join(text))
    return hashlib.sha256("\n\n".join(sorted(parts)).encode()).hexdigest()[:16]


@cache
def _own_digest() -> str:
    """Return a digest of this folder, for the code of calls and fields, which stands in no function."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def _text(code: CodeType, doc: str | None) -> str:
    constants = [_text(each, None) if isinstance(each, CodeType) else repr(each) for each in code.co_consts]
    if doc is not None and code.co_consts and code.co_consts[0] == doc:
        del constants[0]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {code.co_freevars} {constants}"


def _values(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Give the globals, the attributes of modules, the closure and the defaults that a function may read."""
    yield from _globals(function.__code__, function.__globals__)
    cells = function.__closure__ or ()
    yield from ((str(index), cell.cell_contents) for index, cell in enumerate(cells))
    yield "defaults", function.__defaults__


def _globals(code: CodeType, known: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Give the globals that code reads, of modules the attributes."""
    module = None
    for step in dis.get_instructions(code):
        if step.opname == "EXTENDED_ARG":
            continue
        if step.opname == "LOAD_GLOBAL" and step.argval in known:
            value = known[step.argval]
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD") and module is not None:
            value = getattr(module, step.argval)
        else:
            module = None
            continue
        module = value if isinstance(value, ModuleType) else None
        yield step.argval, value if module is None else module.__name__
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _globals(each, known)


def _described(value: Any) -> str:
    if isinstance(value, _PLAIN):
        return repr(value)
    if isinstance(value, numba.types.Type):
        # The kind of a table has its layout.
        return f"{value} {[(name, _described(own)) for name, own in getattr(value, 'fields', {}).items()]}"
    if isinstance(value, tuple):
        return f"{type(value).__qualname__} {[_described(each) for each in value]}"
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    if isinstance(value, BuiltinFunctionType | np.ufunc) or hasattr(value, "__wrapped__"):
        return f"{getattr(value, '__module__', '')}.{value.__name__}"
    raise Unknown(f"{value!r} is no constant of compiled code")
