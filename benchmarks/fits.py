"""Fits a second: many pixels at once beside a loop over SciPy's least squares, and files in processes beside one.

Run with ``make bench-fit``; the figures in docs/many_fits.md come from here. All of a table is measured in one run, in
turns. On one core the clock is the processor's time; on several it is the wall's, and wants a machine with nothing else
to do.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from interleaved import ONE_CORE
from model_peers import three_lobes
from numpy.typing import NDArray
from scipy.optimize import least_squares

from goniometer.many_fits.row import Asked, fit_row
from goniometer.many_fits.workers import fitted_here
from model.fit import lobe_family
from model.fit.observable import Elements
from model.fit.problem import Problem
from model.geometry import angles, in_plane
from model.lobes import Diffuse, Directional, Specular
from model.many_fits.fit_many import ManyFits, fit_many

Array = NDArray[np.float64]

FAMILY = lobe_family(("specular", "diffuse", "directional"), {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
BOUNDS = tuple(np.transpose([FAMILY.free[name] for name in FAMILY.names]))
IRON, GLASS = (0.1764, 2.950, 2.932, 0.7, 0.1, 0.05), (0.15, 1.525, 0.2, 0.7, 0.1, 0.05)
IMAGES = {"iron": (IRON,), "glass, absorbing": (GLASS,), "both, mixed": (IRON, GLASS)}
SPREAD = (0.25, 0.1, 0.1, 0.2, 0.5, 0.5)  # of the parameters among pixels, each way
NOISE = 1e-3
EXIT_DEG = np.arange(61.0)
DIRECTIONS = (np.full(61, np.radians(60.0)), *in_plane(np.radians(EXIT_DEG)))


class Image(NamedTuple):
    """Pixels of one or two materials: what they are made of about, their values and the standard errors of these."""

    about: Array
    values: Array
    stderr: Array


def image(materials: tuple[tuple[float, ...], ...], count: int) -> Image:
    random = np.random.default_rng(count)
    about = np.array(materials)[random.integers(len(materials), size=count)]
    x = about * (1.0 + np.array(SPREAD) * random.uniform(-1.0, 1.0, about.shape))
    values = np.concatenate([light(x[at : at + 1000]) for at in range(0, count, 1000)])
    stderr = np.hypot(1e-5, NOISE * values[..., :1]) * np.ones(3)
    return Image(about, values + stderr * random.standard_normal(values.shape), stderr)


def light(x: Array) -> Array:
    nothing = np.zeros((len(x), 3, 61)), np.zeros((1, 3, 3, 61))
    return Problem(FAMILY, Elements(), DIRECTIONS, *nothing).light(x, np.arange(len(x)))[0].transpose(0, 2, 1)


def by_hand(x: Array) -> Array:
    """S0, S1, S2 in NumPy, written for these three lobes and one bounce."""
    return np.stack(three_lobes(np, np.where, *DIRECTIONS, x), axis=1)


def by_formulas(x: Array) -> Array:
    """The same from the project's own formulas, which work on arrays as they are."""
    sigma, n, k, *weights = x
    at, total = angles(*DIRECTIONS), np.zeros((61, 3))
    for lobe, weight in zip((Specular, Diffuse, Directional), weights, strict=True):
        index = () if lobe is Diffuse else (complex(n, k),)
        one = lobe(weight, sigma, *index)
        form = one.form(frozenset())
        matrix = form.function(at, one.numbers, *form.options)
        total += np.stack([np.broadcast_to(row[0], 61) for row in matrix[:3]], axis=1)
    return total


def loop(pixels: Image, model: Callable[[Array], Array]) -> Array:
    """Parameters of all pixels, one after another, each from what its material is about."""
    return np.array(
        [
            least_squares(
                lambda x, measured=measured, stderr=stderr: ((model(x) - measured) / stderr).ravel(),
                about,
                bounds=BOUNDS,
                x_scale=about,
            ).x
            for about, measured, stderr in zip(*pixels, strict=True)
        ]
    )


def ours(pixels: Image, executor: Executor | None = None) -> ManyFits:
    return fit_many(DIRECTIONS, pixels.values, FAMILY, stderr=pixels.stderr, executor=executor)


def timed(call: Callable[[], object], clock: Callable[[], float]) -> float:
    start = clock()
    call()
    return clock() - start


