"""What a fresh process waits for its first reflectance: ``model_fresh_process.py LOBES BOUNCES ASYMMETRY`` prints JSON.

``import_s`` holds numpy's own import, ``numpy_s``. Machine code is kept in $GONIOMETER_CACHE_DIR: ``compiled`` says how
many kernels this process has added there. ``ns_per_direction`` is of many directions, when all is compiled.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

REPEATS = 5


def main() -> None:
    lobes, bounces, asymmetry = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    kept = Path(os.environ["GONIOMETER_CACHE_DIR"])
    before = len(list(kept.glob("*.o")))
    start = time.perf_counter()
    import numpy

    numpy_s = time.perf_counter() - start
    import model.acceptance
    import model.lobes
    import model.surface  # noqa: F401

    import_s = time.perf_counter() - start
    from interleaved import interleaved_s
    from model_case import DIRECTIONS, Case

    case = Case(lobes=lobes, bounces=bounces, asymmetry=asymmetry)
    surface = case.surface()
    start = time.perf_counter()
    surface.stokes(1.0, 0.5, 2.0)
    first_call_s = time.perf_counter() - start
    compiled = len(list(kept.glob("*.o"))) - before
    figures = {
        "numpy_s": numpy_s,
        "import_s": import_s,
        "first_call_s": first_call_s,
        "compiled": compiled,
        "ns_per_direction": 1e9 * float(numpy.median(interleaved_s({"": case.call()}, REPEATS)[""])) / DIRECTIONS,
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
