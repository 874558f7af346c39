"""Durations as a person reads them off a clock."""

from __future__ import annotations


def clock_text(duration_s: float) -> str:
    """Write ``2:05`` or ``1:02:05``; what is below zero is ``0:00``."""
    minutes, seconds = divmod(max(round(duration_s), 0), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
