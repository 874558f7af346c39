"""The material of every pixel: fits of the light that it sends into several directions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import surface_family
from acquisition.imaging.maps.binned_maps import BinnedMaps, binned, binned_grid
from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import FitError
from model.fit import SurfaceFamily
from model.geometry import FloatArray
from model.many_fits.fit_many import ManyFits, Status, fit_many

_MISFIT = 3.0
"""Chi-square a degree of freedom that noise alone does not reach in fits of ten values and more."""

_MOST_NAMED = 8
"""Directions without maps that a note lists."""


@dataclass(frozen=True, eq=False)
class MaterialMaps:
    """What fits found of blocks of map pixels; all maps (height, width), NaN where there is no fit.

    Attributes
    ----------
    grid : MapGrid or None
        The blocks in the sample's coordinates; None where maps are of the camera's own pixels.
    bin_px : int
        Width of a block in map pixels.
    parameters, stderr : mapping of str to ndarray
        By the parameter's name, angles in degrees; standard errors are NaN also at a bound and where the data know less
        than the bounds.
    at_bound : mapping of str to ndarray of bool
        Parameters that would go beyond their bound if they could.
    chi_square : ndarray
        Sum of squared residuals in standard errors.
    degrees_of_freedom, directions : ndarray of int
        Of each fit, and in how many directions a block is known.
    status : ndarray of int
        `Status`: why there is no fit.
    notes : tuple of str
        What a person should know of the fits.
    """

    grid: MapGrid | None
    bin_px: int
    parameters: Mapping[str, FloatArray]
    stderr: Mapping[str, FloatArray]
    at_bound: Mapping[str, NDArray[np.bool_]]
    chi_square: FloatArray
    degrees_of_freedom: NDArray[np.int64]
    directions: NDArray[np.int64]
    status: NDArray[np.int64]
    notes: tuple[str, ...] = ()


class MaterialFits:
    """Fits every block of pixels by itself, with the exit directions that it has.

    Where pixels have directions of their own, fits in the mean directions of all give the starts. A block that is known
    in so few directions that S0 and S1 are hardly more than the parameters is not fitted (`Status.TOO_FEW`).

    Parameters
    ----------
    choice : FitChoice
        What to fit; its objective must be "stokes".
    bin_px : int
        Blocks of so many by so many pixels are averaged; at most the maps' size.
    acceptance_sr : float, optional
        The detector's, which fits of several bounces need.

    Raises
    ------
    FitError
        If the fit section asks for what images cannot have.
    """

    def __init__(self, choice: FitChoice, *, bin_px: int = 1, acceptance_sr: float | None = None) -> None:
        _refuse_choice(choice)
        self._family, self._bin_px = surface_family(choice, acceptance_sr), bin_px
        self._blocks: list[BinnedMaps] = []
        self._grids: list[MapGrid | None] = []
        self._without: list[int] = []
        self._alike = 1.0

    def add(self, maps: DirectionMaps) -> None:
        """Take in the maps of one more direction; only blocks of them are kept, and of one without maps its number.

        Raises
        ------
        ReductionError
            If maps have no variances.
        """
        if not maps.maps:
            self._without.append(maps.point)
            return
        self._blocks.append(binned(maps, self._bin_px))
        self._grids.append(binned_grid(maps.grid, self._bin_px))
        self._alike = max(self._alike, maps.noise_area_px)

    def found(self, executor: Executor | None = None) -> MaterialMaps:
        """Fit all blocks.

        Parameters
        ----------
        executor : Executor, optional
            Who fits parts of the image, such as a `concurrent.futures.ProcessPoolExecutor`.

        Raises
        ------
        FitError
            If no direction has maps, or their sizes differ.
        """
        blocks, grids, bin_px = self._blocks, self._grids, self._bin_px
        shapes = {block.measured.shape for block in blocks}
        if len(shapes) != 1 or 0 in next(iter(shapes)) or any(grid != grids[0] for grid in grids):
            raise FitError(
                f"Fits of pixels need maps of one size, of at least one block of {bin_px} x {bin_px} pixels and in the "
                f"same place of the sample; there are maps of {len(blocks)} directions, in blocks of "
                f"{' and '.join(f'{width} x {height}' for height, width in shapes) or 'no size'}. Nothing was fitted."
            )
        (shape,) = shapes
        fits, counts = _fitted(blocks, self._family, executor)
        notes = (*_notes(blocks, self._without, self._alike, bin_px), *_misfits(fits))
        return _as_maps(fits, counts.reshape(shape), grids[0], bin_px, notes)


def _fitted(
    blocks: list[BinnedMaps], family: SurfaceFamily, executor: Executor | None
) -> tuple[ManyFits, NDArray[np.int64]]:
    """Fits of all blocks, and in how many directions each is known."""
    measured = np.stack([block.measured.ravel() for block in blocks], axis=1)
    counts: NDArray[np.int64] = measured.sum(axis=1)
    # In plane S2 says nothing of a surface, so that a direction counts for two values.
    enough = 2 * counts > len(family.names)
    which = np.flatnonzero(enough)
    values = np.stack([block.stokes.reshape(-1, 3) for block in blocks], axis=1)[which]
    covariance = np.stack([block.covariance.reshape(-1, 3, 3) for block in blocks], axis=1)[which]
    own = [
        np.stack([getattr(block, name).ravel() for block in blocks], axis=1)[which]
        for name in ("incidence_rad", "exit_rad", "phi_rad")
    ]
    found = ManyFits.none_yet(family.names, len(counts))
    found.status[~enough] = Status.TOO_FEW
    if not len(which):
        return found, counts
    seen = measured[which]
    shared = _mean_directions(own, seen)
    given = {"covariance": covariance, "measured": seen, "executor": executor}
    fits = fit_many(shared, values, family, **given)  # type: ignore[arg-type]
    if not all((angle == angle[:1]).all() for angle in own):
        incidence_rad, exit_rad, phi_rad = own
        fits = fit_many((incidence_rad, exit_rad, phi_rad), values, family, start=fits.parameters, **given)  # type: ignore[arg-type]
    for name in ("parameters", "stderr", "at_bound", "chi_square", "degrees_of_freedom", "status"):
        getattr(found, name)[which] = getattr(fits, name)
    return found, counts


def _mean_directions(own: list[FloatArray], seen: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Incidence, exit and azimuth (N,) of the mean of the unit vectors of all blocks that are known, each (B, N)."""
    incidence_rad, exit_rad, phi_rad = own
    weight = seen / np.maximum(seen.sum(axis=0), 1)
    horizontal = (weight * np.sin(exit_rad) * np.exp(1j * phi_rad)).sum(axis=0)
    vertical = (weight * np.cos(exit_rad)).sum(axis=0)
    if all((angle == angle[:1]).all() for angle in own):
        return incidence_rad[0], exit_rad[0], phi_rad[0]
    return incidence_rad.mean(axis=0), np.arctan2(np.abs(horizontal), vertical), np.angle(horizontal)


