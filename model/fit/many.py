"""Fit many pixels at once: one family of surfaces, and values of every pixel measured in the same number of directions.

Pixels of one sample resemble each other. So some, spread evenly, are fitted from several starts each, and where they
end joins the low-discrepancy points that all others choose their one start from. What then fits badly is fitted from
further starts.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from model.fit.compiled_problem import CompiledProblem
from model.fit.family import WEIGHTS, SurfaceFamily
from model.fit.levenberg_marquardt import minimise
from model.fit.many_errors import standard_errors
from model.fit.observable import Elements, Observable
from model.fit.pixel_search import OwnSearch, Search, SharedSearch, off_bounds
from model.fit.pixels import Block, Pixels
from model.fit.problem import Places, Problem
from model.geometry import FloatArray
from model.mirror_direction import require_off_mirror

_AT_ONCE = 1024
_PILOTS = 64
_POLISHED = 4
_MOST_STEPS = 200
# A chi-square that chance exceeds less often asks for further starts.
_UNLIKELY = 0.01


class Status(IntEnum):
    """What became of a pixel; all but the first have NaN for a result."""

    FITTED = 0
    TOO_FEW = 1
    """Fewer values were measured than there are parameters."""
    ONE_VALUE = 2
    """All directions hold the same values: the pixel is dead, stuck, saturated or dark."""
    NOT_SETTLED = 3
    """Least squares did not end, because the values hardly tell some parameters apart."""
    UNDETERMINED = 4
    """There are changes of parameters that leave every fitted value the same."""


@dataclass(frozen=True, eq=False)
class ManyFits:
    """The best surface of a family for each of B pixels.

    Attributes
    ----------
    names : tuple of str
        The P free parameters.
    parameters : ndarray
        Shape (B, P).
    stderr : ndarray
        Shape (B, P); NaN for parameters at a bound. They follow from the data's errors, and are not rescaled by
        chi_square; where errors are not known, they follow from the scatter about the fit.
    at_bound : ndarray of bool
        Shape (B, P): parameters that would go beyond their bound if they could.
    chi_square : ndarray
        Shape (B,): sum of the squared residuals, in units of their errors where these are known.
    degrees_of_freedom : ndarray of int
        Shape (B,): values fitted, and priors, less parameters with a standard error.
    status : ndarray of int
        Shape (B,), of `Status`. Of what was not fitted all of the above is NaN, false or 0.
    """

    names: tuple[str, ...]
    parameters: FloatArray
    stderr: FloatArray
    at_bound: NDArray[np.bool_]
    chi_square: FloatArray
    degrees_of_freedom: NDArray[np.int64]
    status: NDArray[np.int64]

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Which pixels (B,) have a result."""
        settled: NDArray[np.bool_] = self.status == Status.FITTED
        return settled


