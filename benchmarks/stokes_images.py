"""How fast pictures become Stokes parameters, beside what memory allows and what other programs take; and their memory.

Run with ``make bench-images``; figures in docs/cost.md come from here. All rates are from one process and taken in
turns, on one core unless it says otherwise; each peak of memory is from a process of its own.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    cores: set[int] = set()
    if hasattr(os, "sched_setaffinity"):
        cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {max(cores)})
    # Only now, for libraries count the cores that they may use.
    import cv2
    import images_case
    import images_memory
    import images_rates
    from interleaved import interleaved_s

    cv2.setNumThreads(1)
    images_memory.report()
    stack = images_case.frames()
    signals = images_case.signals(stack)
    images_rates.check(stack, signals)
    with tempfile.TemporaryDirectory() as folder:
        calls = images_rates.all_calls(stack, signals, Path(folder))
        images_rates.report(interleaved_s(calls, arguments.rounds))
    if len(cores) > 1:
        images_rates.report_two_cores(stack, cores)


if __name__ == "__main__":
    main()
