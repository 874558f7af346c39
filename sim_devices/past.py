"""What a simulated bench has been through before it was switched on, as far as anything hangs on it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Past:
    """How often its detector has measured and its analyzer has turned; noise, wobble and misses are numbered by it."""

    measurements: int = 0
    turns: int = 0