def fit_many(
    directions: tuple[ArrayLike, ArrayLike, ArrayLike],
    values: ArrayLike,
    family: SurfaceFamily,
    *,
    covariance: ArrayLike | None = None,
    stderr: ArrayLike | None = None,
    measured: ArrayLike | None = None,
    observable: Observable = Elements(),  # noqa: B008 (frozen)
    start: ArrayLike | None = None,
    seed: int = 0,
    threads: int | None = None,
) -> ManyFits:
    """Find, for every pixel, the surface that fits its values best in the sense of least squares.

    Parameters
    ----------
    directions : tuple of array_like
        Incidence, exit and azimuth in rad, each (N,). They may be (B, N), if every pixel has its own; then starts are
        searched for pixel by pixel, which takes longer than all the rest, unless they are given.
    values : array_like
        Shape (B, N, M), of the observable; elements of light in 1/sr.
    family : SurfaceFamily
        Surfaces to choose from.
    covariance : array_like, optional
        Of each direction's values, shape (N, M, M) for all pixels or (B, N, M, M).
    stderr : array_like, optional
        In place of it standard errors of independent values, shape (N, M) or (B, N, M). Without either all values count
        alike.
    measured : array_like of bool, optional
        Shape (N,) or (B, N): rows that count; what the others hold, be it NaN, is not looked at. All by default.
    observable : Observable
        What was measured.
    start : array_like, optional
        Where to start in place of a search: all parameters, shape (P,) or (B, P), such as the result at a neighbouring
        wavelength. Pixels that have a NaN there are searched for.
    seed : int
        Seed of the search.
    threads : int, optional
        How many to use; as many as there are cores by default. The result does not depend on it.

    Raises
    ------
    FitError
        If a value or an error that counts is not finite or not possible.
    ValueError
        If shapes do not agree; a start is outside the bounds; the observable has no scale, but no weight is held; or a
        direction is the mirror direction, where light of several bounces is infinite.
    """
    pixels = Pixels(directions, values, covariance, stderr, measured, observable)
    if not observable.has_scale and not set(WEIGHTS.values()) & family.fixed.keys():
        raise ValueError(
            f"{', '.join(observable.columns)} do not say how much light there is, so that one weight has to be held: "
            f"give family.holding('{family.weights[0]}', 1.0). Nothing was fitted."
        )
    if not family.detector_half_angle_rad and any(lobe.has_caustic for lobe in family.lobes):
        require_off_mirror(*directions)
    fits = _Fits(pixels, family, observable, seed)
    return fits.all(_checked_start(start, pixels, family), threads or _cores())


class _Fits:
    """What all pixels have in common, and their results as they come in."""

    def __init__(self, pixels: Pixels, family: SurfaceFamily, observable: Observable, seed: int) -> None:
        self._pixels, self._family, self._observable, self._seed = pixels, family, observable, seed
        count, width = pixels.count, len(family.names)
        self._result = ManyFits(
            family.names,
            parameters=np.full((count, width), np.nan),
            stderr=np.full((count, width), np.nan),
            at_bound=np.zeros((count, width), bool),
            chi_square=np.full(count, np.nan),
            degrees_of_freedom=np.zeros(count, np.int64),
            status=np.full(count, Status.FITTED, np.int64),
        )
        self._search: Search = OwnSearch(seed)
        self._variance = 1.0  # of a residual

    def all(self, start: FloatArray | None, threads: int) -> ManyFits:
        for places in _parts(np.arange(self._pixels.count)):
            self._refuse(places)
        good = np.flatnonzero(self._result.settled)
        if len(good):
            self._send_pilots(good)
        with ThreadPoolExecutor(threads, thread_name_prefix="pixels") as pool:
            for _ in pool.map(lambda places: self._fit(places, start), _parts(good)):
                pass  # an error of one of them is raised here, and those not begun are left
        return self._result

    def _refuse(self, places: Places) -> None:
        status, pixels = self._result.status, self._pixels
        status[places[pixels.holds_one_value(places)]] = Status.ONE_VALUE
        status[places[self._known(places) < len(self._family.names)]] = Status.TOO_FEW

    def _known(self, places: Places) -> NDArray[np.int64]:
        known: NDArray[np.int64] = self._pixels.measured[places].sum(axis=1) * self._pixels.values.shape[2]
        return known + len(self._family.prior)

    def _problem(self, block: Block) -> Problem:
        directions, values, whitener, _ = block
        if isinstance(self._observable, Elements) and CompiledProblem.is_possible(self._family):
            return CompiledProblem(self._family, self._observable, directions, values, whitener)
        return Problem(self._family, self._observable, directions, values, whitener)

    def _send_pilots(self, good: Places) -> None:
        """Fit a few pixels well, to learn where their like end and how far data scatter."""
        places = good[np.unique(np.linspace(0, len(good) - 1, _PILOTS).astype(np.int64))]
        block = self._pixels.block(places)
        problem, which = self._problem(block), np.arange(len(places))
        if self._pixels.share_directions:
            self._search = SharedSearch(problem, self._seed)
        starts = self._search.starts(problem, which, block, _POLISHED)
        x, cost, settled = _best_end(problem, which, starts)
        if self._pixels.share_directions:
            self._search = SharedSearch(problem, self._seed, x[settled])
        freedom = self._known(places) - len(self._family.names)
        if not self._pixels.has_errors and settled.any():
            self._variance = float(np.median(cost[settled] / np.maximum(freedom[settled], 1)))

    def _fit(self, places: Places, start: FloatArray | None) -> None:
        block = self._pixels.block(places)
        problem, which = self._problem(block), np.arange(len(places))
        if start is None:
            starts = self._search.starts(problem, which, block, 1)
        else:
            starts = start[places if len(start) > 1 else 0 * places][:, None]
            lost = np.flatnonzero(np.isnan(starts).any(axis=(1, 2)))
            if len(lost):
                starts[lost] = self._search.starts(problem, lost, self._pixels.block(places[lost]), 1)
        x, cost, settled = _best_end(problem, which, starts)
        known = self._known(places)
        likely = self._variance * chdtri(np.maximum(known - x.shape[1], 1), _UNLIKELY)
        doubted = np.flatnonzero(~(settled & (cost <= likely)))
        if len(doubted):
            further = self._search.starts(problem, doubted, self._pixels.block(places[doubted]), _POLISHED)
            other_x, other_cost, other_settled = _best_end(problem, doubted, further)
            better = ~settled[doubted] | (other_cost < cost[doubted])
            better &= other_settled
            x[doubted[better]], cost[doubted[better]] = other_x[better], other_cost[better]
            settled[doubted[better]] = True
        self._keep(places, problem, which, x, settled, known)

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
        stderr, held = standard_errors(problem, x, which, at)
        freedom = known - (~held).sum(axis=1)
        if not self._pixels.has_errors:
            with np.errstate(divide="ignore", invalid="ignore"):
                stderr *= np.sqrt(np.where(freedom > 0, at.cost / freedom, np.nan))[:, None]
        determined = (held | np.isfinite(stderr)).all(axis=1) | (freedom <= 0)
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


