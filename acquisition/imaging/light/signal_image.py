"""What reached every pixel behind one analyzer state, freed of what the sensor adds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class SignalImage:
    """Light and its uncertainty.

    Parameters
    ----------
    signal : ndarray
        (height, width) of float32: counts per second of exposure at gain 0 dB, dark subtracted, linear in the light,
        and alike for all pixels. NaN where nothing is known.
    variance : ndarray
        (height, width) of float32: its variance; NaN in the same places.
    notes : tuple of str
        What a person should know before believing in it.
    """

    signal: NDArray[np.float32]
    variance: NDArray[np.float32]
    notes: tuple[str, ...] = ()
