"""What accuracy costs in time: error against nanoseconds, and ratios beside their targets, all in one run on one core.

Run with ``make bench-model``; the figures and the plot in docs/cost.md come from here.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import cost_cones
import cost_curves
import cost_plot
import cost_targets
from model_case import keep_memory

ROOT = Path(__file__).resolve().parent.parent
PEERS = ROOT / ".venv-bench" / ("Scripts" if sys.platform == "win32" else "bin") / "python"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", type=Path, default=PEERS, help="Python of the environment that holds the peers")
    parser.add_argument("--plot", type=Path, help="PNG file to draw")
    arguments = parser.parse_args()
    cores: set[int] = set()
    if hasattr(os, "sched_setaffinity"):  # elsewhere kernels use all cores, and nothing is said of two
        cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {min(cores)})
    keep_memory()

    curves, cones = cost_curves.measure(), cost_cones.measure()
    cost_curves.report(curves)
    cost_cones.report(cones)
    if arguments.plot:
        cost_plot.draw(arguments.plot, curves, cones)
    cost_targets.report(arguments.peers, cores)


if __name__ == "__main__":
    main()