def _as_maps(
    found: ManyFits, counts: NDArray[np.int64], grid: MapGrid | None, bin_px: int, notes: tuple[str, ...]
) -> MaterialMaps:
    shape = counts.shape
    shown = {name: name.removesuffix("_rad") + "_deg" if name.endswith("_rad") else name for name in found.names}
    unit = [math.degrees(1.0) if name.endswith("_rad") else 1.0 for name in found.names]
    return MaterialMaps(
        grid=grid,
        bin_px=bin_px,
        parameters={
            name: (column * one).reshape(shape)
            for name, column, one in zip(shown.values(), found.parameters.T, unit, strict=True)
        },
        stderr={
            name: (column * one).reshape(shape)
            for name, column, one in zip(shown.values(), found.stderr.T, unit, strict=True)
        },
        at_bound={name: column.reshape(shape) for name, column in zip(shown.values(), found.at_bound.T, strict=True)},
        chi_square=found.chi_square.reshape(shape),
        degrees_of_freedom=found.degrees_of_freedom.reshape(shape),
        directions=counts,
        status=found.status.reshape(shape),
        notes=notes,
    )


def _notes(blocks: list[BinnedMaps], without: list[int], alike: float, bin_px: int) -> tuple[str, ...]:
    notes = []
    if without:
        listed = ", ".join(map(str, without[:_MOST_NAMED])) + (", …" if len(without) > _MOST_NAMED else "")
        notes.append(f"{len(without)} of {len(without) + len(blocks)} directions have no maps: {listed}.")
    if alike > 1.0:
        notes.append(
            f"Noise of maps is alike over {alike:.3g} pixels, because they are interpolated; neighbouring blocks of "
            f"{bin_px} x {bin_px} share some of it."
        )
    return tuple(notes)


def _misfits(fits: ManyFits) -> tuple[str, ...]:
    fitted = fits.degrees_of_freedom > 0
    per_degree = fits.chi_square[fitted] / fits.degrees_of_freedom[fitted]
    bad = int(np.count_nonzero(per_degree > _MISFIT))
    if not bad:
        return ()
    return (
        f"{bad} of {per_degree.size} fitted blocks are not described by the model, with a chi-square above {_MISFIT:g} "
        "a degree of freedom: their errors do not hold. At borders blocks hold two materials.",
    )


def _refuse_choice(choice: FitChoice) -> None:
    asked = [f"objective: {choice.objective}"] if choice.objective != "stokes" else []
    if choice.robust:
        asked.append("robust: true")
    if asked:
        raise FitError(
            f"The fit section has {' and '.join(asked)}, which fits of pixels cannot have. No pixel was fitted. They "
            "compare the Stokes parameters as they are, with objective: stokes; weights take up an unknown scale."
        )
