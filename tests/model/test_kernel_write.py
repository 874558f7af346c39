"""Kernels that write into memory that is there: the same numbers as ever, in the cache or past it, and no others."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from model.kernel import kernel as kernel_module
from model.kernel.elementary import Precision
from model.kernel.expression import Symbol, Value, sqrt
from model.kernel.kernel import Kernel

GUARD = -7.0


def test_a_kernel_keeps_no_graph() -> None:
    """Those of a surface are thousands of objects, and of kernels there may be hundreds."""
    graphs = []

    def formula(at: Mapping[str, Symbol]) -> list[Value]:
        graphs.append(weakref.ref(at["x"].graph))
        return [sqrt(at["x"])]

    kernel = Kernel(formula, ["x"], frozenset(), "float64")
    kernel.write([np.ones(64)], np.empty((1, 64)), past_cache=True)
    gc.collect()
    assert graphs
    assert [graph() for graph in graphs] == [None] * len(graphs)


def a_kernel(precision: Precision) -> Kernel:
    """Two rows computed, and a constant one between them."""
    return Kernel(
        lambda at: [sqrt(at["x"] * at["gain"]), 3.0, at["x"] - at["light"]],
        ["x", "light", "gain"],
        frozenset(["gain"]),
        precision,
        counts=frozenset(["light"]),
    )


@pytest.mark.parametrize("past_cache", [False, True])
@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("count", [1, 5, 8, 16, 17, 31, 33, 48, 100, 20_001])
def test_what_is_written_is_what_a_call_returns_and_its_surroundings_stay(
    precision: Precision, count: int, past_cache: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever rows begin, whatever their distance, and whatever number of threads shares them."""
    monkeypatch.setattr(kernel_module, "_cores", lambda: 2)
    random, kernel = np.random.default_rng(count), a_kernel(precision)
    x = random.uniform(0.5, 2.0, count).astype(precision)
    light = random.integers(0, 65536, count, dtype=np.uint16)
    arrays = [x, light, np.array([2.0], precision)]
    expected = kernel(arrays, count)
    assert_array_equal(expected[0], np.sqrt(x * x.dtype.type(2.0)))
    assert_array_equal(expected[2], x - light.astype(precision))
    for distance in (count, count + 1, (count + 63) // 64 * 64):
        for offset in (0, 1, 3, 15):
            memory = np.full(offset + 3 * distance + 40, GUARD, precision)
            rows = memory[offset : offset + 3 * distance].reshape(3, distance)
            kernel.write(arrays, rows[:, :count], past_cache=past_cache)
            assert_array_equal(rows[:, :count], expected)
            rows[:, :count] = GUARD
            assert_array_equal(memory, GUARD)
