"""Fit many pixels at once: one family of surfaces, and values of all pixels measured in as many directions."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np
from numpy.typing import ArrayLike

from goniometer.errors import FitError
from model.fit.family import WEIGHTS, SurfaceFamily
from model.fit.observable import Elements, Observable
from model.geometry import FloatArray
from model.many_fits.pixel_fits import Pilots, PixelFits
from model.many_fits.pixels import Pixels
from model.many_fits.result import ManyFits, Status
from model.mirror_direction import require_off_mirror

__all__ = ["ManyFits", "Status", "fit_many"]

_PART = 2048


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
    executor: Executor | None = None,
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
    executor : Executor, optional
        Who fits parts of the image, such as a `concurrent.futures.ProcessPoolExecutor`. The result is the same to
        rounding. Threads are no faster than one: most operations are short, and share Python's lock.

    Raises
    ------
    FitError
        If a value or an error that counts is not finite or not possible, or priors are to be weighed against values
        without errors.
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
    if family.prior and not pixels.has_errors:
        raise FitError(
            f"What is known of {' and '.join(family.prior)} beforehand cannot be weighed against values without "
            "errors. Nothing was fitted. Give stderr or covariance, or leave the prior out."
        )
    if not family.detector_half_angle_rad and any(lobe.has_caustic for lobe in family.lobes):
        require_off_mirror(*directions)
    given = _checked_start(start, pixels, family)
    pilots = PixelFits(pixels, family, observable, seed).pilots()
    if executor is None:
        return _fitted(pixels, family, observable, seed, pilots, given)
    under_way = []
    for first in range(0, max(pixels.count, 1), _PART):
        part = slice(first, first + _PART)
        own = given if given is None or len(given) == 1 else given[part]
        under_way.append(executor.submit(_fitted, pixels.part(part), family, observable, seed, pilots, own))
    try:
        return ManyFits.joined([one.result() for one in under_way])
    finally:
        for one in under_way:
            one.cancel()


def _fitted(
    pixels: Pixels,
    family: SurfaceFamily,
    observable: Observable,
    seed: int,
    pilots: Pilots,
    start: FloatArray | None,
) -> ManyFits:
    return PixelFits(pixels, family, observable, seed).all(pilots, start)


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
