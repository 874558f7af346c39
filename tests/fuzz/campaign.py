"""All targets, and the blocks of strings that they are given."""

from __future__ import annotations

import logging
from collections.abc import Iterable

import control_targets
import device_targets
import driver_targets
import parser_targets
from target import BLOCK, Result, run_block

logging.disable(logging.WARNING)  # drivers tell of every answer that they ask for again

TARGETS = {
    target.name: target
    for target in (*parser_targets.TARGETS, *driver_targets.TARGETS, *device_targets.TARGETS, *control_targets.TARGETS)
}

Task = tuple[str, int, int, int]


def run_task(task: Task) -> Result:
    """Feed one block; in a process of its own, where modules are imported by their names."""
    name, seed, block, strings = task
    return run_block(TARGETS[name], seed, block, strings)


def tasks(name: str, seed: int, strings: int) -> Iterable[Task]:
    """The blocks that make up `strings` strings for a target."""
    for block in range(-(-strings // BLOCK)):
        yield name, seed, block, min(BLOCK, strings - block * BLOCK)
