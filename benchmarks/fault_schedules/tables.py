"""What is printed of many scans through faults."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from benches import KINDS, short_scan
from judgement import Verdict
from schedules import is_of, possible_faults

from sim_devices.faults.entry import AxisFault, DeviceFault


def print_tables(verdicts: Sequence[Verdict]) -> None:
    """How scans ended, on each bench and with each fault, and what each family of devices was struck by."""
    by_bench = Counter((verdict.bench, verdict.ending) for verdict in verdicts)
    by_bench.update(("all", verdict.ending) for verdict in verdicts)
    _print_counts("bench", by_bench)
    _print_counts("fault", Counter((name, v.ending) for v in verdicts for name in set(v.faults)))
    struck = Counter(pair for verdict in verdicts for pair in verdict.struck)
    _print_counts("struck", struck, possible_pairs())


def unstruck(verdicts: Iterable[Verdict]) -> list[tuple[str, str]]:
    """What could have struck a family of devices, and never has."""
    return sorted(possible_pairs() - {pair for verdict in verdicts for pair in verdict.struck})


def possible_pairs() -> set[tuple[str, str]]:
    """Every fault with every family of devices that can have it on one of the benches."""
    pairs = set()
    for bench in KINDS:
        devices = short_scan(bench).scene([], seed=1).devices
        detector = next(device.type for device in devices.values() if device.part == "detector")
        for kind, targets in possible_faults(bench).items():
            for target in targets:
                name = target
                if issubclass(kind, AxisFault):
                    name = next(name for name, device in devices.items() if target in device.roles())
                family = devices[name].type if issubclass(kind, AxisFault | DeviceFault) else detector
                pairs.add((is_of(kind), family))
    return pairs


def _print_counts(title: str, counts: Counter[tuple[str, str]], possible: set[tuple[str, str]] | None = None) -> None:
    """A table of counts; where `possible` is given, a dash for what is not."""
    pairs = set(counts) | (possible or set())
    rows, columns = sorted({row for row, _ in pairs}), sorted({column for _, column in pairs})
    heads = [column.removeprefix("thorlabs_").removeprefix("stanford_") for column in columns]
    print(f"\n{title:20}", *(f"{head:>{len(head) + 1}}" for head in heads))
    for row in rows:
        cells = [
            "-" if possible is not None and (row, column) not in possible else counts[row, column] for column in columns
        ]
        print(f"{row:20}", *(f"{cell:>{len(head) + 1}}" for cell, head in zip(cells, heads, strict=True)))
