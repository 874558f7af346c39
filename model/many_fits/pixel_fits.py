"""Fit many pixels.

Pixels of one sample resemble each other. So some, spread evenly, are fitted from several starts each, and where they
end joins the low-discrepancy points that all others choose their one start from. What then fits badly is fitted from
further starts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from model.fit.bounds import off_bounds
from model.fit.family import SurfaceFamily
from model.fit.levenberg_marquardt import minimise
from model.fit.observable import Elements, Observable
from model.fit.problem import Places, Problem
from model.geometry import FloatArray
from model.many_fits.compiled_problem import CompiledProblem
from model.many_fits.errors import standard_errors
from model.many_fits.pixel_search import OwnSearch, Search, SharedSearch
from model.many_fits.pixels import Block, Pixels
from model.many_fits.result import ManyFits, Status

_AT_ONCE = 1024
_PILOTS = 64
_POLISHED = 4
_MOST_STEPS = 200
# A chi-square that chance exceeds less often asks for further starts.
_UNLIKELY = 0.01
# Half-angles of a cone, from the mirror direction, within which it sees other things than its axis.
_CONES = 3.0

# Parameters, costs, and whether least squares settled there.
Ends = tuple[FloatArray, FloatArray, NDArray[np.bool_]]


class Pilots(NamedTuple):
    """What a few pixels tell of the others: where their fits end (Q, P), and the variance of their residuals."""

    ends: FloatArray
    variance: float = 1.0


class PixelFits:
    """Fits of many pixels.

    Parameters
    ----------
    pixels : Pixels
        What was measured.
    family : SurfaceFamily
        Surfaces to choose from.
    observable : Observable
        What was measured of their light.
    seed : int
        Seed of the search.
    """

    def __init__(self, pixels: Pixels, family: SurfaceFamily, observable: Observable, seed: int) -> None:
        self._pixels, self._family, self._observable, self._seed = pixels, family, observable, seed
        self._result = ManyFits.none_yet(family.names, pixels.count)
        self._search: Search = OwnSearch(seed)

    def pilots(self) -> Pilots:
        """Fit a few pixels, spread evenly, from several starts each."""
        candidates = np.unique(np.linspace(0, max(self._pixels.count - 1, 0), _AT_ONCE).astype(np.int64))
        good = self._good(candidates[: self._pixels.count])
        nothing_to_learn = self._pixels.has_errors and not self._pixels.share_directions
        if not len(good) or nothing_to_learn:
            return Pilots(np.empty((0, len(self._family.names))))
        places = good[np.unique(np.linspace(0, len(good) - 1, _PILOTS).astype(np.int64))]
        part = self._part(places)
        if self._pixels.share_directions:
            self._search = SharedSearch(part.rough, self._seed)
        x, cost, settled = self._ends(part, np.arange(len(places)), _POLISHED)
        if self._pixels.has_errors or not settled.any():
            return Pilots(x[settled])
        freedom = np.maximum(self._known(places) - len(self._family.names), 1)
        return Pilots(x[settled], float(np.median(cost[settled] / freedom[settled])))

    def all(self, pilots: Pilots, start: FloatArray | None) -> ManyFits:
        """Fit all of them, from starts (1 or B, P) if there are any."""
        good = np.concatenate([self._good(places) for places in _parts(np.arange(self._pixels.count))])
        for number, places in enumerate(_parts(good) if len(good) else []):
            part = self._part(places)
            if number == 0 and self._pixels.share_directions:
                self._search = SharedSearch(part.rough, self._seed, pilots.ends)
            self._fit(part, places, pilots.variance, start)
        return self._result

    def _good(self, places: Places) -> Places:
        """Those of some pixels that can be fitted; the status of the others is set."""
        status = self._result.status
        status[places[self._pixels.holds_one_value(places)]] = Status.ONE_VALUE
        status[places[self._known(places) < len(self._family.names)]] = Status.TOO_FEW
        good: Places = places[status[places] == Status.FITTED]
        return good

    def _known(self, places: Places) -> NDArray[np.int64]:
        known: NDArray[np.int64] = self._pixels.measured[places].sum(axis=1) * self._pixels.values.shape[2]
        return known + len(self._family.prior)

    def _part(self, places: Places) -> _Part:
        block, half_angle = self._pixels.block(places), self._family.detector_half_angle_rad
        problem = _problem(self._family, self._observable, block)
        if half_angle == 0.0:
            return _Part(block, problem, problem)
        block = block.away_from_the_mirror(_CONES * half_angle)
        return _Part(block, _problem(self._family.in_single_directions(), self._observable, block), problem)

    def _fit(self, part: _Part, places: Places, variance: float, start: FloatArray | None) -> None:
        which = np.arange(len(places))
        if start is None:
            x, cost, settled = self._ends(part, which, 1)
        else:
            x, cost, settled = part.end(start[places] if len(start) > 1 else start.repeat(len(places), axis=0), which)
        known = self._known(places)
        likely = variance * chdtri(np.maximum(known - x.shape[1], 1), _UNLIKELY)
        doubted = np.flatnonzero(~(settled & (cost <= likely)))
        if len(doubted):
            other_x, other_cost, other_settled = self._ends(part, doubted, _POLISHED)
            better = other_settled & (~settled[doubted] | (other_cost < cost[doubted]))
            x[doubted[better]], settled[doubted[better]] = other_x[better], True
        self._keep(places, part.problem, which, x, settled, known)

    def _ends(self, part: _Part, which: Places, count: int) -> Ends:
        """Where the best of so many starts end."""
        starts = self._search.starts(part.rough, which, part.block.some(which), count)
        begins = off_bounds(self._family, starts.reshape(-1, starts.shape[2]))
        ends = minimise(part.rough, begins, np.repeat(which, count), most_steps=_MOST_STEPS)
        cost = np.where(ends.settled, ends.cost, np.inf).reshape(-1, count)
        best = np.arange(len(cost)) * count + np.argmin(cost, axis=1)
        if part.problem is part.rough:
            return ends.x[best], ends.cost[best], ends.settled[best]
        return part.end(ends.x[best], which)

    def _keep(
        self,
        places: Places,
        problem: Problem,
        which: Places,
        x: FloatArray,
        settled: NDArray[np.bool_],
        known: NDArray[np.int64],
    ) -> None:
        result = self._result
        result.status[places[~settled]] = Status.NOT_SETTLED
        places, which, x, known = places[settled], which[settled], x[settled], known[settled]
        at = problem.normal_equations(x, which)
        stderr, held = standard_errors(problem, x, which, at, self._scatter(at.cost, known - x.shape[1]))
        determined = (held | np.isfinite(stderr)).all(axis=1)
        freedom = known - (~held).sum(axis=1)
        stderr *= self._scatter(at.cost, freedom)[:, None]
        result.status[places[~determined]] = Status.UNDETERMINED
        places = places[determined]
        for array, values in (
            (result.parameters, x),
            (result.stderr, stderr),
            (result.at_bound, held),
            (result.chi_square, at.cost),
            (result.degrees_of_freedom, freedom),
        ):
            array[places] = values[determined]

    def _scatter(self, cost: FloatArray, freedom: NDArray[np.int64]) -> FloatArray:
        """By how much errors are larger than the whitening has them: 1 where they are known."""
        if self._pixels.has_errors:
            return np.ones(len(cost))
        told = (freedom > 0) & (cost > 0.0)
        return np.sqrt(np.where(told, cost / np.where(told, freedom, 1), np.nan))


@dataclass(frozen=True, eq=False)
class _Part:
    """Some of the pixels: what is minimised, and the block and the problem that starts are searched for with.

    Cones cost a hundred directions for one, and what they average away moves an optimum by little.
    """

    block: Block
    rough: Problem
    problem: Problem

    def end(self, start: FloatArray, which: Places) -> Ends:
        """Where these starts (b, P) end."""
        begins = off_bounds(self.problem.family, start)
        ends = minimise(self.problem.resolving(begins), begins, which, most_steps=_MOST_STEPS)
        return ends.x, ends.cost, ends.settled


def _problem(family: SurfaceFamily, observable: Observable, block: Block) -> Problem:
    directions, values, whitener, _ = block
    if isinstance(observable, Elements) and CompiledProblem.is_possible(family):
        return CompiledProblem(family, observable, directions, values, whitener)
    return Problem(family, observable, directions, values, whitener)


def _parts(places: Places) -> list[Places]:
    return [places[first : first + _AT_ONCE] for first in range(0, max(len(places), 1), _AT_ONCE)]
