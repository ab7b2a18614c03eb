"""Arguments that are bound once are the arguments that compiled code sees."""

from typing import NamedTuple

import numpy as np
import pytest

from finger_pin.core.jit import CompiledFunction, Indices, Layers, Matrix, StructType, Vector, pack, unpack


class Inner(NamedTuple):
    flag: bool
    table: Matrix
    count: int


class Outer(NamedTuple):
    indices: Indices
    inner: Inner
    vector: Vector
    factor: float
    layers: Layers


KIND = StructType(Outer)


@CompiledFunction
def weigh(address, _number):
    """Sum every field with a weight of its own, by its shape; change the vector in place."""
    value = unpack(address, KIND)
    total = value.factor * value.inner.count + (100.0 if value.inner.flag else 200.0)
    for i in range(value.indices.size):
        total += 1e3 * (i + 1) * value.indices[i]
    for i in range(value.inner.table.shape[0]):
        for j in range(value.inner.table.shape[1]):
            total += (3 * i + 7 * j) * value.inner.table[i, j]
    for i in range(value.layers.shape[0]):
        total += (i + 1) * value.layers[i].sum()
    for i in range(value.vector.size):
        value.vector[i] += 1.0
    return int(2.0 * total)


@pytest.fixture
def outer():
    return Outer(
        indices=np.array([4, 5], dtype=np.int64),
        inner=Inner(flag=True, table=np.arange(6.0).reshape(2, 3), count=3),
        vector=np.zeros(2),
        factor=0.5,
        layers=np.ones((2, 2, 2)),
    )


@pytest.mark.slow
def test_compiled_code_reads_and_changes_the_very_arrays_that_were_bound(outer):
    block = pack(outer, KIND)
    total = weigh(block.address)
    table = sum((3 * i + 7 * j) * outer.inner.table[i, j] for i in range(2) for j in range(3))
    assert 0.5 * total == 0.5 * 3 + 100.0 + 1e3 * (4 + 2 * 5) + table + (1 + 2) * 4
    outer.inner.table[1, 2] += 1.0
    total = weigh(block.address)
    assert 0.5 * total == 0.5 * 3 + 100.0 + 1e3 * (4 + 2 * 5) + table + 3 + 14 + (1 + 2) * 4
    np.testing.assert_array_equal(outer.vector, [2.0, 2.0])


@pytest.mark.parametrize(
    "change",
    [
        {"vector": np.zeros(4)[::2]},
        {"vector": np.zeros(2, dtype=np.float32)},
        {"layers": np.zeros((2, 2))},
        {"factor": 1},
    ],
    ids=["strided", "single precision", "fewer dimensions", "integer"],
)
def test_tables_that_would_be_misread_are_refused_when_packed(outer, change):
    with pytest.raises(TypeError, match="cannot be packed"):
        pack(outer._replace(**change), KIND)
