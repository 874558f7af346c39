"""A scan of 10^5 readings: memory, the journal's rate, and how far the live view lags behind.

Run with ``make bench`` on Linux; the figures in docs/cost.md come from here. The scan is a whole one: every byte over a
socket, the live fit, every reading durable before it is shown, and all results at the end.
"""

import argparse
import io
import os
import resource
import sqlite3
import statistics
import tempfile
import time
from dataclasses import astuple, fields
from pathlib import Path

import h5py  # noqa: F401 (what a run loads on its way belongs to its import, not to its memory)
import matplotlib.backends.backend_agg
import matplotlib.figure  # noqa: F401
import scipy.optimize
import scipy.stats  # noqa: F401
from rich.console import Console

from acquisition.events import FitUpdated, PointReduced, ReadingStored, ScanEnded
from acquisition.journal import Journal
from acquisition.readings import Reading
from goniometer.lasting_stream import LastingStream
from goniometer.live_console import LiveConsole
from goniometer.run_recipe import run

ROOT = Path(__file__).resolve().parent.parent
RECIPE = ROOT / "recipes" / "iron_60deg.yaml"
SLOTS = 5
MOST_MB, LEAST_PER_S, MOST_LAG_MS = 200.0, 2000.0, 50.0
CHUNK, CHUNKS = 500, 20


def resident_mb():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def long_recipe(folder, readings, repeats):
    """The iron recipe on so fine a grid of exit angles that there are so many readings."""
    directions = round(readings / SLOTS / repeats)
    text = RECIPE.read_text(encoding="utf-8").replace("../", f"{ROOT}/")
    for found, wanted in (
        ("step_deg: 1}", f"step_deg: {60 / (directions - 1)!r}}}"),
        ("readings: 3", f"readings: {repeats}"),
    ):
        assert found in text, f"{RECIPE} has changed: no '{found}'"
        text = text.replace(found, wanted)
    path = Path(folder) / "long.yaml"
    path.write_text(text, encoding="utf-8")
    return path


class Watch:
    """Memory of a scan as it goes, and how far behind a person sees it.

    `lags_ms`: from the moment a direction is reduced to that at which the console has the fit that takes it in;
    `draws_ms`: one drawing of the whole view.
    """

    def __init__(self, every):
        self._every, self._reduced_s = every, []
        self._view = LiveConsole(LastingStream(io.StringIO()))
        self.resident, self.lags_ms, self.draws_ms = [], [], []
        self.began_s = self.ended_s = None
        self.readings = 0

    def __call__(self, event):
        self._view(event)
        now_s = time.perf_counter()
        match event:
            case ReadingStored():
                self.began_s = self.began_s or now_s
                self.readings += 1
                if self.readings % self._every == 0:
                    self._look()
            case PointReduced():
                self._reduced_s.append(now_s)
            case FitUpdated() if self.ended_s is None:
                self.lags_ms.append(1e3 * (now_s - self._reduced_s[event.points - 1]))
            case ScanEnded():
                self.ended_s = now_s
                self.resident.append(resident_mb())

    def _look(self):
        self.resident.append(resident_mb())
        begin_s = time.perf_counter()
        Console(file=io.StringIO(), force_terminal=True, width=100).print(self._view)
        self.draws_ms.append(1e3 * (time.perf_counter() - begin_s))


class Bare:
    """A plain SQLite table with the journal's columns, settings and transactions."""

    def __init__(self, path):
        columns = [field.name for field in fields(Reading)]
        self._connection = sqlite3.connect(path, isolation_level=None)
        self._connection.execute("PRAGMA journal_mode=WAL")
        self._connection.execute("PRAGMA synchronous=FULL")
        self._connection.execute(f"CREATE TABLE readings (id INTEGER PRIMARY KEY, {', '.join(columns)})")
        self._insert = f"INSERT INTO readings ({', '.join(columns)}) VALUES ({', '.join('?' * len(columns))})"

    def append(self, row):
        self._connection.execute(self._insert, row)


