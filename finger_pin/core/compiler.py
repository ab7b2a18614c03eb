"""The compiler, numba: from a function to machine code. It is imported when something is to be compiled."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FunctionType
from typing import Any

import numba
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.sigutils import normalize_signature
from numba.extending import typeof_impl

from finger_pin.core.compilation import Later

# After so many new objects garbage is looked for.
_OFTEN = 100_000
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    # IEEE arithmetic is kept, so that NaN stays NaN; only a product and a sum may be fused.
    "fastmath": {"contract"},
    # Nothing is allocated, so reference counting, which would cost half of the time, is left out; and the
    # tables of arrays that every function takes are free to pass only when calls are inlined.
    "_nrt": False,
    "nogil": True,
    "forceinline": True,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
# What an earlier process has left on disk runs where numba was never imported: it may call nothing of numba's.
_NOT_PORTABLE = ("numba_", "NRT_", "Py", "_Py", "__svml")


class _Text(JITCodeLibrary):
    """Code that is only inlined: what calls it optimises it, and it becomes no machine code of its own.

    That saves a fourth of all compiling. Numba asks a library's generator for one thing only here, to store an address.
    """

    @property
    def codegen(self) -> _Text:
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Store nothing: there is no machine code that would read it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Whole(JITCodeLibrary):
    """Code that is optimised, and loaded by others."""

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def machine_code(self) -> bytes:
        """Return it as an object file."""
        return bytes(self._codegen._tm.emit_object(self._final_module))

    @property
    def portable(self) -> bool:
        """Whether it runs where there is no numba."""
        called = [each.name for each in self._final_module.functions if each.is_declaration]
        return not any(name.startswith(_NOT_PORTABLE) for name in called)


class _TextCompiler(Compiler):
    """Compiles to `_Text`."""

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, library or _Text(target.codegen(), "inlined"), *rest)


@typeof_impl.register(Later)
def _type_of(value: Later, _context: Any) -> Any:
    """Tell numba the type of what is made now; it may be new to numba, too."""
    made, typing = value.made, cpu_target.typing_context
    typing.refresh()
    return typing.resolve_value_type(made)


def inlined(function: Callable[..., Any], **options: Any) -> Any:
    """Return a function compiled to be inlined."""
    return numba.njit(**{**_OPTIONS, **options}, pipeline_class=_TextCompiler)(function)


@contextmanager
def _tidy() -> Iterator[None]:
    """Look for garbage meanwhile: a compiler leaves much of it, and commands look for it rarely."""
    rarely, *rest = gc.get_threshold()
    gc.set_threshold(min(rarely, _OFTEN), *rest)
    try:
        yield
    finally:
        gc.set_threshold(rarely, *rest)


def machine_code(signature: str, function: FunctionType, name: str) -> tuple[bytes, bool]:
    """Compile a function for C under a name; return an object file, and whether it needs nothing of numba's.

    Nothing tells the caller of an exception: the functions are those that raise none.
    """
    arguments, result = normalize_signature(signature)
    with global_compiler_lock, _tidy():
        dispatcher = inlined(function)
        dispatcher.compile(result(*arguments))
        (compiled,) = dispatcher.overloads.values()
        target = cpu_target.target_context
        module = target.create_module(name)
        kinds = [target.get_value_type(kind) for kind in arguments]
        outer = ir.Function(module, ir.FunctionType(target.get_value_type(result), kinds), name)
        called = target.call_conv.get_function_type(result, arguments)
        inner = ir.Function(module, called, compiled.fndesc.llvm_func_name)
        builder = ir.IRBuilder(outer.append_basic_block())
        _, value = target.call_conv.call_function(builder, inner, result, arguments, outer.args)
        builder.ret(value)
        whole = _Whole(target.codegen(), name)
        whole.add_ir_module(module)
        whole.add_linking_library(compiled.library)
        whole.finalize()
        return whole.machine_code(), whole.portable
