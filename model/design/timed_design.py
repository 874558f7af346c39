"""Designs for a time: where to measure, and how often, when getting to a direction costs time too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.design.design import Criterion, in_own_units, optimal_design
from model.design.information import standard_errors
from model.geometry import FloatArray

Cost = Callable[[Sequence[int]], tuple[float, FloatArray]]
"""Seconds for visiting some directions, given by their places, and for one more reading in each of them, shape (n,)."""

_ROUGH = 1e-3
# By so much must the criterion, the logarithm of a variance, fall for a further change of directions.
_WORTHWHILE = 1e-4
_NOTEWORTHY_SHARE = 1e-3
_SHIFTS = (-4, -1, 1, 4)
_MOST_ADDITIONS = 4


def timed_design(
    pieces: FloatArray,
    criterion: Criterion,
    cost: Cost,
    time_s: float,
    most_readings: int,
    prior: FloatArray | None = None,
) -> NDArray[np.int64]:
    """How often to read in each direction, for parameters to be known best after some time.

    The search begins where the optimal shares are, and drops, shifts and adds directions as long as that helps. Shares
    become whole readings one at a time, each where it gains most per second.

    Parameters
    ----------
    pieces : ndarray
        Shape (S, N, P, P): Fisher's information of one reading in each direction, for each of S samples, neighbours
        beside each other.
    criterion : Criterion
        What is to be known.
    cost : callable
        What visits and readings cost.
    time_s : float
        What they may cost together.
    most_readings : int
        In one direction.
    prior : ndarray, optional
        Shape (P, P), information there is beforehand.

    Returns
    -------
    ndarray
        Shape (N,): readings, 0 where nothing is measured.

    Raises
    ------
    FitError
        If the directions do not determine the parameters, or no sufficient set of them can be visited in that time.
    """
    search = _Search(pieces, criterion, cost, time_s, most_readings, prior)
    places = search.begin()
    excess_s, uncertainty = search.judged(places)
    while True:
        others = {other: search.judged(other) for other in search.neighbours(places)}
        best = min(others, key=lambda other: others[other], default=places)
        if not others.get(best, (np.inf, np.inf)) < (excess_s, uncertainty - _WORTHWHILE):
            break
        places, (excess_s, uncertainty) = best, others[best]
    if excess_s > 0.0:
        raise FitError(
            f"{time_s:g} s are not enough to visit as many directions as determine the parameters. There is no design. "
            "Allow more time."
        )
    return search.readings(places)


Places = tuple[int, ...]


class _Search:
    """Sets of directions, and how much is known after the time when it is shared best among them."""

    def __init__(
        self,
        pieces: FloatArray,
        criterion: Criterion,
        cost: Cost,
        time_s: float,
        most_readings: int,
        prior: FloatArray | None,
    ) -> None:
        self._pieces, self._criterion, self._prior = in_own_units(pieces, criterion, prior)
        self._cost, self._time_s, self._most = cost, time_s, most_readings

    def begin(self) -> Places:
        """The directions of the best design if visits cost nothing, of neighbours the heaviest if that will do."""
        every = range(self._pieces.shape[1])
        _, reading_s = self._cost(every)
        shares = self._shares(every, reading_s, self._time_s)
        places: Places = tuple(np.flatnonzero(shares > _NOTEWORTHY_SHARE).tolist())
        peaks = tuple(place for place in places if shares[place] == shares[max(place - 1, 0) : place + 2].max())
        return peaks if self._determine(peaks) else places

    def judged(self, places: Places) -> tuple[float, float]:
        """By how much one reading everywhere exceeds the time; else 0, and the criterion after the time."""
        if not self._determine(places):
            return np.inf, np.inf
        visits_s, reading_s = self._cost(places)
        left_s = self._time_s - visits_s
        if left_s < reading_s.sum():
            return float(reading_s.sum()) - left_s, np.inf
        readings = np.maximum(self._shares(places, reading_s, left_s) * left_s / reading_s, 1.0)
        return 0.0, self._criterion.uncertainty(self._told(places, readings * left_s / (readings @ reading_s)))

    def _determine(self, places: Places) -> bool:
        told = self._told(places, np.ones(len(places)))
        return all(np.isfinite(standard_errors(of_sample)).all() for of_sample in told)

    def neighbours(self, places: Places) -> Iterator[Places]:
        """Sets with one direction less, shifted or more."""
        count = self._pieces.shape[1]
        for place in places:
            rest = set(places) - {place}
            if rest:
                yield tuple(sorted(rest))
            for shift in _SHIFTS:
                if 0 <= place + shift < count and place + shift not in places:
                    yield tuple(sorted({*rest, place + shift}))
        gains = self._criterion.gains(self._told(places, self.readings(places)[list(places)]), self._pieces)
        padded = np.pad(gains, 1, constant_values=-np.inf)
        peaks = np.flatnonzero((gains >= padded[:-2]) & (gains >= padded[2:]))
        for place in sorted(peaks.tolist(), key=lambda place: -float(gains[place]))[:_MOST_ADDITIONS]:
            if place not in places:
                yield tuple(sorted({*places, place}))

    def readings(self, places: Places) -> NDArray[np.int64]:
        """Whole readings, shape (N,), that fit into the time."""
        visits_s, reading_s = self._cost(places)
        readings = np.ones(len(places), np.int64)
        left_s = self._time_s - visits_s - float(reading_s.sum())
        told, pieces = self._told(places, readings), self._pieces[:, list(places)]
        while (fits := (reading_s <= left_s) & (readings < self._most)).any():
            gains = self._criterion.gains(told, pieces) / reading_s
            best = int(np.argmax(np.where(fits, gains, -np.inf)))
            readings[best] += 1
            left_s -= float(reading_s[best])
            told = told + pieces[:, best]
        everywhere = np.zeros(self._pieces.shape[1], np.int64)
        everywhere[list(places)] = readings
        return everywhere

    def _shares(self, places: Sequence[int], reading_s: FloatArray, left_s: float) -> FloatArray:
        pieces = self._pieces[:, list(places)] * (left_s / reading_s)[:, None, None]
        return optimal_design(pieces, self._criterion, self._prior, tolerance=_ROUGH).shares

    def _told(self, places: Places, readings: FloatArray | NDArray[np.int64]) -> FloatArray:
        told: FloatArray = self._prior + np.einsum("n,snpq->spq", readings, self._pieces[:, list(places)])
        return told
