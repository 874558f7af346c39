"""Where to measure next: the stay that tells most per second, guarded against a fit that is wrong so far."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.course import Situation, Visit
from acquisition.expand import HOME, Visits
from acquisition.expected_noise import Detection, expected_covariance, light_of
from acquisition.fit_points import dataset, directions, in_degrees
from acquisition.recipe import MAX_READINGS, Recipe
from acquisition.stays import Prospect, criterion, plan, time_needed_s
from acquisition.wanted import misfit
from goniometer.errors import FitError
from model.design.information import information, prior_information, standard_errors
from model.fit import FitResult, SurfaceFamily
from model.geometry import FloatArray

_FEWEST_AT_FIRST = 4
_ELSEWHERE = 1 / 30
"""Share of the time that goes into directions far from all that were measured."""

_IN_CASE = "far from all others, in case the fit is wrong"

_LONGEST = 2.0
"""Longest stay, in units of the scan so far: while little is known, little is staked on it."""

_DECISIVE = 9.0
"""Difference of chi-square that decides between two optima."""


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Exit angles that can still be measured: what getting to each costs, and reading all slots once, in seconds."""

    exit_deg: FloatArray
    visit_s: FloatArray
    reading_s: float
    fewest: int
    longest_s: float
    left_s: float

    def visit(self, place: int, readings: float, why: str) -> Visit:
        """A visit with about so many readings, as far as they are allowed and fit into the time."""
        most = min(self.longest_s, self.left_s - float(self.visit_s[place])) / self.reading_s
        allowed = min(int(np.ceil(readings)), int(most), MAX_READINGS)
        return Visit(float(self.exit_deg[place]), max(allowed, self.fewest), why)


