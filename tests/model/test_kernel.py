"""Compiled formulas: one direction gives the same bytes wherever it stands, and only what is asked for is computed."""

from __future__ import annotations

import multiprocessing
import os
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from model.kernel import kernel as kernel_module
from model.kernel.expression import Graph, Symbol, Value, exp, guarded, reachable, sin, sqrt
from model.kernel.kernel import Kernel
from model.kernel.lowering import lowered
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from model.vgroove import bounce_mueller

STATE = [1.0, 0.3, -0.2, 0.4]
EVERYTHING = Surface(
    [
        Specular(0.7, 0.4, 1.5 + 0.3j, 0.3, bounces=3),
        Specular(0.2, 0.4, 1.5 + 0.3j, bounces=2, reading="single-fresnel"),
        Diffuse(0.3, 0.4),
        Directional(0.1, 0.4, 1.5 + 0.3j),
    ]
)
PARAMETERS = ("sigma", "n", "rho_s")
Light = Callable[[NDArray, NDArray, NDArray], NDArray]
EVALUATIONS: dict[str, Light] = {
    "mueller": EVERYTHING.mueller,
    "stokes": EVERYTHING.stokes,
    "polarized": lambda *at: EVERYTHING.stokes(*at, STATE),
    "jacobian": lambda *at: EVERYTHING.jacobian(PARAMETERS, *at),
}


def directions(count: int, dtype: str = "float64") -> list[NDArray]:
    random = np.random.default_rng(count)
    angles = [random.uniform(0.0, 1.55, count), random.uniform(0.0, 1.55, count), random.uniform(-3.1, 3.1, count)]
    return [angle.astype(dtype) for angle in angles]


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("name", EVALUATIONS)
def test_a_direction_gives_the_same_bytes_in_any_company(name: str, dtype: str) -> None:
    evaluate, at = EVALUATIONS[name], directions(40, dtype)
    alone = np.stack([evaluate(*direction) for direction in np.transpose(at)])
    assert alone.dtype == dtype
    assert alone.any()
    for count in range(1, 41):
        assert_array_equal(evaluate(*(angle[-count:] for angle in at)), alone[-count:])
    grid = evaluate(*(angle.reshape(5, 8) for angle in at))
    assert_array_equal(grid.reshape(alone.shape), alone)


