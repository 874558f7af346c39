"""That a scan was interrupted and went on, as its journal keeps it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Interruption:
    """After how many readings, when the last of them was stored, why as far as known, when and by what it went on."""

    readings: int
    last_stored_at: str | None
    why: str | None
    resumed_at: str
    resumed_with: str

    def __str__(self) -> str:
        stored = f", the last of them stored at {self.last_stored_at}" if self.last_stored_at else ""
        why = self.why or "the program was killed, or the power failed"
        return (
            f"interrupted after {self.readings} readings{stored} ({why}); resumed at {self.resumed_at} "
            f"with {self.resumed_with}"
        )
