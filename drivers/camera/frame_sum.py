"""The mean of several 8-bit pictures, as counts of 16 bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BITS = 16
_SCALE = 257
"""65535 / 255: so that the converter's end of the pictures is that of their mean."""

_CONVERTER_END = 255


class FrameSum:
    """A sum of pictures, which needs no more memory for many than for one.

    Attributes
    ----------
    frames : int
        How many pictures it is the sum of.
    """

    def __init__(self) -> None:
        self.frames = 0
        self._sum: NDArray[np.uint32] | None = None
        self._highest: NDArray[np.uint8] | None = None

    def add(self, counts: NDArray[np.uint8]) -> None:
        """Add a picture, (height, width) of uint8; all must be of one size, and 2**32 / 255 of them are the most."""
        if self._sum is None or self._highest is None:
            self._sum, self._highest = counts.astype(np.uint32), counts.copy()
        else:
            np.add(self._sum, counts, out=self._sum)
            np.maximum(self._highest, counts, out=self._highest)
        self.frames += 1

    def mean_counts(self) -> NDArray[np.uint16]:
        """257 times the mean, rounded, so that 16 bits hold the digits that averaging has won.

        A pixel that was at the converter's end in any of the pictures is 65535, for its mean would be too low; all
        others are 254 * 257 = 65278 at most.

        Raises
        ------
        ValueError
            When there is no picture.
        """
        if self._sum is None or self._highest is None:
            raise ValueError("There is no mean of no pictures.")
        mean: NDArray[np.uint16] = np.rint(self._sum * (_SCALE / self.frames)).astype(np.uint16)
        mean[self._highest == _CONVERTER_END] = (1 << BITS) - 1
        return mean
