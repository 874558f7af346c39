"""A scan that reads each direction, all slots in turn, round after round, until its DoLP is known well enough."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from acquisition.averaging import Averaging
from acquisition.decisions import Decisions
from acquisition.moving import Moving
from acquisition.readings import StokesPoint
from acquisition.steps import HOME, Step, Target
from acquisition.timing import BenchTiming

_LEAST_PART, _MOST_PART = 0.5, 3.0
"""A further round has at least half of the readings that there are, so that rounds are few; and at most three times as
many, so that little is staked on the little that is known."""

_MARGIN = 1.05
"""The foreseen number of readings is enlarged by so much, lest yet another round is needed for the last of them."""


class Rounds:
    """The course of a scan whose directions are read until a standard error of the DoLP is reached.

    The first round reads every slot `at_least` times. The standard error to which the readings reduce says how many
    are still wanting; a further round takes them, the slots in the opposite order, up to `at_most` in all.

    Parameters
    ----------
    steps : sequence of Step
        The plan of the scan, every direction in one go.
    averaging : Averaging
        What is wanted.
    timing : BenchTiming
        Speeds of the rig.
    saved : callable
        Told the seconds of a direction's longest time that it did not need.
    decisions : Decisions, optional
        What an earlier process has decided of the scan is decided again.
    """

    reason = "finished"
    ahead: Target | None = None
    """Not known: whether there is another round is decided by what was found in the last."""

    def __init__(
        self,
        steps: Sequence[Step],
        averaging: Averaging,
        timing: BenchTiming,
        saved: Callable[[float], None],
        decisions: Decisions | None = None,
    ) -> None:
        assert averaging.dolp_error is not None, "a recipe without it is not measured in rounds"
        self._wanted, self._least, self._most = averaging.dolp_error, averaging.at_least, averaging.at_most
        self._timing, self._saved, self._moving_s = timing, saved, Moving(timing)
        self._stretches, self._decisions = deque(_stretches(steps)), decisions or Decisions()
        self._here = HOME
        self._slots: list[Step] = []
        self._read, self._size = 0, 0
        self._longest_s = 0.0

    def next(self, points: Sequence[StokesPoint]) -> Sequence[Step]:
        """The steps of the next round, of this direction or the next one."""
        if self._read == 0:
            if not self._stretches:
                return ()
            stretch = self._stretches.popleft()
            self._longest_s = sum(step.duration_s for step in self._at_longest(stretch, self._here))
            self._slots, self._size = _slots_of(stretch), self._least
            return self._taken(stretch)
        self._slots = self._slots[::-1]
        return self._taken(self._slots)

    def has_measured(self, so_far: Callable[[], StokesPoint]) -> bool:
        """Whether the direction is measured well enough, or as often as the recipe allows."""
        size = 0
        if self._slots:
            self._read += self._size
            size = self._decided(so_far)
        if size:
            self._size = size
            return False
        self._saved(self._longest_s)
        self._read = 0
        return True

    def longest_s(self) -> float:
        """How long the scan takes if no direction reaches what is wanted, and every round is as short as it may be."""
        here, longest_s = HOME, 0.0
        for stretch in self._stretches:
            for step in self._at_longest(stretch, here):
                here, longest_s = step.target, longest_s + step.duration_s
        return longest_s

    def shortest_s(self) -> float:
        """How long it takes if every direction is known well enough after its first round."""
        here, shortest_s = HOME, 0.0
        for stretch in self._stretches:
            for step in self._timed(stretch, self._least, 0, here):
                here, shortest_s = step.target, shortest_s + step.duration_s
        return shortest_s

    def _decided(self, so_far: Callable[[], StokesPoint]) -> int:
        what = f"{self._slots[0].point} after {self._read}"
        if (earlier := self._decisions.of(what)) is not None:
            return int(earlier["readings"])
        size = self._wanting(so_far().dolp_stderr)
        self._decisions.note(what, {"readings": size})
        return size

    def _wanting(self, dolp_stderr: float) -> int:
        """How many readings in every slot the next round has; none if this was the last."""
        if dolp_stderr <= self._wanted or self._read >= self._most:
            return 0
        wanting = self._read  # where noise has made S0 negative, the DoLP says nothing
        if math.isfinite(dolp_stderr):
            wanting = math.ceil(self._read * ((dolp_stderr / self._wanted) ** 2 * _MARGIN - 1.0))
        return min(max(wanting, _shortest(self._read)), int(_MOST_PART * self._read), self._most - self._read)

    def _taken(self, steps: Sequence[Step]) -> Sequence[Step]:
        timed = tuple(self._timed(steps, self._size, self._read, self._here))
        self._longest_s -= sum(step.duration_s for step in timed)
        self._here = timed[-1].target
        return timed

    def _timed(self, steps: Sequence[Step], readings: int, before: int, here: Target) -> Iterator[Step]:
        for step in steps:
            duration_s = self._moving_s(here, step.target) + self._timing.readings_s(readings, step.exposure_s)
            yield replace(step, readings=readings, duration_s=duration_s, first_repeat=before)
            here = step.target

    def _at_longest(self, stretch: Sequence[Step], here: Target) -> Iterator[Step]:
        read, size, steps = 0, self._least, list(stretch)
        while size and steps:
            for step in self._timed(steps, size, read, here):
                yield step
                here = step.target
            steps, read = _slots_of(steps)[::-1], read + size
            size = min(_shortest(read), self._most - read)


def _stretches(steps: Sequence[Step]) -> list[list[Step]]:
    """The steps of each direction, with a reference before it; that which closes the scan stands alone."""
    stretches = [[steps[0]]]
    for last, step in itertools.pairwise(steps):
        if step.point != last.point or step.kind == "reference":
            stretches.append([])
        stretches[-1].append(step)
    return stretches


def _slots_of(steps: Sequence[Step]) -> list[Step]:
    """What a further round repeats; a reference is read once."""
    return [step for step in steps if step.kind != "reference"]


def _shortest(read: int) -> int:
    return math.ceil(_LEAST_PART * read)
