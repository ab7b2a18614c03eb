"""Calls of functions at an address, and reads and writes of memory, in compiled code."""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from typing import Any, TypeAlias

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from finger_pin.core.jit.functions import njit_inline, njit_reassociate
from finger_pin.core.jit.struct_types import Matrix, Vector

# Callers see another signature than numba's.
_generated: Any = intrinsic
#: A signature, and the function that builds the code.
_Generated: TypeAlias = tuple[Any, Callable[..., ir.Value]]


@_generated
def call_at(_typing: Any, function: types.Type, address: types.Type, number: types.Type) -> _Generated:
    """Call the function at an address with the address of a block and a number; return an integer."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        integer = ir.IntType(64)
        kind = ir.FunctionType(integer, [integer, ir.DoubleType()])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int64(types.int64, types.int64, types.float64), generate


@_generated
def _call(_typing: Any, function: types.Type, words: types.Type) -> _Generated:
    """Call the function at an address with some words: addresses of numbers, and numbers of rows."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        words_read = [builder.extract_value(arguments[1], index) for index in range(signature.args[1].count)]
        kind = ir.FunctionType(ir.VoidType(), [each.type for each in words_read])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), words_read)
        return context.get_dummy_value()

    return types.void(types.int64, words), generate


@njit_inline
def call_value(address: int, rows: Matrix, parameters: Matrix, begin: int, end: int) -> None:
    """Evaluate the law at an address for a range of rows."""
    _call(address, (rows.ctypes.data, parameters.ctypes.data, rows.shape[1], begin, end))


@njit_inline
def call_filling(address: int, rows: Matrix, parameters: Matrix, filled: Matrix, begin: int, end: int) -> None:
    """Fill slopes, or energies and powers, by the law at an address for a range of rows."""
    _call(address, (rows.ctypes.data, parameters.ctypes.data, filled.ctypes.data, rows.shape[1], begin, end))


@njit_inline
def call_shape(address: int, points: Vector, p: Vector, out: Vector) -> None:
    """Call the function of a shape at an address with three rows of numbers."""
    _call(address, (points.ctypes.data, p.ctypes.data, out.ctypes.data))


@_generated(prefer_literal=True)
def numbers(
    _typing: Any, table: types.Type, first: types.Type, stride: types.Type, count: types.IntegerLiteral
) -> _Generated:
    """Return a tuple of numbers of a table, ``stride`` apart; their count is a constant."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        values, place = ir.Constant(context.get_value_type(signature.return_type), ir.Undefined), arguments[1]
        for index in range(signature.return_type.count):
            values = builder.insert_value(values, builder.load(builder.gep(arguments[0], [place])), index)
            place = builder.add(place, arguments[2])
        return values

    return types.UniTuple(types.float64, count.literal_value)(table, types.int64, types.int64, count), generate


@_generated
def put(_typing: Any, table: types.Type, first: types.Type, stride: types.Type, values: Any) -> _Generated:
    """Write a tuple of numbers into a table, ``stride`` apart."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        place = arguments[1]
        for index, kind in enumerate(values):
            value = context.cast(builder, builder.extract_value(arguments[3], index), kind, types.float64)
            builder.store(value, builder.gep(arguments[0], [place]))
            place = builder.add(place, arguments[2])
        return context.get_dummy_value()

    return types.void(table, types.int64, types.int64, values), generate


def load(kind: types.Type) -> Callable[[int], Any]:
    """Return a function that reads one number of a type at an address."""

    @_generated
    def load(_typing: Any, address: types.Type) -> _Generated:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
            return builder.load(builder.inttoptr(arguments[0], context.get_value_type(kind).as_pointer()))

        return kind(address), generate

    return load


def view(kind: types.Type) -> Callable[[int], MutableSequence[Any]]:
    """Return a function that gives the numbers of a type at an address, by index.

    An array of numba's would ask of each index whether it is negative.
    """

    @_generated
    def view(_typing: Any, address: types.Type) -> _Generated:
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
            return builder.inttoptr(arguments[0], context.get_data_type(kind).as_pointer())

        return types.CPointer(kind)(address), generate

    return view


@_generated
def scratch(_typing: Any, count: types.Type) -> _Generated:
    """Return the address of a buffer on the caller's stack, free of allocation."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        return builder.ptrtoint(builder.alloca(ir.DoubleType(), size=arguments[0]), ir.IntType(64))

    return types.int64(types.int64), generate


@njit_inline
def copy(source: Vector, target: Vector) -> None:
    """Copy a vector; an assignment to a slice would take a second more to compile, for its error's text."""
    for index in range(source.size):
        target[index] = source[index]


@njit_inline
def copy_matrix(source: Matrix, target: Matrix) -> None:
    """Copy a matrix, as `copy` does."""
    for r in range(source.shape[0]):
        for c in range(source.shape[1]):
            target[r, c] = source[r, c]


@njit_reassociate
def sum_products(first: Vector, second: Vector, size: int) -> float:
    """Return the sum of products of the first numbers of two arrays, in any order."""
    total = 0.0
    for c in range(size):
        total += first[c] * second[c]
    return total
