"""The way a scan takes: the steps of one direction after another, fixed beforehand or decided as it goes."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from acquisition.expand import Step, Target
from acquisition.readings import StokesPoint
from acquisition.recipe import Recipe
from model.fit import FitResult


class Course(Protocol):
    """Whatever says where a scan goes on."""

    @property
    def reason(self) -> str:
        """Why there is no further direction."""
        ...

    @property
    def ahead(self) -> Target | None:
        """Where the next steps begin, whatever is found in the last ones; None if that is not known before."""
        ...

    def next(self, points: Sequence[StokesPoint]) -> Sequence[Step]:
        """The steps up to the end of the next direction, when these points are measured; none at the scan's end."""
        ...

    def has_measured(self, so_far: Callable[[], StokesPoint]) -> bool:
        """Whether the last steps have measured their direction, which reduces to `so_far`, or others go on with it."""
        ...


class Listed:
    """All steps as they were planned, up to the end of one direction after the other, in every repeat."""

    reason = "finished"

    def __init__(self, steps: Sequence[Step]) -> None:
        self._steps = steps
        last = {(step.point, step.cycle): number for number, step in enumerate(steps)}
        self._ends = deque(sorted(number + 1 for number in last.values()))
        self._done = 0

    @property
    def ahead(self) -> Target | None:
        """Where the steps go on behind those that were taken last."""
        return self._steps[self._done].target if self._done < len(self._steps) else None

    def next(self, points: Sequence[StokesPoint]) -> Sequence[Step]:
        """The steps up to the end of the next direction, whatever was measured."""
        if not self._ends:
            return ()
        begin, self._done = self._done, self._ends.popleft()
        return self._steps[begin : self._done]

    def has_measured(self, so_far: Callable[[], StokesPoint]) -> bool:
        """Every stretch ends with its direction."""
        return True


@dataclass(frozen=True)
class Visit:
    """A direction to measure: exit angle, readings in every slot, and what a person is told why it was chosen."""

    exit_deg: float
    readings: int
    why: str


@dataclass(frozen=True, eq=False)
class Situation:
    """What is known when the next direction is chosen.

    `result` is None while there is no fit; `unmet` are the parameters that are not yet known as well as wanted, the
    least known first. The bench stands at `here`; `elapsed_s` have gone, `left_s` are left.
    """

    points: Sequence[StokesPoint]
    result: FitResult | None
    unmet: tuple[str, ...]
    here: Target
    elapsed_s: float
    left_s: float


class Choice(Protocol):
    """Chooses the next direction."""

    def __call__(self, now: Situation) -> Visit | None:
        """The next direction; None when no direction fits into the time that is left."""
        ...

    def chosen(self, visit: Visit, duration_s: float) -> None:
        """Take note of a visit that was chosen, and of how long it takes, before anything else is chosen."""
        ...


class Passes:
    """The recipe's exit angles forth and back again, without end."""

    def __init__(self, recipe: Recipe) -> None:
        directions = zip(recipe.exit_angles_deg(), recipe.readings_of_angles(), strict=True)
        forth = [Visit(exit_deg, readings, "") for exit_deg, readings in directions]
        self._visits = itertools.cycle([*forth, *forth[::-1]])
        self._next = next(self._visits)

    def __call__(self, now: Situation) -> Visit:
        """The next one, whatever was found."""
        return self._next

    def chosen(self, visit: Visit, duration_s: float) -> None:
        """The one behind it is next."""
        self._next = next(self._visits)
