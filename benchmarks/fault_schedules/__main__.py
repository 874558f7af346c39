"""How do short scans end through which one to three faults strike, at random moments, on benches of every make.

Run with:   python benchmarks/fault_schedules RUNS [--first SEED] [--processes N]

Every run must end with the data of the scan without faults, or with an error that names what failed; without a wrong
reading, a hang, an axis that moves on unsaid, or a reading lost from the journal. Whatever is else is a violation: its
schedule is printed, and the exit code is 1. The same seed makes the same schedule.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor

from judgement import judged, prepare
from tables import print_tables, unstruck


def main() -> int:
    """Run schedules, print the tables, and say whether all went well."""
    parser = argparse.ArgumentParser(prog="python benchmarks/fault_schedules", description=__doc__.partition("\n")[0])
    parser.add_argument("runs", type=int)
    parser.add_argument("--first", type=int, default=0, metavar="SEED")
    parser.add_argument("--processes", type=int, default=3, help="which mostly wait for answers that do not come")
    asked = parser.parse_args()
    start_s, verdicts = time.monotonic(), []
    seeds = range(asked.first, asked.first + asked.runs)
    spawning = multiprocessing.get_context("spawn")
    # unlike multiprocessing's own pool, this one says so when a process dies
    with ProcessPoolExecutor(asked.processes, mp_context=spawning, initializer=prepare) as pool:
        for verdict in pool.map(judged, seeds, chunksize=4):
            verdicts.append(verdict)
            if verdict.wrong:
                print(f"seed {verdict.seed}:", *verdict.wrong, sep="\n    ", flush=True)
    print_tables(verdicts)
    broken = sum(bool(verdict.wrong) for verdict in verdicts)
    missed = unstruck(verdicts)
    print(f"\nnever struck: {', '.join(f'{family} by {fault}' for fault, family in missed) or 'none'}")
    print(
        f"{asked.runs} runs, {broken} with violations, in {time.monotonic() - start_s:.0f} s; the slowest "
        f"{max(verdict.real_s for verdict in verdicts):.1f} s, the longest "
        f"{max(verdict.bench_s for verdict in verdicts):.0f} s of the bench's time"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