def on_one_core(rounds: int, sample: int, count: int) -> Iterator[str]:
    """Rows: what a fit takes in microseconds, ours and SciPy's, and how many of SciPy's ours is worth."""
    for name, materials in IMAGES.items():
        pixels = image(materials, count)
        some = Image(*(array[:sample] for array in pixels))
        calls = {
            "ours": (lambda pixels=pixels: ours(pixels), count),
            "by hand": (lambda some=some: loop(some, by_hand), sample),
            "formulas": (lambda some=some: loop(some, by_formulas), sample),
        }
        ours(some)
        taken: dict[str, list[float]] = {key: [] for key in calls}
        for _ in range(rounds):  # in turns, so that all share the machine's moods
            for key, (call, fits) in calls.items():
                taken[key].append(timed(call, ONE_CORE) / fits)
        times = {key: np.array(samples) for key, samples in taken.items()}
        ratios = {key: np.median(times[key] / times["ours"]) for key in ("by hand", "formulas")}
        yield (
            f"| {name} | {1e6 * np.median(times['ours']):.0f} µs | {1e3 * np.median(times['by hand']):.1f} ms "
            f"| {ratios['by hand']:.0f} | {1e3 * np.median(times['formulas']):.1f} ms | {ratios['formulas']:.0f} "
            f"| {compared(some)} |"
        )


def compared(pixels: Image) -> str:
    """How far SciPy's answers, brought to the end, are from ours."""
    many = ours(pixels)
    low, high = BOUNDS
    worst, elsewhere = 0.0, 0
    for x, chi_square, about, measured, stderr in zip(many.parameters, many.chi_square, *pixels, strict=True):
        end = least_squares(
            lambda x, measured=measured, stderr=stderr: ((by_hand(x) - measured) / stderr).ravel(),
            about,
            jac="3-point",
            bounds=(low, high),
            x_scale=about,
            ftol=1e-14,
            xtol=1e-14,
            gtol=1e-14,
        )
        if 2.0 * end.cost > chi_square + 1e-3:
            elsewhere += 1
        else:
            worst = max(worst, float(np.abs(end.x / x - 1.0).max()))
    return f"{worst:.0e}" + (f", {elsewhere} elsewhere" if elsewhere else "")


def on_two_cores(counts: tuple[int, ...]) -> Iterator[str]:
    """Rows: fits a second of whole images in this process, and in two others that have started."""
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        for name, materials in IMAGES.items():
            for count in counts:
                pixels = image(materials, count)
                few = Image(*(array[:1000] for array in pixels))
                list(executor.map(ours, [few, few]))
                one_s = timed(lambda pixels=pixels: ours(pixels), time.perf_counter)
                two_s = timed(lambda pixels=pixels: ours(pixels, executor), time.perf_counter)
                lost = (~ours(pixels).settled).sum()
                yield f"| {name}, {count} | {count / one_s:.0f} | {count / two_s:.0f} | {lost} |"


def of_files(count: int, cores: int) -> Iterator[str]:
    """Rows: files fitted a second, one after another and in processes, whose start counts."""
    with tempfile.TemporaryDirectory() as folder:
        pixels = image((IRON,), count)
        paths = [Path(folder) / f"scan{number}.csv" for number in range(count)]
        names = "s0_per_sr,s1_per_sr,s2_per_sr,s0_stderr_per_sr,s1_stderr_per_sr,s2_stderr_per_sr"
        for path, values, stderr in zip(paths, pixels.values, pixels.stderr, strict=True):
            rows = np.column_stack([np.full(61, 60.0), EXIT_DEG, values, stderr])
            np.savetxt(path, rows, "%.17g", ",", header=f"incidence_deg,exit_deg,{names}", comments="")
        fit_row(paths[0], Asked())
        alone_s = timed(lambda: [fit_row(path, Asked()) for path in paths], time.perf_counter)
        processes_s = timed(lambda: list(fitted_here(paths, Asked(), cores)), time.perf_counter)
        yield f"| {count} | {count / alone_s:.0f} | {count / processes_s:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--sample", type=int, default=20, help="pixels of the loop over SciPy")
    parser.add_argument("--short", action="store_true", help="no image of 100 000 pixels")
    asked = parser.parse_args()
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    print(
        "One core, 10 000 pixels of 61 directions and S0, S1, S2; six parameters; a fit, and SciPy's time over ours\n"
    )
    print("| image | ours | SciPy, NumPy by hand | ratio | SciPy, formulas in NumPy | ratio | relative difference |")
    print("|---|---|---|---|---|---|---|")
    for row in on_one_core(asked.rounds, asked.sample, 10_000):
        print(row, flush=True)
    os.sched_setaffinity(0, cores)
    print("\nFits a second, of whole images\n\n| pixels | one process | two | not fitted |\n|---|---|---|---|")
    for row in on_two_cores((10_000,) if asked.short else (10_000, 100_000)):
        print(row, flush=True)
    print(f"\nFiles a second\n\n| files | one after another | {len(cores)} processes |\n|---|---|---|")
    for row in of_files(300, len(cores)):
        print(row, flush=True)


if __name__ == "__main__":
    main()
