"""What is fuzzed, and how: blocks of strings, each with a seed of its own, until there are enough."""

from __future__ import annotations

import random
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

BLOCK = 500


class Run(Protocol):
    """One block's worth of a target, with state of its own."""

    def take(self) -> str:
        """Feed one mutated string; returns what became of it, in a word. Whatever it raises is a failure."""
        ...


@dataclass(frozen=True)
class Target:
    """Something that takes bytes; `side` is "parser", "driver" or "device"."""

    protocol: str
    side: str
    begin: Callable[[random.Random], Run]

    @property
    def name(self) -> str:
        """How it is called on the command line."""
        return f"{self.protocol}/{self.side}"


@dataclass
class Result:
    """What became of the strings of a target."""

    name: str
    strings: int = 0
    seconds: float = 0.0
    outcomes: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    def __iadd__(self, other: Result) -> Result:
        self.strings += other.strings
        self.seconds += other.seconds
        self.outcomes += other.outcomes
        self.failures += other.failures
        return self


def run_block(target: Target, seed: int, block: int, count: int = BLOCK) -> Result:
    """Feed one block; a failure ends it, and says how to see it again."""
    result, begun_s = Result(target.name), time.perf_counter()
    run = target.begin(random.Random(f"{seed} {target.name} {block}"))
    for number in range(count):
        try:
            result.outcomes[run.take()] += 1
        except Exception:  # noqa: BLE001 - whatever it is, it is what we look for
            result.failures.append(
                f"{target.name}: string {number} of block {block}; to see it again: "
                f"--only {target.name} --seed {seed} --block {block}\n{traceback.format_exc()}"
            )
            break
        result.strings += 1
    result.seconds = time.perf_counter() - begun_s
    return result
