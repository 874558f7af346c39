"""Some pixels of an image, as least squares takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.fit.problem import Places
from model.geometry import FloatArray


class Block(NamedTuple):
    """Some pixels, laid out as `Problem` takes them: what is not measured has the value 0 and no weight.

    Attributes
    ----------
    directions : tuple of ndarray
        Incidence, exit and azimuth in rad, each (N,), or (b, N) if every pixel has its own.
    values : ndarray
        Shape (b, M, N).
    whitener : ndarray
        Shape (b, M, M, N), or (1, M, M, N) if all have the same errors and miss nothing.
    measured : ndarray of bool
        Shape (b, N).
    """

    directions: tuple[FloatArray, FloatArray, FloatArray]
    values: FloatArray
    whitener: FloatArray
    measured: NDArray[np.bool_]

    def some(self, which: Places) -> Block:
        """Some of these pixels."""
        incidence, exit_, azimuth = (angle if angle.ndim == 1 else angle[which] for angle in self.directions)
        whitener = self.whitener if len(self.whitener) == 1 else self.whitener[which]
        return Block((incidence, exit_, azimuth), self.values[which], whitener, self.measured[which])

    def away_from_the_mirror(self, angle_rad: float) -> Block:
        """The same, where directions within an angle of the mirror direction have no weight, and are moved beside it.

        There a cone sees other things than its axis.
        """
        incidence, exit_, azimuth = self.directions
        close = (np.cos(azimuth) < 0.0) & (np.abs(exit_ - incidence) <= angle_rad)
        beside = np.where(incidence > angle_rad, incidence - angle_rad, incidence + angle_rad)
        whitener = np.where(np.atleast_2d(close)[:, None, None, :], 0.0, self.whitener)
        directions = (incidence, np.where(close, beside, exit_), azimuth)
        return Block(directions, self.values, whitener, self.measured & ~close)
