"""Stokes parameters of blocks of map pixels: what per-pixel fits are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.fit_points import directions
from acquisition.imaging.maps.direction_maps import DirectionMaps, Map
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import ReductionError
from model.geometry import FloatArray

_LINEAR = ("S0", "S1", "S2")
_PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class BinnedMaps:
    """Means over square blocks of pixels in one direction.

    Attributes
    ----------
    stokes : ndarray
        (height, width, 3): S0, S1, S2 in each block's own exit frame.
    covariance : ndarray
        (height, width, 3, 3).
    measured : ndarray of bool
        (height, width): blocks of which at least half the pixels are known, well enough for a covariance.
    incidence_rad, exit_rad, phi_rad : ndarray
        (height, width): each block's own direction.
    """

    stokes: FloatArray
    covariance: FloatArray
    measured: NDArray[np.bool_]
    incidence_rad: FloatArray
    exit_rad: FloatArray
    phi_rad: FloatArray


def binned(maps: DirectionMaps, bin_px: int) -> BinnedMaps:
    """Average blocks of `bin_px` x `bin_px` pixels; rows and columns that do not fill a block are left out.

    The mean of N pixels has the mean of their covariances over N, times the pixels over which noise is alike, as far as
    a block holds so many.

    Raises
    ------
    ReductionError
        When there are no variances.
    """
    missing = [name for name in _needed() if name not in maps.maps]
    if missing:
        raise ReductionError(
            f"The maps of direction {maps.point} hold no {', '.join(missing)}, which fits of pixels need. Nothing was "
            "fitted. Ask for the Stokes parameters with variances and covariances."
        )
    planes = {name: np.asarray(maps.maps[name], np.float64) for name in _needed()}
    known = np.logical_and.reduce([np.isfinite(plane) for plane in planes.values()])
    blocks = _Blocks(known, bin_px)
    stokes = np.stack([blocks.mean(planes[name]) for name in _LINEAR], axis=-1)
    covariance = np.empty((*stokes.shape, 3))
    alike = np.clip(maps.noise_area_px, 1.0, np.maximum(blocks.counts, 1)) / np.maximum(blocks.counts, 1)
    for place, name in enumerate(_LINEAR):
        covariance[..., place, place] = blocks.mean(planes[f"{name}_variance"]) * alike
    for one, other in _PAIRS:
        shared = blocks.mean(planes[f"S{one}_S{other}_covariance"]) * alike
        covariance[..., one, other] = covariance[..., other, one] = shared
    measured = (2 * blocks.counts >= bin_px**2) & _is_possible(covariance)
    incidence_rad, exit_rad, phi_rad, turn_rad = _own_directions(maps, blocks, stokes.shape[:2])
    turn = _frame_turn(turn_rad)
    return BinnedMaps(
        stokes=np.einsum("...ij,...j->...i", turn, stokes),
        covariance=turn @ covariance @ np.swapaxes(turn, -1, -2),
        measured=measured,
        incidence_rad=incidence_rad,
        exit_rad=exit_rad,
        phi_rad=phi_rad,
    )


def binned_grid(grid: MapGrid | None, bin_px: int) -> MapGrid | None:
    """The pixels that blocks of a grid's are."""
    if grid is None:
        return None
    return MapGrid(grid.left_mm, grid.top_mm, grid.pixel_mm * bin_px, grid.width // bin_px, grid.height // bin_px)


class _Blocks:
    """Means over blocks of the pixels that are known; NaN where there are none."""

    def __init__(self, known: NDArray[np.bool_], bin_px: int) -> None:
        self._bin_px, self._known = bin_px, known
        self.counts = self._sum(known.astype(np.float64))

    def mean(self, plane: NDArray[np.floating]) -> FloatArray:
        total = self._sum(np.where(self._known, plane, 0.0))
        mean: FloatArray = np.where(self.counts > 0.0, total / np.maximum(self.counts, 1.0), np.nan)
        return mean

    def _sum(self, plane: FloatArray) -> FloatArray:
        size = self._bin_px
        height, width = plane.shape[0] // size, plane.shape[1] // size
        blocks = plane[: height * size, : width * size].reshape(height, size, width, size)
        total: FloatArray = blocks.sum(axis=(1, 3))
        return total


def _own_directions(maps: DirectionMaps, blocks: _Blocks, shape: tuple[int, int]) -> Sequence[FloatArray]:
    """Incidence, exit and azimuth of blocks, and the turn of their s-direction; all in rad, (height, width) each."""
    own = maps.pixel_directions
    if own is None:
        axis = directions(maps.incidence_deg, maps.exit_deg, exit_azimuth_deg=maps.exit_azimuth_deg or 0.0)
        return [np.broadcast_to(angle, shape) for angle in (*axis, np.zeros(()))]
    horizontal = np.sin(_radians(own.polar_deg)) * np.exp(1j * _radians(own.phi_deg))
    vertical = np.cos(_radians(own.polar_deg))
    east, north, up = (blocks.mean(part) for part in (horizontal.real, horizontal.imag, vertical))
    doubled = np.exp(2j * _radians(own.s_turn_deg))  # an s-direction is the same after half a turn
    turn_rad = 0.5 * np.arctan2(blocks.mean(doubled.imag), blocks.mean(doubled.real))
    polar_rad = np.arctan2(np.hypot(east, north), up)
    phi_rad = np.arctan2(north, east)
    incidence_rad = np.full(shape, abs(np.radians(maps.incidence_deg)))
    return [np.nan_to_num(angle) for angle in (incidence_rad, polar_rad, phi_rad, turn_rad)]


def _radians(angle_deg: Map) -> FloatArray:
    return np.radians(np.asarray(angle_deg, np.float64))


def _frame_turn(turn_rad: FloatArray) -> FloatArray:
    """What makes Stokes parameters of a frame those of one turned counterclockwise against it, (..., 3, 3)."""
    matrix = np.zeros((*turn_rad.shape, 3, 3))
    cosine, sine = np.cos(2.0 * turn_rad), np.sin(2.0 * turn_rad)
    matrix[..., 0, 0] = 1.0
    matrix[..., 1, 1] = matrix[..., 2, 2] = cosine
    matrix[..., 1, 2], matrix[..., 2, 1] = sine, -sine
    return matrix


def _is_possible(covariance: FloatArray) -> NDArray[np.bool_]:
    """Which covariances (..., 3, 3) are positive definite, to what the maps' rounding leaves of them."""
    known = np.asarray(np.isfinite(covariance).all(axis=(-2, -1)))
    scale = np.sqrt(np.abs(np.einsum("...ii->...i", covariance)))
    scaled = covariance / np.maximum(scale[..., :, None] * scale[..., None, :], np.finfo(np.float64).tiny)
    least = np.linalg.eigvalsh(np.where(known[..., None, None], scaled, np.eye(3)))[..., 0]
    positive = (np.einsum("...ii->...i", covariance) > 0.0).all(axis=-1)
    possible: NDArray[np.bool_] = known & positive & (least > 1e-6)
    return possible


def _needed() -> list[str]:
    return [*_LINEAR, *(f"{name}_variance" for name in _LINEAR), *(f"S{a}_S{b}_covariance" for a, b in _PAIRS)]