def _best_end(problem: Problem, which: Places, starts: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Where the best of several starts (b, count, P) ends, its cost, and whether it settled."""
    count = starts.shape[1]
    begins = off_bounds(problem.family, starts.reshape(-1, starts.shape[2]))
    ends = minimise(problem.resolving(begins), begins, np.repeat(which, count), most_steps=_MOST_STEPS)
    cost = np.where(ends.settled, ends.cost, np.inf).reshape(-1, count)
    best = np.arange(len(cost)) * count + np.argmin(cost, axis=1)
    return ends.x[best], ends.cost[best], ends.settled[best]


def _checked_start(start: ArrayLike | None, pixels: Pixels, family: SurfaceFamily) -> FloatArray | None:
    if start is None:
        return None
    given = np.atleast_2d(np.asarray(start, np.float64))
    width = len(family.names)
    if given.shape not in ((1, width), (pixels.count, width)):
        raise ValueError(
            f"start has shape {given.shape}; it needs {(width,)} or {(pixels.count, width)}, "
            f"for {', '.join(family.names)}. Nothing was fitted."
        )
    for place, name in enumerate(family.names):
        low, high = family.free[name]
        outside = (given[:, place] < low) | (given[:, place] > high)
        if outside.any():
            pixel = int(np.flatnonzero(outside)[0])
            raise ValueError(
                f"start has {name} = {given[pixel, place]:g} for pixel {pixel}; it needs a value from {low:g} to "
                f"{high:g}. Nothing was fitted."
            )
    return given


def _parts(places: Places) -> list[Places]:
    return [places[first : first + _AT_ONCE] for first in range(0, len(places), _AT_ONCE)]


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
