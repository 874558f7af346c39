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
from model.many_fits.block import Block
from model.many_fits.compiled_problem import CompiledProblem
from model.many_fits.errors import standard_errors
from model.many_fits.pixel_search import OwnSearch, Search, SharedSearch
from model.many_fits.pixels import Pixels
from model.many_fits.result import ManyFits, Status

_AT_ONCE = 1024
_PILOTS = 64
_POLISHED, _DOUBTED = 4, 8
_MOST_STEPS = 200
# A chi-square that chance exceeds less often asks for further starts.
_UNLIKELY = 0.01
# So does a standard error of a shape that is more than this share of its range: another optimum may fit about as well.
_WIDE = 0.03
# And so does a parameter at a bound, but for k of 0, where most dielectrics are.
_TRANSPARENT = 1e-3
# Half-angles of a cone, from the mirror direction, within which it sees other things than its axis.
_CONES = 3.0

# Parameters, costs, and whether least squares settled there.
Ends = tuple[FloatArray, FloatArray, NDArray[np.bool_]]


class Pilots(NamedTuple):
    """What a few pixels tell of the others.

    Attributes
    ----------
    ends : ndarray
        Shape (Q, P), where their fits end.
    whitener : ndarray
        Shape (M, M, N), their mean.
    variance : float
        Of their residuals.
    """

    ends: FloatArray
    whitener: FloatArray
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
        """Fit a few pixels, from the darkest to the brightest wherever they are, from several starts each."""
        good = self._all_good()
        nothing_to_learn = self._pixels.has_errors and not self._pixels.share_directions
        if not len(good) or nothing_to_learn:
            return Pilots(np.empty((0, len(self._family.names))), np.empty(0))
        good = good[np.argsort(np.concatenate([self._pixels.brightness(places) for places in _parts(good)]))]
        places = good[np.unique(np.linspace(0, len(good) - 1, _PILOTS).astype(np.int64))]
        part = self._part(places)
        measured = np.maximum(part.block.measured.sum(axis=0), 1)
        whitener = (part.block.whitener * part.block.measured[:, None, None]).sum(axis=0) / measured
        if self._pixels.share_directions:
            self._search = SharedSearch(part.rough, whitener, self._seed)
        x, cost, settled = self._ends(part, np.arange(len(places)), _POLISHED)
        if self._pixels.has_errors or not settled.any():
            return Pilots(x[settled], whitener)
        freedom = np.maximum(self._known(places) - len(self._family.names), 1)
        return Pilots(x[settled], whitener, float(np.median(cost[settled] / freedom[settled])))

    def all(self, pilots: Pilots, start: FloatArray | None) -> ManyFits:
        """Fit all of them, from starts (1 or B, P) if there are any."""
        good = self._all_good()
        for number, places in enumerate(_parts(good) if len(good) else []):
            part = self._part(places)
            if number == 0 and self._pixels.share_directions:
                self._search = SharedSearch(part.rough, pilots.whitener, self._seed, pilots.ends)
            self._fit(part, places, pilots.variance, start)
        return self._result

    def _all_good(self) -> Places:
        return np.concatenate([self._good(places) for places in _parts(np.arange(self._pixels.count))])

    def _good(self, places: Places) -> Places:
        """Those of some pixels that can be fitted; the status of the others is set."""
        status = self._result.status
        if any(_kind(name) in ("n", "k") for name in self._family.names):
            status[places[self._pixels.are_unpolarized(places)]] = Status.UNPOLARIZED
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
        self._result.status[places[~settled]] = Status.NOT_SETTLED
        self._keep(part.problem, places[settled], which[settled], x[settled])
        likely = variance * chdtri(np.maximum(self._known(places) - x.shape[1], 1), _UNLIKELY)
        certain = settled & (cost <= likely)
        if start is None:
            certain &= self._are_well_known(places, part.problem)
        doubted = np.flatnonzero(~certain)
        if len(doubted):
            other_x, other_cost, other_settled = self._ends(part, doubted, _DOUBTED)
            better = other_settled & (~settled[doubted] | (other_cost < cost[doubted]))
            self._keep(part.problem, places[doubted[better]], doubted[better], other_x[better])

    def _are_well_known(self, places: Places, problem: Problem) -> NDArray[np.bool_]:
        """Which fits (b,) know their parameters so well that chi-square would tell that there is a better optimum."""
        result, names = self._result, self._family.names
        x, held = result.parameters[places], result.at_bound[places]
        usual = np.array([_kind(name) == "k" for name in names]) & (x < _TRANSPARENT)
        shapes = [names.index(name) for name in self._family.shapes]
        narrow = result.stderr[places] <= _WIDE * (problem.high - problem.low)
        known: NDArray[np.bool_] = (narrow | held)[:, shapes].all(axis=1) & ~(held & ~usual).any(axis=1)
        return known

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

    def _keep(self, problem: Problem, places: Places, which: Places, x: FloatArray) -> None:
        """Keep fits that settled at x (b, P), in place of what was kept of these pixels before."""
        result, known = self._result, self._known(places)
        at = problem.normal_equations(x, which)
        stderr, held, determined = standard_errors(problem, x, which, at, self._scatter(at.cost, known - x.shape[1]))
        freedom = known - (~held).sum(axis=1)
        stderr *= self._scatter(at.cost, freedom)[:, None]
        result.status[places] = np.where(determined, Status.FITTED, Status.UNDETERMINED)
        for array, values, nothing in (
            (result.parameters, x, np.nan),
            (result.stderr, stderr, np.nan),
            (result.at_bound, held, False),
            (result.chi_square, at.cost, np.nan),
            (result.degrees_of_freedom, freedom, 0),
        ):
            array[places[determined]] = values[determined]
            array[places[~determined]] = nothing

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


def _kind(name: str) -> str:
    """A parameter's name without that of its lobe."""
    return name.rpartition(".")[2]


def _parts(places: Places) -> list[Places]:
    return [places[first : first + _AT_ONCE] for first in range(0, max(len(places), 1), _AT_ONCE)]