@pytest.mark.parametrize("name", EVALUATIONS)
def test_and_in_an_array_that_threads_share(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate, at = EVALUATIONS[name], directions(40_003)
    monkeypatch.setattr(kernel_module, "_cores", lambda: 1)
    expected = evaluate(*at)
    parts: list[tuple[int, int]] = []
    run_part = Kernel._part

    def counted(self: Kernel, arrays: list[NDArray], computed: NDArray, start: int, stop: int) -> None:
        parts.append((start, stop))
        run_part(self, arrays, computed, start, stop)

    monkeypatch.setattr(Kernel, "_part", counted)
    monkeypatch.setattr(kernel_module, "_cores", lambda: 3)
    assert_array_equal(evaluate(*at), expected)
    assert len(parts) == 3
    assert sum(stop - start for start, stop in parts) == 40_003
    for position in (0, 13_333, 40_002):
        assert_array_equal(evaluate(*(angle[position] for angle in at)), expected[position])


@pytest.mark.parametrize("name", EVALUATIONS)
def test_one_incidence_gives_the_same_bytes_as_an_array_of_it(name: str) -> None:
    evaluate, (_, exits, azimuths) = EVALUATIONS[name], directions(100)
    for incidence in (0.0, 0.9, np.pi / 2.0):
        assert_array_equal(evaluate(incidence, exits, azimuths), evaluate(np.full(100, incidence), exits, azimuths))


@pytest.mark.parametrize("name", EVALUATIONS)
def test_arrays_in_any_memory_order(name: str) -> None:
    evaluate, at = EVALUATIONS[name], directions(60)
    expected = evaluate(*at)
    backward = [angle[::-1].copy()[::-1] for angle in at]
    columns = [np.asfortranarray(angle.reshape(6, 10)) for angle in at]
    assert_array_equal(evaluate(*backward), expected)
    assert_array_equal(evaluate(*columns).reshape(expected.shape), expected)
    assert_array_equal(evaluate(*(angle.tolist() for angle in at)), expected)


@pytest.mark.parametrize(("incidence", "exits"), [(0.3, []), ([], 0.3), ([], []), (np.zeros((3, 1)), np.zeros((1, 0)))])
def test_no_directions_give_no_light(incidence: object, exits: object) -> None:
    shape = np.broadcast_shapes(np.shape(incidence), np.shape(exits))
    assert EVERYTHING.mueller(incidence, exits, 1.0).shape == (*shape, 4, 4)
    assert EVERYTHING.stokes(incidence, exits, 1.0).shape == (*shape, 4)
    assert EVERYTHING.stokes(incidence, exits, 1.0, STATE).shape == (*shape, 4)
    assert EVERYTHING.jacobian(PARAMETERS, incidence, exits, 1.0).shape == (*shape, 4, 3)
    assert bounce_mueller(2, incidence, exits, 1.0, sigma=0.3, asymmetry=0.0, index=2.0 + 0j).shape == (*shape, 4, 4)


def test_outputs_that_are_numbers_are_filled_in() -> None:
    def formula(at: Mapping[str, Symbol]) -> list[Value]:
        return [2.5, at["x"] + 1.0, 0.0]

    outputs = Kernel(formula, ["x"], frozenset(), "float64")([np.array([1.0, 2.0])], 2)
    assert outputs.tolist() == [[2.5, 2.5], [2.0, 3.0], [0.0, 0.0]]
    assert Kernel(lambda at: [7.0], ["x"], frozenset(), "float32")([np.zeros(3, "float32")], 3).tolist() == [[7.0] * 3]


def test_inputs_are_left_as_they_are() -> None:
    at = directions(40_003)
    copies = [angle.copy() for angle in at]
    EVERYTHING.stokes(*at)
    for angle, copy in zip(at, copies, strict=True):
        assert_array_equal(angle, copy)


@pytest.mark.parametrize("uniform", [frozenset(), frozenset("a")])
def test_guards_within_guards_and_beside_them(uniform: frozenset[str]) -> None:
    # Each expression is needed by one block, by two, by one in another, or by a block and the world outside.
    def formula(at: Mapping[str, Symbol]) -> list[Value]:
        x, a = at["x"], at["a"]
        shared, within, outside, value = exp(-x * x), sqrt(x + 3.0), sin(x) * a, x * x * a
        inner = guarded(x < 0.5, within * outside + shared)
        outer = guarded(x > -0.5, inner * within + shared)
        return [
            outer + guarded(a < x, outside),
            inner - outside,
            guarded(x > 5.0, sin(shared)),
            guarded(a < 0.5, a),
            guarded(x > 0.1, value),
            value - x,
        ]

    kernel = Kernel(formula, ["x", "a"], uniform, "float64")
    for offset in (0.0, 0.7, -0.9):  # every lane in a block, some, none
        for width in (2.0, 0.01):
            x = offset + width * np.linspace(-1.0, 1.0, 203)
            a = np.array([0.3]) if uniform else np.full(203, 0.3)
            expected = np.stack([np.broadcast_to(value, x.shape) for value in formula({"x": x, "a": a})])
            np.testing.assert_allclose(kernel([x, a], 203), expected, rtol=0.0, atol=2e-15)


def operations(surface: Surface, light: str) -> int:
    """How many operations the surface's kernel has."""
    program = surface._program(light)  # type: ignore[arg-type]
    graph = Graph()
    names = ["incidence", "exit", "azimuth", "s0", "s1", "s2", "s3", *program.inputs]
    outputs = lowered(program.record({name: graph.input(name) for name in names}), "float64")
    return len(reachable([output for output in outputs if isinstance(output, Symbol)]))


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_a_column_takes_fewer_operations_than_the_matrix(bounces: int) -> None:
    surface = Surface([Specular(0.7, 0.4, 1.5 + 0.3j, bounces=bounces), Diffuse(0.3, 0.4)])
    column, product, matrix = (operations(surface, light) for light in ("unpolarized", "stokes", "mueller"))
    assert column < product
    assert column < matrix - 4


def test_lobes_that_share_a_facet_compute_it_once() -> None:
    specular, diffuse = Specular(0.7, 0.4, 1.5 + 0.3j), Diffuse(0.3, 0.4)
    both = operations(Surface([specular, diffuse]), "mueller")
    assert both < 0.8 * (operations(Surface([specular]), "mueller") + operations(Surface([diffuse]), "mueller"))


def test_first_calls_from_many_threads_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Lobes of a kind that no other test has: every thread comes before there is a kernel, here or on disk.
    monkeypatch.setenv("GONIOMETER_CACHE_DIR", str(tmp_path))
    directional = Directional(0.1, 0.4, 3.0 + 0j)
    surfaces = [Surface([Specular(0.5, 0.4, 2.0 + 1.0j, bounces=count), directional]) for count in (5, 6)]
    at, start = directions(500), Barrier(8)

    def first_call(number: int) -> NDArray:
        start.wait(timeout=60.0)
        return surfaces[number % 2].mueller(*at)

    with ThreadPoolExecutor(8) as threads:
        results = list(threads.map(first_call, range(8)))
    for number, result in enumerate(results):
        assert_array_equal(result, surfaces[number % 2].mueller(*at))
        assert result.any()
    assert len(list(tmp_path.iterdir())) == 2  # one file a kernel, and none half written


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_a_forked_process_computes_on_several_threads_too() -> None:
    surface, exits = Surface([Diffuse(1.0, 0.3)]), np.linspace(0.0, 1.5, 40_000)
    expected = surface.stokes(1.0, exits, 2.0)  # starts this process's threads
    forked = multiprocessing.get_context("fork")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # that threads are not forked is what is tested
        child = forked.Process(target=lambda: os._exit(int(not (surface.stokes(1.0, exits, 2.0) == expected).all())))
        child.start()
    child.join(30.0)
    ended = child.exitcode
    child.kill()
    assert ended == 0


@pytest.mark.parametrize("count", [1, 2, 5, 7, 8, 9])
def test_many_sets_give_what_each_gives_alone_however_few_values_they_have(count: int) -> None:
    kernel = Kernel(lambda at: [at["x"] * at["y"], at["x"] + at["a"]], ["x", "y", "a"], frozenset(["a"]), "float64")
    random = np.random.default_rng(count)
    x, y, a = random.uniform(size=(3, count)), random.uniform(size=(1, count)), random.uniform(size=(3, 1))
    found = kernel.repeated([x, y, a], 3, count)
    assert_array_equal(found, np.stack([x * y, x + a], axis=1))
