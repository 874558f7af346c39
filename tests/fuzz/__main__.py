"""Fuzz every parser of drivers and simulated devices: ``python tests/fuzz --count 1000000 --seed 1``."""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from itertools import groupby

from campaign import TARGETS, run_task, tasks
from floods import floods
from target import Result, run_block

_PROCESSES = 2


def main() -> int:
    """Fuzz, print a table, and return how many targets failed."""
    parser = argparse.ArgumentParser(prog="python tests/fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000, help="mutated strings, and bytes of floods, for each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="targets whose name contains this")
    parser.add_argument("--block", type=int, help="one block alone, to see a failure again")
    options = parser.parse_args()
    names = [name for name in TARGETS if options.only in name]
    if options.block is not None:
        results = [run_block(TARGETS[name], options.seed, options.block) for name in names]
        print(*(failure for result in results for failure in result.failures), sep="\n")
        return sum(bool(result.failures) for result in results)
    results = []
    with multiprocessing.get_context("spawn").Pool(_PROCESSES) as pool:
        for name in names:
            total = Result(name)
            for result in pool.imap_unordered(run_task, tasks(name, options.seed, options.count)):
                total += result
            results.append(total)
            print(
                f"{total.name:22} {total.strings:>9} strings, {total.strings / max(total.seconds, 1e-9):>8.0f}/s, "
                f"{len(total.failures)} failures: "
                + ", ".join(f"{word} {number}" for word, number in total.outcomes.most_common()),
                *total.failures[:1],
                sep="\n",
                flush=True,
            )
    return sum(bool(total.failures) for total in results) + _flood(options.count, options.only)


def _flood(count: int, only: str) -> int:
    """Print for each parser what its worst streams did to it, and every failure; how many there are."""
    failures = 0
    for name, floods_of_it in groupby(floods(count, only), key=lambda flood: flood.name):
        all_of_it = list(floods_of_it)
        slowest = max(all_of_it, key=lambda flood: flood.us_per_byte)
        print(
            f"{name:22} floods: {max(flood.kept_bytes for flood in all_of_it):>6} bytes kept, "
            f"{slowest.us_per_byte:.2f} us/byte ({slowest.stream}, {slowest.piece} at a time; "
            f"{slowest.slowing:.2f} times that of an eighth of it)"
        )
        for flood in filter(lambda flood: flood.failure, all_of_it):
            failures += 1
            print(f"{flood.name}, {flood.stream}, {flood.piece} at a time: {flood.failure}", flush=True)
    return failures


if __name__ == "__main__":
    sys.exit(main())
