"""Values of many pixels, measured in the same number of directions, with their errors and with what is missing."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from goniometer.errors import FitError
from model.domain import require_directions
from model.fit.observable import Observable
from model.fit.problem import Places
from model.geometry import FloatArray
from model.many_fits.block import Block

_NOTHING = "Nothing was fitted."
_ROUNDING = 1e-9


class Pixels:
    """B sets of values.

    Parameters
    ----------
    directions : tuple of array_like
        Incidence, exit and azimuth in rad, each (N,), or (B, N) if every pixel has its own.
    values : array_like
        Shape (B, N, M).
    covariance, stderr : array_like or None
        Shape (N, M, M) or (B, N, M, M), and (N, M) or (B, N, M): one of them or none.
    measured : array_like of bool or None
        Shape (N,) or (B, N): which directions count; None for all.
    observable : Observable
        What was measured.

    Raises
    ------
    FitError
        If a value or an error that counts is not finite or not possible; names how many pixels, and the first.
    ValueError
        If shapes do not agree, both kinds of errors are given, or a direction is out of its range.
    """

    def __init__(
        self,
        directions: tuple[ArrayLike, ArrayLike, ArrayLike],
        values: ArrayLike,
        covariance: ArrayLike | None,
        stderr: ArrayLike | None,
        measured: ArrayLike | None,
        observable: Observable,
    ) -> None:
        self.values = np.asarray(values, np.float64)
        self._polarized = [place for place, name in enumerate(observable.columns) if name in ("s1", "s2", "s3")]
        self._before = 0
        _require_shape("values", self.values, (len(self.values), *self.values.shape[1:2], len(observable.columns)))
        size, width = self.values.shape[1:]
        incidence, exit_, azimuth = (np.asarray(angle, np.float64) for angle in directions)
        for name, angle in (("incidence_rad", incidence), ("exit_rad", exit_), ("azimuth_rad", azimuth)):
            _require_shape(name, angle, (size,), (self.count, size))
        require_directions(incidence, exit_, azimuth)
        self.share_directions = incidence.ndim == exit_.ndim == azimuth.ndim == 1
        if not self.share_directions:
            incidence, exit_, azimuth = (
                np.broadcast_to(angle, (self.count, size)) for angle in (incidence, exit_, azimuth)
            )
        self._directions = (incidence, exit_, azimuth)
        given = np.ones(size, bool) if measured is None else np.asarray(measured, bool)
        _require_shape("measured", given, (size,), (self.count, size))
        self.measured: NDArray[np.bool_] = np.broadcast_to(given, (self.count, size))
        if covariance is not None and stderr is not None:
            raise ValueError(f"both covariance and stderr are given; give one of them. {_NOTHING}")
        self._stderr = None if stderr is None else _shared_or_own("stderr", stderr, self.count, (size, width))
        self._covariance = (
            None if covariance is None else _shared_or_own("covariance", covariance, self.count, (size, width, width))
        )
        self.has_errors = not (stderr is None and covariance is None)
        self._refuse(np.asarray(np.isfinite(self.values).all(axis=2)), "a value is not a finite number")
        if self._stderr is not None:
            possible = (self._stderr > 0.0) & (self._stderr < np.inf)
            self._refuse(np.asarray(possible.all(axis=2)), "stderr is not a finite number above 0")
        if self._covariance is not None:
            self._refuse(np.asarray(np.isfinite(self._covariance).all(axis=(2, 3))), "the covariance is not finite")
            self._refuse(_is_symmetric(self._covariance), "the covariance is not symmetric")

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.values)

    def part(self, own: slice) -> Pixels:
        """The pixels from one number to another."""
        part = copy.copy(self)
        part.values, part.measured, part._before = self.values[own], self.measured[own], self._before + own.start
        if not self.share_directions:
            incidence, exit_, azimuth = self._directions
            part._directions = (incidence[own], exit_[own], azimuth[own])
        if self._stderr is not None and len(self._stderr) > 1:
            part._stderr = self._stderr[own]
        if self._covariance is not None and len(self._covariance) > 1:
            part._covariance = self._covariance[own]
        return part

    def block(self, places: Places) -> Block:
        """Some of the pixels.

        Raises
        ------
        FitError
            If a covariance is not positive definite.
        """
        measured = self.measured[places]
        shared = self.share_directions
        incidence, exit_, azimuth = (angle if shared else angle[places] for angle in self._directions)
        values = np.where(measured[..., None], self.values[places], 0.0).transpose(0, 2, 1)
        return Block((incidence, exit_, azimuth), values, self._whitener(places, measured), measured)

    def holds_one_value(self, places: Places) -> NDArray[np.bool_]:
        """Which pixels (b,) are dead, stuck or saturated: all that was measured is the same, but for its direction."""
        one = np.zeros(len(places), bool)
        if any(np.ptp(angle) > 0.0 for angle in self._directions):
            suspected = np.flatnonzero(
                ~self.measured[places].all(axis=1) | (self.values[places, 0] == self.values[places, -1]).all(axis=1)
            )
            values, counts = self.values[places[suspected]], self.measured[places[suspected]][..., None]
            low = np.where(counts, values, np.inf).min(axis=1)
            high = np.where(counts, values, -np.inf).max(axis=1)
            one[suspected] = (low >= high).all(axis=1)
        return one

    def are_unpolarized(self, places: Places) -> NDArray[np.bool_]:
        """Which pixels (b,) hold S1, S2 and S3 of exactly 0 in all directions, if these were to be measured."""
        none = np.zeros(len(places), bool)
        if self._polarized:
            measured = self.measured[places]
            dark = ~self.values[places, 0][:, self._polarized].any(axis=1)
            suspected = np.flatnonzero(dark | ~measured[:, 0])
            values = self.values[places[suspected]][..., self._polarized]
            none[suspected] = ~(values.any(axis=2) & measured[suspected]).any(axis=1)
        return none

    def brightness(self, places: Places) -> FloatArray:
        """The mean (b,) of all that was measured of pixels."""
        measured = self.measured[places]
        values = np.where(measured[..., None], self.values[places], 0.0)
        mean: FloatArray = values.sum(axis=(1, 2)) / np.maximum(measured.sum(axis=1), 1)
        return mean

    def _whitener(self, places: Places, measured: NDArray[np.bool_]) -> FloatArray:
        of_errors = self._of_stderr if self._covariance is None else self._of_covariance
        whitener = of_errors(places, measured)
        return whitener if bool(measured.all()) else whitener * measured[:, None, None, :]

    def _of_stderr(self, places: Places, measured: NDArray[np.bool_]) -> FloatArray:
        size, width = self.values.shape[1:]
        stderr = np.ones((1, size, width)) if self._stderr is None else self._stderr
        stderr, counts = (stderr, _anywhere(measured)) if len(stderr) == 1 else (stderr[places], measured)
        whitener = np.zeros((len(stderr), width, width, size))
        for i in range(width):
            whitener[:, i, i] = 1.0 / np.where(counts, stderr[..., i], 1.0)
        return whitener

    def _of_covariance(self, places: Places, measured: NDArray[np.bool_]) -> FloatArray:
        assert self._covariance is not None, "asked for only if there is one"
        one = len(self._covariance) == 1
        own, counts = (self._covariance, _anywhere(measured)) if one else (self._covariance[places], measured)
        covariance = np.where(counts[..., None, None], own, np.eye(own.shape[-1]))
        whitener: FloatArray = inverse_root(covariance.transpose(2, 3, 0, 1)).transpose(2, 0, 1, 3)
        impossible = np.argwhere(~np.isfinite(whitener))
        if len(impossible):
            pixel, _, _, row = impossible[0]
            which = "all pixels" if one else f"pixel {self._before + places[pixel]}"
            raise FitError(f"Row {row} of {which}: the covariance is not positive definite. {_NOTHING}")
        return whitener

    def _refuse(self, possible: NDArray[np.bool_], what: str) -> None:
        """Refuse rows (1 or B, N) that are not possible, though they count."""
        one = len(possible) == 1
        bad = ~possible & (_anywhere(self.measured) if one else self.measured)
        if bad.any():
            pixels = np.flatnonzero(bad.any(axis=1))
            row = int(np.flatnonzero(bad[pixels[0]])[0])
            which = "all pixels" if one else f"{len(pixels)} of {self.count} pixels, the first of them {pixels[0]}"
            raise FitError(
                f"Row {row} of {which}: {what}. {_NOTHING} Say by `measured` which rows of which pixels count."
            )


def inverse_root(covariance: FloatArray) -> FloatArray:
    """Lower triangular W with W C Wᵀ = 1, for covariances C (M, M, ...); not finite where C is not positive definite.

    Matrix by matrix this takes longer than the fit they are for; so every entry is computed for all of them at once.
    """
    width = len(covariance)
    root, inverse = np.zeros_like(covariance), np.zeros_like(covariance)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for i in range(width):
            pivot = covariance[i, i] - (root[i, :i] ** 2).sum(axis=0)
            root[i, i] = np.sqrt(np.where(pivot > 0.0, pivot, np.nan))
            for j in range(i + 1, width):
                root[j, i] = (covariance[j, i] - (root[j, :i] * root[i, :i]).sum(axis=0)) / root[i, i]
        for i in range(width):
            inverse[i, i] = 1.0 / root[i, i]
            for j in range(i):
                inverse[i, j] = -(root[i, j:i] * inverse[j:i, j]).sum(axis=0) / root[i, i]
    return inverse


def _is_symmetric(covariance: FloatArray) -> NDArray[np.bool_]:
    """Which covariances (..., M, M) are, to rounding; what is not finite is not looked at."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(covariance - np.swapaxes(covariance, -1, -2)).max(axis=(-2, -1))
        symmetric: NDArray[np.bool_] = ~(apart > _ROUNDING * np.abs(covariance).max(axis=(-2, -1)))
    return symmetric


def _anywhere(measured: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows (1, N) that any pixel has."""
    return np.logical_or.reduce(measured)[None]  # type: ignore[no-any-return]


def _shared_or_own(name: str, array: ArrayLike, count: int, shape: tuple[int, ...]) -> FloatArray:
    values = np.asarray(array, np.float64)
    _require_shape(name, values, shape, (1, *shape), (count, *shape))
    return values.reshape(-1, *shape)


def _require_shape(name: str, array: NDArray[Any], *shapes: tuple[int, ...]) -> None:
    if array.shape not in shapes:
        allowed = " or ".join(str(shape) for shape in dict.fromkeys(shapes))
        raise ValueError(f"{name} has shape {array.shape}; it needs {allowed}. {_NOTHING}")
