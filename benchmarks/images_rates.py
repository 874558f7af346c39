"""Rates at which pictures become Stokes parameters, taken in turns: ours, the limit, and those of peers.

The limit is a kernel that reads the same pictures and writes as many maps into the same memory, and computes nothing.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

import images_peers
import numpy as np
from images_case import EVERYTHING, FUSED, HEIGHT, INVERSE, NOISE, PIXELS, STOKES, WIDTH, limit, of_counts, of_signals
from images_memory import fused_into_file
from interleaved import interleaved_s, ratio

SETS = {"S0, S1, S2": STOKES, "fused": FUSED, "everything": EVERYTHING}
GIVEN, NEW, BANDS = "given memory", "new memory", "bands"
MEMORY = np.zeros((len(EVERYTHING), HEIGHT, WIDTH), np.float32)
"""Of all who are given memory: none writes into a better place than another."""

Calls = dict[tuple[str, ...], Callable[[], object]]


def exhausted(bands: Callable[[], Iterator[object]]) -> None:
    for _ in bands():
        pass


def all_calls(stack, of_camera, folder) -> Calls:
    """What is timed, by what is asked, where it goes, and who does it."""
    calls: Calls = {}
    for asked, outputs in SETS.items():
        ours, nothing, pictures = of_counts(outputs), limit(len(outputs)), list(stack)
        out = MEMORY[: len(outputs)]
        calls[asked, GIVEN, "ours"] = partial(ours.maps, stack, out)
        calls[asked, GIVEN, "limit"] = partial(nothing.maps, pictures, out)
        calls[asked, NEW, "ours"] = partial(ours.maps, stack)
        calls[asked, NEW, "limit"] = partial(nothing.maps, pictures)
        calls[asked, BANDS, "ours"] = partial(exhausted, partial(ours.bands, stack))
        calls[asked, BANDS, "limit"] = partial(exhausted, partial(nothing.bands, pictures))
        has_variances = outputs != STOKES
        nothing = limit(len(outputs), 0, 8 if has_variances else 4)
        pictures = [image.signal for image in of_camera] + [image.variance for image in of_camera] * has_variances
        calls[asked, GIVEN, "ours, of signals"] = partial(of_signals(outputs).maps, of_camera, out)
        calls[asked, GIVEN, "limit, of signals"] = partial(nothing.maps, pictures, out)
    flat, beside = MEMORY.reshape(len(MEMORY), -1), MEMORY[:3].reshape(HEIGHT, WIDTH, 3)
    calls["S0, S1, S2", NEW, "numpy, whole"] = partial(images_peers.numpy_whole, stack)
    calls["S0, S1, S2", GIVEN, "numpy, blocks"] = partial(images_peers.numpy_blocks, stack, flat[:3])
    calls["fused", GIVEN, "numpy, blocks"] = partial(images_peers.numpy_blocks_fused, stack, flat[:8])
    calls["S0, S1, S2", GIVEN, "cv2.transform"] = partial(images_peers.opencv, stack, beside)
    calls["S0, S1, S2", NEW, "polanalyser"] = partial(images_peers.polanalyser_stokes, stack)
    calls["fused", NEW, "polanalyser, no variances"] = partial(images_peers.polanalyser_fused, stack)
    calls["fused", "file", "ours"] = partial(fused_into_file, stack, folder / "maps.f32")
    calls["copy",] = partial(np.copyto, MEMORY[:3], MEMORY[3:6])
    return calls


def worst(maps, exact, s0) -> float:
    return max(np.abs((found - true) / s0).max() for found, true in zip(maps, exact, strict=True))


def check(stack, of_camera) -> None:
    """Ends where results are not those in double precision: shares of S0 and of variances, DoLP, radians of AoLP."""
    exact, dolp, aolp = images_peers.polanalyser_fused(stack)
    exact, s0 = np.moveaxis(exact, -1, 0), exact[..., 0]
    ours, theirs = of_counts(FUSED).maps(stack), of_signals(FUSED).maps(of_camera)
    by_blocks = images_peers.numpy_blocks_fused(stack, np.empty((8, PIXELS), np.float32)).reshape(8, HEIGHT, WIDTH)
    by_opencv = images_peers.opencv(stack, np.empty((HEIGHT, WIDTH, 3), np.float32))
    found = {
        "ours": [ours[name] for name in STOKES],
        "ours, of signals": [theirs[name] for name in STOKES],
        "numpy, whole": images_peers.numpy_whole(stack).reshape(3, HEIGHT, WIDTH),
        "numpy, blocks": by_blocks[:3],
        "cv2.transform": np.moveaxis(by_opencv, -1, 0),
    }
    off = {f"S of {who}": worst(maps, exact, s0) for who, maps in found.items()}
    for who, (degree, angle) in {"ours": (ours["DoLP"], ours["AoLP_rad"]), "numpy, blocks": by_blocks[6:]}.items():
        off[f"DoLP of {who}"] = np.abs(degree - dolp).max()
        off[f"AoLP of {who}"] = np.abs((angle - aolp + np.pi / 2) % np.pi - np.pi / 2).max()
    variances = np.tensordot(INVERSE**2, stack / NOISE.electrons_per_count + NOISE.read_counts**2, 1)
    for who, maps in {"ours": [ours[f"{name}_variance"] for name in STOKES], "numpy, blocks": by_blocks[3:6]}.items():
        off[f"variances of {who}"] = worst(maps, variances, variances)
    for what, error in off.items():
        print(f"{what}: {error:.1e}")
        limit_of_error = 5e-6 if what.startswith("AoLP") else 2e-6  # S's own rounding, over DoLP
        if not error < limit_of_error:
            sys.exit(f"{what} is too large")


def report(samples) -> None:
    """Megapixels a second, and what share of the limit of the same pictures and memory that is."""
    rate = {key: PIXELS / 1e6 / np.median(times) for key, times in samples.items()}
    copied_gb_s = 2 * MEMORY[:3].nbytes / 1e9 / np.median(samples["copy",])
    print(f"\nnumpy copies: {copied_gb_s:.1f} GB/s, read and written together\n")
    print("| | memory | | Mpx/s | of the limit | of a copy's rate |\n|---|---|---|---|---|---|")
    for (asked, *where), of_rate in ((key, rate[key]) for key in samples if len(key) == 3):
        memory, who = where
        signal = ", of signals" if "signals" in who else ""
        best = (asked, memory, f"limit{signal}")
        share = f"{ratio(samples, best, (asked, memory, who)):.2f}" if best in samples else ""
        pictures = (16 if asked == "S0, S1, S2" else 32) if signal else 8
        of_copy = of_rate * 1e-3 * (pictures + 4 * len(SETS[asked])) / copied_gb_s
        print(f"| {asked} | {memory} | {who} | {of_rate:.0f} | {share} | {of_copy:.2f} |")
    print()
    for asked, peer in (("S0, S1, S2", "polanalyser"), ("fused", "polanalyser, no variances")):
        for memory in (GIVEN, NEW):
            times = ratio(samples, (asked, NEW, peer), (asked, memory, "ours"))
            print(f"{asked}, {memory}: {times:.1f} times the rate of polanalyser")


def report_two_cores(stack, cores) -> None:
    os.sched_setaffinity(0, cores)
    calls = {asked: partial(of_counts(outputs).maps, stack, MEMORY[: len(outputs)]) for asked, outputs in SETS.items()}
    for asked, times in interleaved_s(calls, 15, time.perf_counter).items():
        print(f"{asked}, given memory, {len(cores)} cores: {PIXELS / 1e6 / np.median(times):.0f} Mpx/s")