class Adaptive:
    """Chooses among a recipe's exit angles.

    A few directions spread over all of them come first. Then the rest of the time, or as much as is needed for what is
    wanted, is planned for the sample as it is known so far, and of the plan's stays the one is taken in which most of
    the time goes into readings. After it the plan is made anew. No stay lasts longer than twice the scan so far.

    Parameters
    ----------
    recipe : Recipe
        What is wanted; its exit angles are those to choose from, its `readings` the fewest of a stay.
    visits : Visits
        Knows how long it takes to get somewhere.
    family : SurfaceFamily
        What is fitted.
    detection : Detection
        Tells how noisy readings will be.
    """

    def __init__(self, recipe: Recipe, visits: Visits, family: SurfaceFamily, detection: Detection) -> None:
        assert isinstance(recipe.readings, int), "an adaptive recipe is only accepted with one number of readings"
        self._recipe, self._visits, self._family, self._detection = recipe, visits, family, detection
        self._fewest = recipe.readings
        self._elsewhere_s = 0.0

    def __call__(self, now: Situation) -> Visit | None:
        """The next direction; None when none fits into the time that is left."""
        first_deg = first_exits_deg(self._recipe, self._family)
        if len(now.points) < len(first_deg):
            return Visit(first_deg[len(now.points)], self._fewest, "one of the first, which are spread over all")
        candidates = self._candidates(now)
        if not candidates.exit_deg.size:
            return None
        farthest = _farthest(now, candidates)
        if now.result is None or misfit(now.result):
            return candidates.visit(farthest, self._fewest, "far from all others, because no fit describes the data")
        cost_s = float(candidates.visit_s[farthest]) + self._fewest * candidates.reading_s
        if self._elsewhere_s + cost_s <= _ELSEWHERE * now.elapsed_s:
            return candidates.visit(farthest, self._fewest, _IN_CASE)
        if now.result.alternatives:
            return self._deciding(now.result, candidates)
        try:
            return self._telling(now, now.result, candidates)
        except (FitError, np.linalg.LinAlgError):
            return candidates.visit(farthest, self._fewest, "far from all others, because some parameters are not told")

    def chosen(self, visit: Visit, duration_s: float) -> None:
        """Count the time that goes into directions far from all others."""
        if visit.why == _IN_CASE:
            self._elsewhere_s += duration_s

    def _candidates(self, now: Situation) -> _Candidates:
        exit_deg = np.array(sorted(set(self._recipe.exit_angles_deg())))

        def duration_s(angle_deg: float, readings: int) -> float:
            steps = self._visits.steps(len(now.points), angle_deg, readings, now.here)
            return sum(step.duration_s for step in steps)

        visit_s = np.array([duration_s(angle_deg, 0) for angle_deg in exit_deg.tolist()])
        reading_s = duration_s(float(exit_deg[0]), 1) - float(visit_s[0])
        fits = visit_s + self._fewest * reading_s <= now.left_s
        return _Candidates(exit_deg[fits], visit_s[fits], reading_s, self._fewest, _LONGEST * now.elapsed_s, now.left_s)

    def _light_and_noise(self, result: FitResult, exit_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Light (N, M) of the fitted surface, and the covariance (N, M, M) of one reading in every slot."""
        places_deg = self._places_deg(exit_deg)
        stokes = light_of(result.surface)(*places_deg)
        steps = self._visits.steps(1, float(exit_deg[0]), 1, HOME)
        analyzer = [step.analyzer for step in steps if step.kind == "signal"]
        noise = [
            expected_covariance(
                of_direction,
                incidence,
                angle_deg,
                self._detection,
                analyzer=analyzer,
                exposure_s=self._recipe.exposure_s,
                has_dark=self._recipe.dark,
            )
            for of_direction, incidence, angle_deg in zip(
                stokes, places_deg[0].tolist(), exit_deg.tolist(), strict=True
            )
        ]
        return stokes[:, : len(noise[0])], np.array(noise)

    def _places_deg(self, exit_deg: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Incidence, exit angle and exit azimuth, in the recipe's one plane."""
        (incidence,), (exit_azimuth,) = self._recipe.incidences_deg(), self._recipe.exit_azimuths_deg()
        return np.full(len(exit_deg), incidence), exit_deg, np.full(len(exit_deg), exit_azimuth)

    def _deciding(self, result: FitResult, candidates: _Candidates) -> Visit:
        """Where the best optimum and the next best differ most per second."""
        stokes, noise = self._light_and_noise(result, candidates.exit_deg)
        other = light_of(self._family.seen(result.alternatives[0].parameters))
        apart = stokes - other(*self._places_deg(candidates.exit_deg))[:, : stokes.shape[1]]
        each = np.einsum("np,np->n", apart, np.linalg.solve(noise, apart[..., None])[..., 0])
        readings = np.clip(np.ceil(_DECISIVE / np.maximum(each, 1e-9)), self._fewest, MAX_READINGS)
        told = np.minimum(each * readings, _DECISIVE)
        best = int(np.argmax(told / (candidates.visit_s + readings * candidates.reading_s)))
        return candidates.visit(best, float(readings[best]), "tells two optima of the fit apart")

    def _telling(self, now: Situation, result: FitResult, candidates: _Candidates) -> Visit:
        """The stay that is the largest part of the best use of the time, its visit included.

        Raises
        ------
        FitError
            If all directions together do not determine the parameters, or not in the time that is left.
        """
        known, pieces = self._information(now, result, candidates)
        prospect = Prospect(known, pieces, candidates.visit_s, candidates.reading_s)
        parameter, time_s, why = None, now.left_s, "tells most per second"
        if now.unmet:
            name, shown = now.unmet[0], in_degrees(result).parameters
            parameter, why = list(shown).index(name), f"tells most about {name} per second"
            stderr = shown[name].stderr
            share = self._recipe.wanted[name] / stderr if stderr else 0.0
            time_s = time_needed_s(prospect, parameter, share * float(standard_errors(known)[parameter]), now.left_s)
        best = plan(prospect, parameter, time_s)
        if best is None and not np.isfinite(standard_errors(known)).all():
            raise FitError("The time left is too short to determine all parameters.")
        if best is None:
            shortest_s = candidates.visit_s + self._fewest * candidates.reading_s
            gains = criterion(prospect, parameter).gains(known[None], pieces[None])
            return candidates.visit(int(np.argmax(gains / shortest_s)), self._fewest, why)
        stay_s = best.readings * candidates.reading_s
        largest = int(np.argmax(stay_s / (stay_s + candidates.visit_s[list(best.places)])))
        return candidates.visit(best.places[largest], float(best.readings[largest]), why)

    def _information(self, now: Situation, result: FitResult, candidates: _Candidates) -> tuple[FloatArray, FloatArray]:
        """What is known (P, P), and what a reading in every slot tells at each candidate (N, P, P)."""
        data = dataset(now.points)
        assert data.covariance is not None, "points have covariances"
        known = prior_information(self._family)
        told = information(self._family, data.directions, data.covariance, result.values, data.observable)
        _, noise = self._light_and_noise(result, candidates.exit_deg)
        incidence_deg, exit_deg, exit_azimuth_deg = self._places_deg(candidates.exit_deg)
        there = directions(incidence_deg, exit_deg, exit_azimuth_deg=exit_azimuth_deg)
        pieces = information(self._family, there, noise, result.values, data.observable)
        return known + told.sum(axis=0), pieces


def first_exits_deg(recipe: Recipe, family: SurfaceFamily) -> list[float]:
    """The exit angles with which an adaptive scan begins: spread evenly, from the end next to the surface normal."""
    exit_deg = sorted(set(recipe.exit_angles_deg()))
    enough = math.ceil(
        2 * len(family.names) / 3
    )  # three values each, and twice as many as parameters to judge a fit by
    count = min(max(_FEWEST_AT_FIRST, enough), len(exit_deg))
    places: NDArray[np.int64] = np.linspace(0, len(exit_deg) - 1, count).round().astype(np.int64)
    first_deg = [exit_deg[place] for place in places.tolist()]
    return first_deg if abs(first_deg[0]) <= abs(first_deg[-1]) else first_deg[::-1]


def _farthest(now: Situation, candidates: _Candidates) -> int:
    """The place farthest from all measured ones; once all are measured, in turn."""
    apart_deg = np.abs(candidates.exit_deg[:, None] - [point.exit_deg for point in now.points])
    visits = np.bincount(apart_deg.argmin(axis=0), minlength=len(candidates.exit_deg))
    return int(np.argmax(np.where(visits == visits.min(), apart_deg.min(axis=1), -1.0)))
