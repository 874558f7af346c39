"""A scan that decides as it goes: whether it goes on, and where.

Every decision rests on a fit to all points, made in the thread that moves the bench, while nothing moves. So it depends
on the readings alone: in virtual time the same seed gives the same scan, however fast the computer is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict

from acquisition.course import Choice, Situation, Visit
from acquisition.decisions import Decisions
from acquisition.events import DirectionChosen, Event, FitRefused, FitUpdated
from acquisition.expand import HOME, Step, Target, Visits
from acquisition.fit_points import dataset, fit_arguments, named_in_degrees
from acquisition.readings import StokesPoint
from acquisition.recipe import Recipe
from acquisition.wanted import Judgement, judge, misfit
from drivers.clock import Clock
from goniometer.errors import FitError
from model.fit import FitResult, SurfaceFamily, fit, follow


def spent_s(decisions: Decisions, until_s: float) -> float:
    """How much of its time limit a scan had spent at a moment on the bench's clock; 0 before its first direction."""
    first = decisions.of("0")
    return 0.0 if first is None else until_s - float(first["begun_s"]) - decisions.time_lost_s()


_END = "the end"
"""What the decision to end the scan is noted under; the choice of each direction, under its number."""


class Steering:
    """The course of a scan with `until` or `adaptive`.

    Parameters
    ----------
    recipe : Recipe
        What is wanted, and the time there is.
    visits : Visits
        Makes the steps.
    family : SurfaceFamily
        What is fitted.
    choose : callable
        Says where to measure next.
    clock : Clock
        The bench's clock; the time limit counts from the first direction.
    publish : callable
        Called with each fit and each choice.
    decisions : Decisions, optional
        What an earlier process has decided of the scan is decided again, without a fit.
    """

    def __init__(
        self,
        recipe: Recipe,
        visits: Visits,
        family: SurfaceFamily,
        choose: Choice,
        clock: Clock,
        publish: Callable[[Event], None],
        decisions: Decisions | None = None,
    ) -> None:
        assert recipe.time_limit_s is not None, "a recipe that steers is only accepted with a time limit"
        self._recipe, self._visits, self._family, self._choose = recipe, visits, family, choose
        self._clock, self._publish, self._limit_s = clock, publish, recipe.time_limit_s
        self._decisions = decisions or Decisions()
        self._closing_s = visits.closing_s()
        self._has_ended = False
        self._wanted = recipe.wanted
        self._start_s: float | None = None
        self._here = HOME
        self._directions = 0
        self._last: FitResult | None = None
        self._refusal = "there is no point yet"
        self.reason = ""

    @property
    def ahead(self) -> Target | None:
        """Not known before the last direction is: it is chosen by what was found there."""
        return None

    def next(self, points: Sequence[StokesPoint]) -> Sequence[Step]:
        """The steps of the next direction, when these points have been measured; at last those that close the scan."""
        if self._has_ended:
            return ()
        if (decided := self._decisions.of(str(self._directions))) is not None:
            return self._again(**decided)
        if (decided := self._decisions.of(_END)) is not None:
            return self._end(**decided)
        self._last = self._fit(points) if points else None
        judgement = judge(self._last, self._wanted) if self._last and self._wanted else None
        if judgement is not None and judgement.is_reached:
            return self._end_now(f"wanted standard errors reached: {judgement.standing}")
        elapsed_s = self._elapsed_s()
        unmet = () if judgement is None else judgement.unmet
        left_s = self._limit_s - elapsed_s - self._closing_s
        visit = self._choose(Situation(points, self._last, unmet, self._here, elapsed_s, left_s))
        steps = self._visits.steps(self._directions, visit.exit_deg, visit.readings, self._here) if visit else ()
        if visit is None or sum(step.duration_s for step in steps) > left_s:
            return self._end_now(self._time_is_up(judgement))
        standing = "" if judgement is None else judgement.standing
        self._decisions.note(str(self._directions), {**asdict(visit), "standing": standing, "begun_s": self._start_s})
        return self._go_to(visit, steps, standing)

    def _go_to(self, visit: Visit, steps: Sequence[Step], standing: str) -> Sequence[Step]:
        self._choose.chosen(visit, sum(step.duration_s for step in steps))
        self._here = steps[-1].target
        self._directions += 1  # there are fewer points where one was skipped
        self._publish(DirectionChosen(self._directions - 1, visit.exit_deg, visit.readings, visit.why, standing))
        return steps

    def _again(self, exit_deg: float, readings: int, why: str, standing: str, begun_s: float) -> Sequence[Step]:
        self._start_s = begun_s
        steps = self._visits.steps(self._directions, exit_deg, readings, self._here)
        return self._go_to(Visit(exit_deg, readings, why), steps, standing)

    def has_measured(self, so_far: Callable[[], StokesPoint]) -> bool:
        """Every direction is measured in one go."""
        return True

    def _end_now(self, reason: str) -> Sequence[Step]:
        self._decisions.note(_END, {"reason": reason})
        return self._end(reason)

    def _end(self, reason: str) -> Sequence[Step]:
        self.reason, self._has_ended = reason, True
        return self._visits.closing(self._directions - 1, self._here) if self._directions else ()

    def _elapsed_s(self) -> float:
        if self._start_s is None:
            self._start_s = self._clock.now()
        return self._clock.now() - self._start_s - self._decisions.time_lost_s()

    def _fit(self, points: Sequence[StokesPoint]) -> FitResult | None:
        try:
            with named_in_degrees():
                result = self._searched(points)
        except FitError as error:
            self._refusal = str(error)
        except Exception as error:  # noqa: BLE001 (a fault of the fit must not cost the scan its readings)
            self._refusal = f"the fit has stopped: {type(error).__name__}: {error}"
        else:
            self._publish(FitUpdated(len(points), result))
            return result
        self._publish(FitRefused(len(points), self._refusal))
        return None

    def _searched(self, points: Sequence[StokesPoint]) -> FitResult:
        """The best of all optima; along a list it is enough to follow the last one while nothing hangs on it."""
        data, arguments = dataset(points), fit_arguments(self._recipe.fit)
        if self._last is not None and not self._recipe.adaptive:
            objective, robust = arguments["objective"], arguments["robust"]
            followed = follow(data, self._family, self._last, objective=objective, robust=robust)
            if not misfit(followed) and not judge(followed, self._wanted).is_reached:
                return followed
        return fit(data, self._family, **arguments)

    def _time_is_up(self, judgement: Judgement | None) -> str:
        ended = f"time limit of {self._limit_s:g} s"
        if not self._wanted:
            return ended
        if judgement is None:
            return f"{ended}: no wanted standard error is known, because {self._refusal}"
        if judgement.doubts:
            doubts = "; ".join(judgement.doubts)
            return f"{ended}: {doubts}; so the standard errors are not to be trusted: {judgement.standing}"
        return f"{ended}: wanted standard errors not reached: {judgement.standing}"
