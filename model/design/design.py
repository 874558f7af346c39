"""Optimal designs: how to share time among directions so that parameters become known best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.design.information import standard_errors
from model.geometry import FloatArray

_MOST_EXCHANGES = 20_000
# The best step is looked for on a grid, and again on a finer one between the two points that hold it, until it is known
# to a part of itself.
_GRID = np.linspace(0.0, 1.0, 33)
_ROUNDS, _FINE = 8, 1e-3
# What is told as if beforehand, as a share of what all directions tell: the best design for one parameter may be blind
# to others, and information must stay regular.
_TRACE = 1e-6


@dataclass(frozen=True, eq=False)
class Criterion:
    """How uncertain parameters are: the mean logarithm of a variance, the less the better.

    It is convex in information. Information comes for S samples at a time, over which the criterion is averaged.

    Parameters
    ----------
    wanted : ndarray or None
        Shape (P,): the combination of parameters that shall be known (c-optimality); None for all alike, by the volume
        of their joint confidence region (D-optimality).
    alike : float
        Part of the criterion, 0 to 1, that counts all parameters alike beside the wanted one: with none, the best
        design for one parameter may leave others undetermined.
    """

    wanted: FloatArray | None = None
    alike: float = 0.0

    @property
    def alike_part(self) -> float:
        """Part of the criterion that counts all parameters alike."""
        return 1.0 if self.wanted is None else self.alike

    def uncertainty(self, told: FloatArray) -> float:
        """The criterion for information (S, P, P), which must be regular."""
        strengths, combinations = np.linalg.eigh(told)
        total = -self.alike_part * float(np.log(strengths).mean())
        if self.wanted is not None:
            variance = ((self.wanted @ combinations) ** 2 / strengths).sum(axis=-1)
            total += (1.0 - self.alike) * float(np.log(variance).mean())
        return total

    def gains(self, told: FloatArray, pieces: FloatArray) -> FloatArray:
        """How fast the criterion falls with each of N pieces (S, N, P, P) added to information (S, P, P).

        This is the sensitivity function of the equivalence theorem (Kiefer and Wolfowitz 1960): at the optimum no piece
        gains more than the design's own do on the average.
        """
        covariance = np.linalg.inv(told)
        each = self.alike_part / told.shape[-1] * np.einsum("spq,snqp->sn", covariance, pieces)
        if self.wanted is not None:
            known = covariance @ self.wanted
            of_wanted = np.einsum("sp,snpq,sq->sn", known, pieces, known) / (known @ self.wanted)[:, None]
            each += (1.0 - self.alike) * of_wanted
        gains: FloatArray = each.mean(axis=0)
        return gains

    def best_step(self, told: FloatArray, change: FloatArray, longest: float) -> float:
        """How much of a change (S, P, P) of information lowers the criterion most, at most `longest`."""
        root = np.linalg.inv(np.linalg.cholesky(told))
        rates, turned = np.linalg.eigh(root @ change @ np.swapaxes(root, -1, -2))
        parts = None if self.wanted is None else np.einsum("spq,sp->sq", turned, root @ self.wanted) ** 2

        def falls(steps: FloatArray) -> NDArray[np.bool_]:
            left = 1.0 / (1.0 + steps[:, None, None] * rates)
            fall = self.alike_part * (rates * left).mean(axis=-1)
            if parts is not None:
                variance = (parts * left).sum(axis=-1)
                fall = fall + (1.0 - self.alike) * (parts * left * rates * left).sum(axis=-1) / variance
            return np.asarray(fall.sum(axis=-1) > 0.0)

        low, width = 0.0, longest
        for _ in range(_ROUNDS):
            steps = low + width * _GRID
            still = falls(steps)
            if still.all():
                return low + width
            low, width = float(steps[max(int(np.argmin(still)) - 1, 0)]), width * float(_GRID[1])
            if width < _FINE * low:
                break
        return low


@dataclass(frozen=True, eq=False)
class Design:
    """Shares of the directions.

    Attributes
    ----------
    shares : ndarray
        Shape (N,), from 0, of sum 1.
    gains : ndarray
        Shape (N,): the sensitivity function there.
    shortfall : float
        No shares have a criterion lower by more than this.
    """

    shares: FloatArray
    gains: FloatArray
    shortfall: float


def optimal_design(
    pieces: FloatArray,
    criterion: Criterion,
    prior: FloatArray | None = None,
    *,
    tolerance: float = 1e-4,
) -> Design:
    """The shares of directions that make parameters known best.

    By vertex exchange (Böhning 1986): of the directions, the one that gains least gives to the one that gains most,
    until no shares can be better by more than the tolerance.

    Parameters
    ----------
    pieces : ndarray
        Shape (S, N, P, P): Fisher's information of each direction, were all time spent there, for each sample.
    criterion : Criterion
        What is to be known.
    prior : ndarray, optional
        Shape (P, P), information there is beforehand.
    tolerance : float
        Largest shortfall from the optimum.

    Raises
    ------
    FitError
        If all directions together do not determine the parameters, or exchanges do not settle.
    """
    pieces, criterion, prior = in_own_units(pieces, criterion, prior)
    if not np.isfinite(standard_errors(prior + pieces.mean(axis=(0, 1)))).all():
        raise FitError("All directions together do not determine the parameters. There is no best design of them.")
    trace = prior + _TRACE * pieces.mean(axis=1)
    shares = np.full(pieces.shape[1], 1.0 / pieces.shape[1])
    for _ in range(_MOST_EXCHANGES):
        told = trace + np.einsum("n,snpq->spq", shares, pieces)
        gains = criterion.gains(told, pieces)
        shortfall = float(gains.max() - shares @ gains)
        if shortfall <= tolerance:
            return Design(shares, gains, shortfall)
        best, worst = int(np.argmax(gains)), int(np.argmin(np.where(shares > 0.0, gains, np.inf)))
        step = criterion.best_step(told, pieces[:, best] - pieces[:, worst], float(shares[worst]))
        shares[best] += step
        shares[worst] -= step
    raise FitError(
        f"The design had not settled after {_MOST_EXCHANGES} exchanges; it is {shortfall:.1g} short of the best. "
        "No result is given. Fix a parameter that the directions hardly determine."
    )


def in_own_units(
    pieces: FloatArray, criterion: Criterion, prior: FloatArray | None
) -> tuple[FloatArray, Criterion, FloatArray]:
    """The same with parameters in units of what is told of each alone, so that no unit decides what is singular."""
    prior = np.zeros(pieces.shape[-2:]) if prior is None else prior
    lengths = np.sqrt(np.diag(pieces.mean(axis=(0, 1)) + prior))
    unit = np.where(lengths > 0.0, lengths, 1.0)
    scale = np.outer(unit, unit)
    wanted = None if criterion.wanted is None else criterion.wanted / unit
    return pieces / scale, replace(criterion, wanted=wanted), prior / scale
