"""Pixels that are not to be believed. They become NaN; nothing is put in their place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.dark_level import DarkLevel
from drivers.camera.picture_head import read_head
from drivers.camera.quiet_opencv import quiet_opencv
from goniometer.errors import ReductionError

_MOST_BAD = 0.5
_PNG = b"\x89PNG\r\n\x1a\n"
_SIGMAS_OF_MAD = 1.4826
"""A normal distribution's standard deviation over the median distance from its median."""


def hot_pixels(dark: Dark, *, sigmas: float = 10.0) -> NDArray[np.bool_]:
    """Which pixels count far more than others in the dark, in any of its levels, or are saturated there.

    Parameters
    ----------
    dark : Dark
        Without them, a hot pixel cannot be told from light.
    sigmas : float
        How far above the median, in robust standard deviations over the sensor, and at least in those of the noise.
    """
    is_hot = np.zeros(dark.shape, np.bool_)
    for level in dark.levels:
        is_hot |= ~(level.counts <= _limit(level, sigmas))
    return is_hot


def _limit(level: DarkLevel, sigmas: float) -> float:
    typical = float(np.nanmedian(level.counts))
    spread = _SIGMAS_OF_MAD * float(np.nanmedian(np.abs(level.counts - np.float32(typical))))
    return typical + sigmas * max(spread, math.sqrt(level.read_variance))


def masked_pixels(path: Path) -> NDArray[np.bool_]:
    """Which pixels a mask file marks: a PNG of one channel, 0 where a pixel is good.

    Raises
    ------
    ReductionError
        When the file is no such picture.
    OSError
        When it cannot be read.
    """
    import cv2

    quiet_opencv()
    content = path.read_bytes()
    is_png = content.startswith(_PNG) and _is_whole(content)
    mask = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if is_png else None
    if mask is None or mask.ndim != 2:
        raise ReductionError(
            f"{path} is no mask of bad pixels: it must be a PNG of one channel, black where a pixel is good. "
            "It was not used. Save it as a gray picture."
        )
    is_bad = np.asarray(mask != 0)
    if is_bad.mean() > _MOST_BAD:
        raise ReductionError(
            f"{path} marks {is_bad.mean():.1%} of the pixels as bad, where black is good. It was not used. If white "
            "was meant to be good, invert it."
        )
    return is_bad


def _is_whole(content: bytes) -> bool:
    """Whether a file is complete; the library would write a line of its own about it."""
    try:
        read_head(content)
    except ValueError:
        return False
    return True
