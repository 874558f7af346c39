"""Compiled sine, cosine, exponential and arctangent against those of the next wider type, in units of the last bit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from model.kernel.elementary import Precision
from model.kernel.expression import Value, atan2, cos, exp, sin
from model.kernel.kernel import Kernel

RANDOM = np.random.default_rng(11)
WIDER: dict[Precision, type[np.floating]] = {"float32": np.float64, "float64": np.longdouble}
PRECISIONS = [
    "float32",
    pytest.param(
        "float64",
        marks=pytest.mark.skipif(np.finfo(np.longdouble).nmant <= 52, reason="no type here is wider than float64"),
    ),
]
BEYOND = {"float32": 1e4, "float64": 1e6}


def computed(function: Callable[..., Value], precision: Precision, *arguments: NDArray[np.floating]) -> NDArray:
    names = ["x", "y"][: len(arguments)]
    kernel = Kernel(lambda at: [function(*(at[name] for name in names))], names, frozenset(), precision)
    return kernel(arguments, arguments[0].size)[0]


def ulps(result: NDArray[np.floating], expected: NDArray[np.floating]) -> NDArray[np.floating]:
    """Distances in units of the last bit that the expected values have in the type of the result."""
    unit = np.spacing(np.abs(expected).astype(result.dtype)).astype(expected.dtype)
    return np.abs(result.astype(expected.dtype) - expected) / unit


def angles(precision: Precision) -> NDArray[np.floating]:
    """All that sine and cosine are for: anywhere, a few roundings beside multiples of pi/2, and tiny."""
    dtype, beyond = np.dtype(precision), BEYOND[precision]
    half_pi = WIDER[precision](np.pi / 2.0) + WIDER[precision](6.123233995736766e-17)
    multiples = (RANDOM.integers(-int(beyond / 1.6), int(beyond / 1.6), 40_000) * half_pi).astype(dtype)
    few = np.tile(np.arange(-200, 201) * half_pi, 100).astype(dtype)
    beside = np.concatenate([multiples, few])
    beside += RANDOM.integers(-3, 4, beside.size) * np.spacing(beside)
    tiny = np.logspace(np.log10(float(np.finfo(dtype).smallest_subnormal)) + 0.1, 0.0, 20_000)
    anywhere = np.concatenate([RANDOM.uniform(-beyond, beyond, 60_000), RANDOM.uniform(-7.0, 7.0, 60_000)])
    return np.concatenate([anywhere, beside, tiny, -tiny]).astype(dtype)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize(("function", "reference"), [(sin, np.sin), (cos, np.cos)])
def test_sine_and_cosine(function: Callable[..., Value], reference: np.ufunc, precision: Precision) -> None:
    x = angles(precision)
    assert x.size > 200_000
    assert ulps(computed(function, precision, x), reference(x.astype(WIDER[precision]))).max() < 1.0


@pytest.mark.parametrize("precision", PRECISIONS)
def test_exponential(precision: Precision) -> None:
    # float64 has no normal results below exp(-708.4) and none at all below -745.1; float32 -87.3 and -103.97.
    least = {"float32": -104.5, "float64": -746.0}[precision]
    dtype = np.dtype(precision)
    tiny = np.logspace(-40.0, 0.0, 20_000)
    x = np.concatenate([RANDOM.uniform(least, 80.0, 100_000), RANDOM.uniform(-1.0, 1.0, 50_000), tiny, -tiny])
    x = x.astype(dtype)
    with np.errstate(under="ignore"):
        expected = np.exp(x.astype(WIDER[precision]))
    result = computed(exp, precision, x)
    assert ulps(result, expected).max() < 1.0
    assert ((result > 0.0) & (result < np.finfo(dtype).tiny)).sum() > 1000  # gradual underflow was met


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_exponential_at_the_ends(precision: Precision) -> None:
    x = np.array([0.0, -0.0, -746.0, -1e4, -1e30, -np.inf], precision)
    assert_array_equal(computed(exp, precision, x), [1.0, 1.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("precision", PRECISIONS)
def test_arctangent(precision: Precision) -> None:
    dtype = np.dtype(precision)
    largest = float(np.log10(np.finfo(dtype).max)) - 1.0
    count = 200_000
    angle = np.concatenate([RANDOM.uniform(-np.pi / 2.0, np.pi / 2.0, count // 2), RANDOM.choice([-0.5, 0.5], 1000)])
    radius = 10.0 ** RANDOM.uniform(-3.0, 3.0, angle.size)
    wide = 10.0 ** RANDOM.uniform(-largest / 2.0, largest / 2.0, (2, count // 2))
    y = np.concatenate([radius * np.sin(angle), wide[0] * RANDOM.choice([-1.0, 1.0], count // 2)]).astype(dtype)
    x = np.concatenate([radius * np.cos(angle), wide[1]]).astype(dtype)
    result = computed(lambda x, y: atan2(y, x), precision, x, y)
    with np.errstate(under="ignore"):
        expected = np.arctan2(y.astype(WIDER[precision]), x.astype(WIDER[precision]))
    normal = np.abs(expected) > np.finfo(dtype).tiny
    assert normal.mean() > 0.9
    assert ulps(result[normal], expected[normal]).max() < {"float32": 2.0, "float64": 1.5}[precision]
    assert_array_equal(np.abs(result) <= dtype.type(np.pi / 2.0), True)


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_arctangent_on_the_axes(precision: Precision) -> None:
    x = np.array([1.0, 0.0, 0.0, 2.0, 3.0, 1e-30], precision)
    y = np.array([0.0, 1.0, -1e-30, 2.0, -3.0, 1e-30], precision)
    expected = np.array([0.0, np.pi / 2.0, -np.pi / 2.0, np.pi / 4.0, -np.pi / 4.0, np.pi / 4.0])
    assert_array_equal(computed(lambda x, y: atan2(y, x), precision, x, y), expected.astype(precision))


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_symmetries_hold_to_the_last_bit(precision: Precision) -> None:
    x = RANDOM.uniform(0.0, 100.0, 10_000).astype(precision)
    y = RANDOM.uniform(0.0, 100.0, 10_000).astype(precision)
    assert_array_equal(computed(sin, precision, -x), -computed(sin, precision, x))
    assert_array_equal(computed(cos, precision, -x), computed(cos, precision, x))
    assert_array_equal(
        computed(lambda x, y: atan2(-y, x), precision, x, y), -computed(lambda x, y: atan2(y, x), precision, x, y)
    )
