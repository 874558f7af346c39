"""The same Stokes parameters by numpy, OpenCV and polanalyser, each used as it is fastest."""

from __future__ import annotations

import cv2
import numpy as np
import polanalyser
from images_case import ANGLES_DEG, INVERSE, NOISE, PIXELS
from numpy.typing import NDArray

Floats = NDArray[np.float32]

_BLOCK = 1 << 15
"""Pixels that stay in a core's own cache, as numbers of 32 bits, with what becomes of them."""

_INVERSE = INVERSE.astype(np.float32)


def numpy_whole(stack: NDArray[np.uint16]) -> Floats:
    """The inverse times all frames as one matrix: (3, pixels)."""
    return np.matmul(_INVERSE, stack.reshape(len(stack), -1))


def numpy_blocks(stack: NDArray[np.uint16], out: Floats) -> Floats:
    """The same block by block into memory that is there, (3, pixels)."""
    pixels = stack.reshape(len(stack), -1)
    block = np.empty((len(stack), _BLOCK), np.float32)
    for start in range(0, PIXELS, _BLOCK):
        part = pixels[:, start : start + _BLOCK]
        light = block[:, : part.shape[1]]
        light[:] = part
        np.matmul(_INVERSE, light, out=out[:, start : start + _BLOCK])
    return out


def numpy_blocks_fused(stack: NDArray[np.uint16], out: Floats) -> Floats:
    """With variances, DoLP and AoLP: (8, pixels)."""
    pixels = stack.reshape(len(stack), -1)
    block = np.empty((len(stack), _BLOCK), np.float32)
    squares, gain, floor = _INVERSE**2, np.float32(1.0 / NOISE.electrons_per_count), np.float32(NOISE.read_counts**2)
    for start in range(0, PIXELS, _BLOCK):
        part, to = pixels[:, start : start + _BLOCK], out[:, start : start + _BLOCK]
        light = block[:, : part.shape[1]]
        light[:] = part
        np.matmul(_INVERSE, light, out=to[:3])
        light *= gain
        light += floor
        np.matmul(squares, light, out=to[3:6])
        np.hypot(to[1], to[2], out=to[6])
        to[6] /= to[0]
        np.arctan2(to[2], to[1], out=to[7])
        to[7] *= np.float32(0.5)
    return out


def opencv(stack: NDArray[np.uint16], out: Floats) -> Floats:
    """`cv2.transform`, which wants a pixel's values side by side, and floats since S1 and S2 may be negative."""
    beside = cv2.merge([image.astype(np.float32) for image in stack])
    return cv2.transform(beside, _INVERSE, dst=out)


def polanalyser_stokes(stack: NDArray[np.uint16]) -> NDArray[np.float64]:
    """(height, width, 3)."""
    return polanalyser.calcStokes(stack, np.radians(ANGLES_DEG))


def polanalyser_fused(stack: NDArray[np.uint16]) -> tuple[NDArray[np.float64], ...]:
    """With DoLP and AoLP; it has no variances."""
    stokes = polanalyser_stokes(stack)
    return stokes, polanalyser.cvtStokesToDoLP(stokes), polanalyser.cvtStokesToAoLP(stokes)
