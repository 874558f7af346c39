"""Least-squares problems: whitened differences between surfaces of a family and data, for many sets of data at once."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.forward import Forward
from model.fit.observable import Observable, RatioObservable
from model.geometry import FloatArray

Places = NDArray[np.int64]
_DARK = 1e-24
# Jacobians of so many problems are in memory at a time.
_AT_ONCE = 32


@dataclass(frozen=True, eq=False)
class Difference:
    """How far surfaces are from data, for b problems.

    Attributes
    ----------
    residuals : ndarray
        Shape (b, R): whitened differences, row by row of the data for each column, then those from priors.
    jacobian : ndarray
        Shape (b, P, R).
    cost : ndarray
        Shape (b,): sum of their squares; of a robust problem, of what it makes of them.
    values : ndarray
        Shape (b, M, N): the surfaces' own, not whitened.
    """

    residuals: FloatArray
    jacobian: FloatArray
    cost: FloatArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """What a step of least squares follows from, for b problems.

    Attributes
    ----------
    cost : ndarray
        Shape (b,).
    gradient : ndarray
        Shape (b, P): products of the Jacobian and the residuals, half of the cost's gradient.
    normal : ndarray
        Shape (b, P, P): products of the Jacobian with itself.
    """

    cost: FloatArray
    gradient: FloatArray
    normal: FloatArray


class Problem:
    """Fits of one family to many sets of values measured in as many directions.

    Parameters
    ----------
    family : SurfaceFamily
        Surfaces to choose from; P parameters are free.
    observable : Observable
        What was measured, M values in a direction.
    directions : tuple of ndarray
        Incidence, exit and azimuth (N,), or (B, N) if every set has its own.
    values : ndarray
        Shape (B, M, N).
    whitener : ndarray
        Shape (B, M, M, N), or (1, M, M, N) if all sets share it: lower triangular, 0 where nothing was measured.
    tolerated : float
        Length of a direction's whitened difference beyond which it counts by that length instead of its square (Huber
        1964); infinite for least squares.
    """

    def __init__(
        self,
        family: SurfaceFamily,
        observable: Observable,
        directions: tuple[FloatArray, FloatArray, FloatArray],
        values: FloatArray,
        whitener: FloatArray,
        tolerated: float = np.inf,
    ) -> None:
        self.family, self.observable, self.tolerated = family, observable, tolerated
        self._forward = Forward(family, observable.elements, *directions)
        self._whitener = whitener
        self._values, self._target = values, whitened(whitener, values)
        self.low, self.high = (np.array([family.free[name][side] for name in family.names]) for side in (0, 1))
        self.is_weight = np.array([name in family.weights for name in family.names], bool)
        self._known = [family.names.index(name) for name in family.prior]
        mean, self._prior_stddev = np.array(list(family.prior.values())).reshape(-1, 2).T
        self._prior_mean = mean[None]
        # What rounding leaves of the difference between equals.
        self.rounding = 1e-28 * np.einsum("bmn,bmn->b", self._target, self._target)

    @classmethod
    def of(cls, data: Dataset, family: SurfaceFamily, tolerated: float = np.inf) -> Problem:
        """The problem of one set of data."""
        values, whitener = data.values.T[None], np.moveaxis(data.whitener, 0, -1)[None]
        return cls(family, data.observable, data.directions, values, whitener, tolerated)

    def with_scattered_priors(self, random: np.random.Generator) -> Problem:
        """The same problem with the means of priors as another measurement of them would have given, for each set."""
        anew = copy.copy(self)
        scatter = random.standard_normal((self.count, len(self._known)))
        anew._prior_mean = self._prior_mean + self._prior_stddev * scatter
        return anew

    def holding(self, held: NDArray[np.bool_], x: FloatArray) -> Problem:
        """The same problem with some parameters (P,) held at the values that they have in x (P,)."""
        like = copy.copy(self)
        like.low, like.high = np.where(held, x, self.low), np.where(held, x, self.high)
        return like

    def resolving(self, x: FloatArray) -> Problem:
        """The same problem with cones' nodes just dense enough for surfaces like these, x (b, P)."""
        like = copy.copy(self)
        like._forward = self._forward.resolving(x)
        return like

    def unseen(self, lengths2: FloatArray) -> NDArray[np.bool_]:
        """Which parameters (b, P) no value depends on, from the squared lengths (b, P) of the Jacobian's rows.

        That is so of a lobe's weight too when its light is lost in the last digit of the brightest lobe's.
        """
        brightest = np.where(self.is_weight, lengths2, 0.0).max(axis=1, keepdims=True, initial=0.0)
        return lengths2 <= np.where(self.is_weight, _DARK * brightest, 0.0)

    @property
    def count(self) -> int:
        """How many sets of data there are."""
        return len(self._target)

    @property
    def directions(self) -> int:
        """How many directions each of them has."""
        return len(self._target[0, 0])

    def emitted(self, x: FloatArray, which: Places) -> tuple[FloatArray, FloatArray]:
        """Light (b, E, N) and derivatives (b, P, E, N) of surfaces with the parameters x (b, P)."""
        return self._forward(x, which)

    def light(self, x: FloatArray, which: Places) -> tuple[FloatArray, FloatArray]:
        """Values (b, M, N) and derivatives (b, P, M, N) of surfaces with the parameters x (b, P), not whitened."""
        return self.observable.of(*self._forward(x, which))

    def condition(self, light: FloatArray, which: Places) -> FloatArray:
        """Whitened `RatioObservable.condition` (b, M, E, N) on light like this, (b, E, N); 0 where there is none."""
        assert isinstance(self.observable, RatioObservable), "light itself is measured, and not ratios of it"
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            condition = self.observable.condition(
                light, self._values if len(self._values) == 1 else self._values[which]
            )
        whitener = self._whitener if len(self._whitener) == 1 else self._whitener[which]
        by_element = whitened(whitener[:, None], np.nan_to_num(condition, posinf=0.0, neginf=0.0).swapaxes(1, 2))
        return by_element.swapaxes(1, 2)

    def stokes(self, x: FloatArray) -> FloatArray:
        """S0, S1, S2 (N, 3) under unpolarized light of the one surface with the parameters x (P,)."""
        light = self._forward(x[None], np.zeros(1, np.int64))[0][0]
        stokes: FloatArray = light[:: self.observable.elements // 4][:3].T
        return stokes

    def difference(self, x: FloatArray, which: Places) -> Difference:
        """How far surfaces with the parameters x (b, P) are from the sets of data of these numbers (b,).

        Where a surface is dark, or beyond all numbers, differences of ratios are not finite: nothing is closer.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return self._difference(x, which)

    def _difference(self, x: FloatArray, which: Places) -> Difference:
        values, slopes = self.light(x, which)
        whitener = self._whitener if len(self._whitener) == 1 else self._whitener[which]
        target = self._target if len(self._target) == 1 else self._target[which]
        residuals = whitened(whitener, values) - target
        jacobian = whitened(whitener[:, None], slopes)
        cost = np.einsum("bmn,bmn->b", residuals, residuals)
        if np.isfinite(self.tolerated):
            residuals, jacobian, cost = self._bounded(residuals, jacobian)
        b = len(x)
        residuals = residuals.reshape(b, -1)
        jacobian = jacobian.reshape(b, x.shape[1], residuals.shape[1])
        if self._known:
            off = self._off_priors(x, which)
            pull = np.zeros((b, x.shape[1], len(self._known)))
            pull[:, self._known, range(len(self._known))] = 1.0 / self._prior_stddev
            residuals, jacobian = np.concatenate([residuals, off], axis=1), np.concatenate([jacobian, pull], axis=2)
            cost = cost + (off * off).sum(axis=1)
        return Difference(residuals, jacobian, cost, values)

    def _off_priors(self, x: FloatArray, which: Places) -> FloatArray:
        """How many standard deviations parameters are off what is known of them."""
        mean = self._prior_mean if len(self._prior_mean) == 1 else self._prior_mean[which]
        off: FloatArray = (x[:, self._known] - mean) / self._prior_stddev
        return off

    def off_priors(self, x: FloatArray) -> float:
        """The sum of the squares of how many standard deviations parameters (P,) are off what is known of them."""
        return float((self._off_priors(x[None], np.zeros(1, np.int64)) ** 2).sum())

    def normal_equations(self, x: FloatArray, which: Places) -> NormalEquations:
        """The normal equations of surfaces with the parameters x (b, P) and the sets of data of these numbers (b,)."""
        blocks = [slice(at, at + _AT_ONCE) for at in range(0, max(len(x), 1), _AT_ONCE)]
        parts = [_normal_equations(self.difference(x[block], which[block])) for block in blocks]
        return NormalEquations(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def _bounded(self, residuals: FloatArray, jacobian: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        # Huber's loss of each direction's length; weights √(limit/length) make its gradient that of least squares.
        length2 = np.einsum("bmn,bmn->bn", residuals, residuals)
        limit = self.tolerated
        length = np.sqrt(length2)
        far = length > limit
        cost = np.where(far, 2.0 * limit * length - limit * limit, length2).sum(axis=1)
        weight = np.sqrt(np.where(far, limit / np.where(far, length, 1.0), 1.0))
        return residuals * weight[:, None], jacobian * weight[:, None, None], cost


def _normal_equations(at: Difference) -> tuple[FloatArray, FloatArray, FloatArray]:
    with np.errstate(invalid="ignore", over="ignore"):  # of what is beyond all numbers
        gradient = np.matmul(at.jacobian, at.residuals[..., None])[..., 0]
        return at.cost, gradient, np.matmul(at.jacobian, at.jacobian.swapaxes(-1, -2))


def whitened(whitener: FloatArray, values: FloatArray) -> FloatArray:
    """Products of lower triangular matrices (..., M, M, N) and values (..., M, N), N side by side."""
    rows = []
    for row in range(values.shape[-2]):
        total = whitener[..., row, 0, :] * values[..., 0, :]
        for column in range(1, row + 1):
            total = total + whitener[..., row, column, :] * values[..., column, :]
        rows.append(total)
    return np.stack(rows, axis=-2)
