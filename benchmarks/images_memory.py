"""How much memory a reduction needs at most, in a process of its own: ``images_memory.py MODE`` prints JSON.

`traced` counts what Python's allocators gave at once, `resident` is by how much the process grew as the system counts
it (Linux); both with the frames, and as multiples of their size.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from images_case import FUSED, HEIGHT, PIXELS, STOKES, WIDTH, of_counts
from images_peers import numpy_whole, polanalyser_stokes
from numpy.typing import NDArray

Stack = NDArray[np.uint16]


def fused_into_file(stack: Stack, path: Path) -> None:
    """All maps one after another, by bands."""
    reduction, width = of_counts(FUSED), stack.shape[2]
    with path.open("wb") as file:
        for rows, band in reduction.bands(stack):
            for place, part in enumerate(band):
                file.seek(4 * (place * PIXELS + rows.start * width))
                file.write(part)


def _into_scratch_file(stack: Stack) -> None:
    with tempfile.TemporaryDirectory() as folder:
        fused_into_file(stack, Path(folder) / "maps.f32")


MODES: dict[str, Callable[[Stack], object]] = {
    "S0, S1, S2, new memory": lambda stack: of_counts(STOKES).maps(stack),
    "fused, by bands into a file": _into_scratch_file,
    "fused, whole, new memory": lambda stack: of_counts(FUSED).maps(stack),
    "S0, S1, S2 by numpy, whole": numpy_whole,
    "S0, S1, S2 by polanalyser": polanalyser_stokes,
}


def _resident_bytes(field: str) -> int:
    """`VmRSS` is what the process has now, `VmHWM` what it had at most."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(field))


def report() -> None:
    """Peaks, each in a fresh process."""
    if not Path("/proc/self/clear_refs").exists():
        return  # only Linux tells
    print("\n| multiples of the frames' memory, frames included | traced | resident |\n|---|---|---|")
    for mode in MODES:
        command = [sys.executable, __file__, mode]
        peak = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        print(f"| {mode} | {peak['traced']:.2f} | {peak['resident']:.2f} |")


def main() -> None:
    mode = MODES[sys.argv[1]]
    mode(np.full((4, 64, 64), 900, np.uint16))  # what a first call loads is no memory of pictures
    before = _resident_bytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    stack = frames_alone()
    mode(stack)
    resident = _resident_bytes("VmHWM") - before
    tracemalloc.start()
    mode(stack)
    traced = stack.nbytes + tracemalloc.get_traced_memory()[1]
    print(json.dumps({"traced": traced / stack.nbytes, "resident": resident / stack.nbytes}))


def frames_alone() -> Stack:
    """Frames that took no more memory to make than they have."""
    stack = np.empty((4, HEIGHT, WIDTH), np.uint16)
    random = np.random.default_rng(3)
    for image in stack:
        for row in image:
            row[:] = random.integers(2_000, 30_000, row.size, dtype=np.uint16)
    return stack


if __name__ == "__main__":
    main()
