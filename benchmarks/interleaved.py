"""Times of functions that are compared: a sample of each in turn, so that all of them share the machine's moods."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Key = TypeVar("Key", bound=Hashable)

Clock = Callable[[], float]

# Of one sample, which is of as many calls as it takes.
SHORTEST_S = 0.004
# On one core the processor's time is the wall's, less what other programs take; Windows counts it too coarsely.
ONE_CORE: Clock = time.process_time if hasattr(os, "sched_setaffinity") else time.perf_counter


def interleaved_s(
    functions: Mapping[Key, Callable[[], object]], rounds: int, clock: Clock = ONE_CORE
) -> dict[Key, NDArray[np.float64]]:
    """Seconds a call, shape (rounds,) for each function, after a first call that does not count."""
    calls = {}
    for name, function in functions.items():
        function()
        calls[name] = max(1, round(SHORTEST_S / seconds(function, 1, clock)))
    samples: dict[Key, list[float]] = {name: [] for name in functions}
    for turn in range(rounds):
        # Back and forth, so that none always comes after the same other one.
        for name in list(functions)[:: 1 if turn % 2 else -1]:
            samples[name].append(seconds(functions[name], calls[name], clock) / calls[name])
    return {name: np.array(times) for name, times in samples.items()}


def ratio(samples: Mapping[Key, NDArray[np.float64]], dearer: Key, cheaper: Key) -> float:
    """Median over the rounds of how many times as long the first takes."""
    return float(np.median(samples[dearer] / samples[cheaper]))


def seconds(function: Callable[[], object], calls: int, clock: Clock) -> float:
    start = clock()
    for _ in range(calls):
        function()
    return clock() - start
