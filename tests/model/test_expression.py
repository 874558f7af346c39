"""Formulas recorded as graphs: what is simplified, what is held once, and that recording changes no value."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.geometry import angles
from model.groove_reflectance import groove_mueller
from model.kernel.derivative import derivatives
from model.kernel.expression import (
    Graph,
    Symbol,
    Value,
    apply,
    atan2,
    both,
    cos,
    either,
    exp,
    guarded,
    hypot,
    maximum,
    minimum,
    nearest,
    reachable,
    sin,
    sqrt,
    where,
)
from model.kernel.kernel import Kernel
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from model.vgroove import bounce_mueller

DIRECTIONS = np.random.default_rng(3).uniform([[0.0], [0.0], [-3.2]], [[1.55], [1.55], [3.2]], (3, 2000))


@pytest.fixture
def x() -> Symbol:
    return Graph().input("x")


@pytest.mark.parametrize(
    "formula",
    [
        lambda x: x + 0.0,
        lambda x: 0.0 + x,
        lambda x: x - 0.0,
        lambda x: x * 1.0,
        lambda x: 1.0 * x,
        lambda x: x / 1.0,
        lambda x: -(0.0 - x),
        lambda x: -1.0 * (x * -1.0),
        lambda x: 0.0 - (0.0 - x),
        lambda x: where(True, x, 1.0 / x),
        lambda x: where(False, 1.0 / x, x),
        lambda x: where(x < 1.0, x, x),
        lambda x: guarded(True, x),
    ],
)
def test_what_changes_nothing_leaves_no_trace(x: Symbol, formula: Callable[[Symbol], Value]) -> None:
    assert formula(x) is x


@pytest.mark.parametrize(
    "formula",
    [
        lambda x: 0.0 * x,
        lambda x: x * 0.0,
        lambda x: 0.0 / x,
        lambda x: guarded(False, x),
        lambda x: guarded(x < 1.0, 0.0),
        lambda x: 0.0 * sin(x) + x * 0.0,
        lambda x: where(x < 1.0, 0.0, 0.0),
    ],
)
def test_what_is_nothing_is_the_number_0(x: Symbol, formula: Callable[[Symbol], Value]) -> None:
    assert formula(x) == 0.0


def test_numbers_are_computed_while_recording() -> None:
    graph = Graph()
    half = graph.constant(0.5)
    assert sqrt(half * half) + exp(0.0 * half) == 1.5
    assert where(half < 1.0, 2.0, 3.0) == 2.0


def test_equal_expressions_are_one(x: Symbol) -> None:
    y = x.graph.input("y")
    assert sin(x) * y + 1.0 is 1.0 + y * sin(x)
    assert minimum(x, y) is minimum(y, x)
    assert x.graph.input("x") is x
    assert x - y is not y - x
    assert len(reachable([(x + y) * (y + x)])) == 4  # two inputs, their sum, its square


def test_zeros_of_both_signs_are_told_apart() -> None:
    graph = Graph()
    assert graph.constant(0.0) is not graph.constant(-0.0)


def test_what_is_not_asked_for_is_not_reached(x: Symbol) -> None:
    sine = sin(x)
    cos(x)
    assert isinstance(sine, Symbol)
    assert {symbol.operation for symbol in reachable([sine])} == {"input", "sin"}


def test_every_symbol_comes_after_its_arguments() -> None:
    graph = Graph()
    outputs = [
        value for value in _light(graph, Surface([Specular(0.7, 0.3, 2.0 + 1.0j, 0.2, 2)])) if isinstance(value, Symbol)
    ]
    place = {symbol.serial: position for position, symbol in enumerate(reachable(outputs))}
    assert len(place) > 300
    for symbol in reachable(outputs):
        assert all(place[argument.serial] < place[symbol.serial] for argument in symbol.arguments)


def test_a_symbol_has_no_truth_value(x: Symbol) -> None:
    for question in (lambda: bool(x), lambda: 0.0 < x < 1.0, lambda: x if x < 1.0 else 1.0, lambda: not x):
        with pytest.raises(TypeError, match="neither true nor false: use where"):
            question()


def test_an_operation_without_a_rule_has_no_derivative(x: Symbol) -> None:
    with pytest.raises(KeyError, match="nearest has no derivative"):
        derivatives([nearest(x)], {"x": 1.0})


def test_an_operation_that_only_symbols_have_refuses_numbers() -> None:
    with pytest.raises(AssertionError, match="only symbols"):
        apply("nearest", 1.5)


OPERATIONS: dict[str, Callable[[Value, Value], Value]] = {
    "arithmetic": lambda x, y: (x - 2.0) * y / (3.0 + x) - (1.0 - y) / x + -y,
    "signs": lambda x, y: abs(x - y) + abs(-x),
    "roots": lambda x, y: sqrt(abs(x)) + hypot(x, 1e200 * y) * 1e-200 + hypot(0.0 * x, 0.0),
    "elementary": lambda x, y: sin(x) + cos(3.0 * y) + exp(-abs(x)) + atan2(y, abs(x)),
    "extremes": lambda x, y: minimum(x, y, 0.3) + 10.0 * maximum(x, y, -0.2),
    "branches": lambda x, y: where(either(both(x < y, y <= 1.0), x > 1.5), x, where(x >= 0.2, y, 7.0)),
    "guards": lambda x, y: guarded(x > 0.5, sqrt(maximum(x, 0.5))) + guarded(y < x, guarded(x > 1.0, y)),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_formula_on_arrays_is_the_formula_compiled(name: str) -> None:
    formula = OPERATIONS[name]
    x, y = np.random.default_rng(0).uniform(-2.0, 2.0, (2, 1001))
    compiled = Kernel(lambda at: [formula(at["x"], at["y"])], ["x", "y"], frozenset(), "float64")
    with np.errstate(invalid="ignore"):
        expected = formula(x, y)
    assert_allclose(compiled([x, y], x.size)[0], expected, rtol=0.0, atol=2e-15 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("asymmetry", [0.0, 0.3])
@pytest.mark.parametrize("bounces", [1, 2, 3, 4])
def test_grooves_on_arrays_are_grooves_compiled(bounces: int, asymmetry: float) -> None:
    with np.errstate(all="ignore"):
        direct = groove_mueller(angles(*DIRECTIONS), [bounces], 0.6, asymmetry, 1.5, 0.7)
    compiled = bounce_mueller(bounces, *DIRECTIONS, sigma=0.6, asymmetry=asymmetry, index=1.5 + 0.7j)
    lit = compiled[:, 0, 0] > 1e-20
    assert lit.sum() > 300
    expected = np.array([[np.broadcast_to(element, DIRECTIONS.shape[1:]) for element in row] for row in direct])
    excess = np.abs(np.moveaxis(expected, -1, 0) - compiled)[lit].max(axis=(-1, -2)) / compiled[lit, 0, 0]
    # Far slopes, and edges of what is visible, magnify the last bit of an angle.
    assert excess.max() < 1e-11
    assert np.median(excess) < 2e-15


@pytest.mark.parametrize(
    "lobe",
    [
        Specular(0.7, 0.4, 0.6 + 0.1j, bounces=3, reading="single-fresnel"),
        Diffuse(0.3, 0.4, "exact"),
        Directional(0.2, 0.4, 1.5 + 0j, exponent=2),
    ],
    ids=lambda lobe: type(lobe).__name__,
)
def test_lobes_on_arrays_are_lobes_compiled(lobe: Specular | Diffuse | Directional) -> None:
    form = lobe.form(frozenset())
    direct = form.function(angles(*DIRECTIONS), lobe.numbers, *form.options)
    compiled = Surface([lobe]).mueller(*DIRECTIONS)
    expected = np.array([[np.broadcast_to(element, DIRECTIONS.shape[1:]) for element in row] for row in direct])
    scale = compiled[:, :1, :1] + 1e-250
    assert_allclose(np.moveaxis(expected, -1, 0) / scale, compiled / scale, rtol=0.0, atol=1e-12)


def _light(graph: Graph, surface: Surface) -> list[Value]:
    """What the surface's lobes make of unpolarized light, recorded."""
    at = angles(*(graph.input(name) for name in ("incidence", "exit", "azimuth")))
    outputs: list[Value] = []
    for lobe in surface.lobes:
        form = lobe.form(frozenset())
        matrix = form.function(at, {name: graph.input(name) for name in lobe.numbers}, *form.options)
        outputs += [row[0] for row in matrix]
    return outputs