def rates_per_s(folder):
    """Readings a second of the journal, and rows a second of a bare table, each durable when `append` returns.

    They take turns, a chunk each, so that both meet the same disk.
    """
    some = [
        Reading(number // 5, "signal", 0, 0.1 * number, 60.0, 0.01 * number, 0.0, 2, 45.0, 0.03, 1e-9)
        for number in range(CHUNK)
    ]
    rows, bare, rates = [astuple(reading) for reading in some], Bare(folder / "bare.sqlite"), []
    with Journal.create(folder / "journal.sqlite", {}) as journal:
        settings = journal._connection.execute(
            "SELECT j.journal_mode, s.synchronous FROM pragma_journal_mode j, pragma_synchronous s"
        ).fetchone()
        assert settings == ("wal", 2), f"the journal is not durable: {settings}"
        for _ in range(CHUNKS):
            rates.append((rate_per_s(journal.append, some), rate_per_s(bare.append, rows)))
    return list(zip(*rates, strict=True))


def rate_per_s(append, rows):
    begin_s = time.perf_counter()
    for row in rows:
        append(row)
    return len(rows) / (time.perf_counter() - begin_s)


def sync_ms(folder, count):
    """Milliseconds of one fdatasync behind a write of a page, which is what a durable commit waits for."""
    times_ms = []
    with (folder / "synced").open("wb", buffering=0) as file:
        for _ in range(count):
            file.write(b"\0" * 4096)
            begin_s = time.perf_counter()
            os.fdatasync(file.fileno())
            times_ms.append(1e3 * (time.perf_counter() - begin_s))
    return statistics.median(times_ms)


def tail(values, part=0.95):
    return sorted(values)[int(part * (len(values) - 1))]


def report_journal(folder):
    ours, bare = rates_per_s(folder)
    ratio = statistics.median(one / other for one, other in zip(ours, bare, strict=True))
    print(f"Journal alone, {CHUNKS} x {CHUNK} readings, one durable transaction each (WAL, synchronous=FULL):")
    print(
        f"  ours {statistics.median(ours):.0f} readings/s (best {max(ours):.0f}, wanted {LEAST_PER_S:.0f}), "
        f"bare sqlite3 {statistics.median(bare):.0f} (best {max(bare):.0f}); ours / bare {ratio:.2f}"
    )
    print(f"  fdatasync of this disk behind a write of 4 KiB: {sync_ms(folder, 1000):.3f} ms (median)")


def report_scan(folder, readings, repeats, live_fit):
    imported_mb, watch = resident_mb(), Watch(max(readings // 50, 1))
    begin_s = time.perf_counter()
    stored = run(
        long_recipe(folder, readings, repeats), out=folder, speed="max", live_fit=live_fit, subscribers=[watch]
    )
    total_s, scan_s = time.perf_counter() - begin_s, watch.ended_s - watch.began_s
    resident = [mb - imported_mb for mb in watch.resident]
    tenth = len(resident) // 10
    print(
        f"Scan of {watch.readings} readings in {len(stored.points)} directions, live fit {'on' if live_fit else 'off'}:"
    )
    print(f"  {scan_s:.1f} s, {watch.readings / scan_s:.0f} readings/s; results {total_s - scan_s:.1f} s")
    print(
        f"  memory above import ({imported_mb:.0f} MB): {resident[tenth]:.0f} MB after a tenth, {resident[-1]:.0f} MB "
        f"at the end of the scan, at most {peak_mb() - imported_mb:.0f} MB with the results (wanted {MOST_MB:.0f})"
    )
    draws_ms = watch.draws_ms
    print(f"  one drawing of the view: median {statistics.median(draws_ms):.1f} ms, 95 % {tail(draws_ms):.1f} ms")
    if watch.lags_ms:
        last = watch.lags_ms[-len(watch.lags_ms) // 10 :]
        print(
            f"  from a reduced direction to the fit that has it: median {statistics.median(watch.lags_ms):.1f} ms, "
            f"95 % {tail(watch.lags_ms):.1f} ms (wanted {MOST_LAG_MS:.0f}), in the last tenth "
            f"{statistics.median(last):.1f} and {tail(last):.1f} ms; {len(watch.lags_ms)} fits"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--readings", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3, help="readings in every slot of a direction")
    parser.add_argument("--no-live-fit", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report_scan(folder, arguments.readings, arguments.repeats, not arguments.no_live_fit)
        report_journal(Path(folder))


if __name__ == "__main__":
    main()
