"""Fit many inputs in processes of this machine."""

# Nothing heavy is imported here: a worker must know its share of the cores before NumPy counts them.

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from goniometer.many_fits.row import Asked, Row, crashed, fit_row

_AHEAD = 2


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def fitted_here(paths: Iterable[Path], asked: Asked, workers: int) -> Iterator[tuple[Path, Row]]:
    """Inputs with what became of them, as they are done.

    If a process dies, what was under way is tried again, one by one, to tell the input that it died on.

    Parameters
    ----------
    paths : iterable of Path
        The inputs.
    asked : Asked
        What to fit.
    workers : int
        How many processes.
    """
    waiting = deque(paths)
    while waiting:
        suspects = deque((yield from _until_one_dies(waiting, asked, workers, _AHEAD * workers)))
        while suspects:
            for path in (yield from _until_one_dies(suspects, asked, 1, 1)):
                yield path, crashed("The process that fitted it died")


def _until_one_dies(
    waiting: deque[Path], asked: Asked, workers: int, at_once: int
) -> Generator[tuple[Path, Row], None, list[Path]]:
    """Fit what is waiting; returns, if a process died, what was under way, and leaves the rest waiting."""
    # Spawned, not forked: this process may have threads, whose locks a fork would copy but not the threads.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, _prepare, (context.Value("i", 0), workers))
    under_way: dict[Future[Row], Path] = {}
    try:
        while waiting or under_way:
            while waiting and len(under_way) < at_once:
                under_way[pool.submit(fit_row, waiting[0], asked)] = waiting[0]
                waiting.popleft()
            for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                row = done.result()
                yield under_way.pop(done), row
    except BrokenProcessPool:
        return list(under_way.values())
    finally:
        pool.shutdown(cancel_futures=True)
    return []


def _prepare(started: Any, workers: int) -> None:
    """Make a fresh process a worker: of its share of the cores, deaf to Ctrl-C, and ended with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with started.get_lock():
        number = started.value
        started.value += 1
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
    if hasattr(os, "sched_setaffinity"):
        every = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, every[number::workers] or [every[number % len(every)]])
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None, "a worker is a child"
    parent.join()
    os._exit(1)
