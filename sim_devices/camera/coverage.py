"""Which inks of a plate each pixel of a view sees, and how much of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_devices.camera.layers import NOTHING, Boxes, FloatArray, Inks
from sim_devices.camera.layout import Layout
from sim_devices.camera.view import View

_POINTS = 233
_STEP = 144
"""A Fibonacci lattice: its points' columns are evenly spaced, and so are their rows."""
RIGHT = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
DOWN = (np.arange(_POINTS) * _STEP % _POINTS + 0.5) / _POINTS - 0.5

_AT_ONCE = 8_000


@dataclass(frozen=True, eq=False)
class Coverage:
    """What pixels see, counted along the rows of the picture.

    A pixel that no edge crosses is found to be so by the rectangle that holds all of it; the others are sampled at 233
    points, so that the place of an edge along rows or columns is right to 0.002 of a pixel.

    Attributes
    ----------
    ink : ndarray of int16
        The ink of every pixel that sees only one, (pixels,); NOTHING of the others.
    mixed : ndarray of int
        Which pixels see several, (M,).
    shares : ndarray
        Which part of these each ink has, (inks, M).
    """

    ink: Inks
    mixed: NDArray[np.intp]
    shares: FloatArray

    def of(self, ink: int) -> tuple[NDArray[np.intp], FloatArray]:
        """The pixels that see an ink, and how much of it."""
        whole, parts = np.flatnonzero(self.ink == ink), np.flatnonzero(self.shares[ink])
        return np.append(whole, self.mixed[parts]), np.append(np.ones(len(whole)), self.shares[ink, parts])


def coverage(layout: Layout, view: View, boxes: Boxes, exit_deg: float, azimuth_deg: float) -> Coverage:
    """What the pixels of a view see of a plate, from `View.boxes`."""
    overs = [layer.over(boxes) for layer in layout.layers]
    ink, mixed = np.zeros(len(boxes.left), np.int16), np.zeros(len(boxes.left), np.bool_)
    for layer, (touched, filled) in zip(layout.layers, overs, strict=True):
        which = np.flatnonzero(filled)
        found = layer.ink_at(*boxes.some(which).middles())
        which, found = which[found != NOTHING], found[found != NOTHING]
        mixed |= touched & ~filled
        ink[which], mixed[which] = found, False
    several = np.flatnonzero(mixed)
    ink[several] = NOTHING
    shares = np.empty((len(layout.inks), len(several)))
    for start in range(0, len(several), _AT_ONCE):
        some = several[start : start + _AT_ONCE]
        x, y = view.on_plate(*view.within(some, RIGHT, DOWN), exit_deg, azimuth_deg)
        sampled = np.zeros(x.shape, np.int16)
        for layer, (touched, _) in zip(layout.layers, overs, strict=True):
            rows = np.flatnonzero(touched[some])
            found = layer.ink_at(x[rows], y[rows])
            sampled[rows] = np.where(found == NOTHING, sampled[rows], found)
        for number in range(len(layout.inks)):
            shares[number, start : start + len(some)] = (sampled == number).mean(axis=1)
    return Coverage(ink, several, shares)
