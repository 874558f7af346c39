"""Suspenders: a reading in doubt is not stored; the scan waits, takes it again, and goes on when it is beyond doubt."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from pydantic import Field

from acquisition.lamp_level import LampBreak
from acquisition.readings import Reading
from acquisition.section import Section
from goniometer.errors import GoniometerError

SuspendWhen = Callable[[Reading], str]
"""Asked about each reading before it is stored; a text says why it is in doubt, an empty one that it is not."""

SUSPENDED = "suspended "


class Suspend(Section):
    """When a scan holds by itself, and for how long."""

    lamp_below: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="fraction of the first reference reading's light below which the scan waits for the lamp; needs "
        "reference",
    )
    saturated: bool = Field(default=False, description="whether the scan waits while the detector is saturated")
    every_s: float = Field(
        default=5.0, gt=0, le=3600, description="how often the reading in doubt is taken again, in s"
    )
    for_at_most_s: float = Field(
        default=600.0, gt=0, le=1_000_000, description="how long the scan waits before it ends with an error, in s"
    )


class SuspendedTooLongError(GoniometerError, TimeoutError):
    """What had a scan wait did not pass."""

    def __init__(self, why: str, waited_s: float) -> None:
        self.why, self.waited_s = why, waited_s
        super().__init__(
            f"The scan was suspended for {waited_s:.0f} s, longer than for_at_most_s allows, and the reading is still "
            f"in doubt: {why}. Not done: the rest of the scan. What to do: look at the lamp, the beam and the "
            "detector, then measure what is missing."
        )

    def __reduce__(self) -> tuple[type[SuspendedTooLongError], tuple[str, float]]:
        """Let it come whole out of another process."""
        return type(self), (self.why, self.waited_s)


@dataclass(frozen=True)
class Doubt:
    """Why a reading is in doubt, and since when others may be, on the bench's clock."""

    since_s: float
    why: str


class Judge:
    """Judges readings, in the order they are taken.

    Parameters
    ----------
    suspend : Suspend
        The recipe's section.
    hook : callable, optional
        The user's own judge.
    """

    def __init__(self, suspend: Suspend | None = None, hook: SuspendWhen | None = None) -> None:
        self.suspend, self._hook = suspend or Suspend(), hook
        self._dark_w = 0.0
        self._first_w: dict[float | None, float] = {}
        self._good_s = 0.0

    def saw(self, reading: Reading) -> None:
        """Take in a reading that is stored."""
        if reading.kind == "dark":
            self._dark_w = reading.power_w
        elif reading.kind == "reference":
            self._first_w.setdefault(reading.wavelength_nm, reading.power_w)
            self._good_s = reading.time_s

    def doubt(self, reading: Reading) -> Doubt | None:
        """Say what speaks against a reading; None if nothing does."""
        below, first_w = self.suspend.lamp_below, self._first_w.get(reading.wavelength_nm)
        if below is not None and reading.kind == "reference" and first_w is not None:
            level = (reading.power_w - self._dark_w) / (first_w - self._dark_w)
            if level < below:
                why = (
                    f"the reference reading at {reading.time_s:.1f} s on the bench's clock shows {level:.3g} of the "
                    f"first one's light, less than {below:g} (lamp_below)"
                )
                return Doubt(self._good_s, why)
        if self._hook is not None and (said := self._hook(reading)):
            return Doubt(reading.time_s, str(said))
        return None


def note(interval: LampBreak) -> str:
    """An interval of suspension as the journal keeps it."""
    end_s = None if interval.end_s == float("inf") else interval.end_s
    return json.dumps({"begin_s": interval.begin_s, "end_s": end_s, "why": interval.why})


def note_key(number: int) -> str:
    """Under which the journal keeps it."""
    return f"{SUSPENDED}{number}"


def suspensions(about: Mapping[str, str]) -> tuple[LampBreak, ...]:
    """The intervals of suspension that a journal remembers; one that was never ended lasts for ever."""

    def found() -> Iterator[LampBreak]:
        for key, text in about.items():
            if key.startswith(SUSPENDED):
                held = json.loads(text)
                end_s = float("inf") if held["end_s"] is None else held["end_s"]
                yield LampBreak(held["begin_s"], end_s, held["why"])

    return tuple(sorted(found(), key=lambda interval: interval.begin_s))
