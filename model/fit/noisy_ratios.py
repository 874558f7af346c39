"""Which rows are too noisy for ratios of light: their errors are then no longer Gaussian, and their means are off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.fit.dataset import Dataset
from model.fit.observable import Dolp

_FEWEST = 5.0
"""Standard errors below which the mean of a ratio is off by a tenth of its own error, and that in all rows alike."""


def noisy_ratios(data: Dataset, compared: Dataset) -> NDArray[np.bool_]:
    """Rows (N,) in which what is divided by, or the degree of linear polarization, is less than a few standard errors.

    A DoLP is never negative, so that noise alone makes it rise (Rice 1945); 1/S0 is above 1 over the mean of S0.

    Parameters
    ----------
    data : Dataset
        As measured.
    compared : Dataset
        The same in the form in which it is fitted.
    """
    noisy = np.zeros(len(data), bool)
    if data.covariance is None or compared.observable.has_scale:
        return noisy
    if data.observable.has_scale:
        noisy |= data.values[:, 0] < _FEWEST * np.sqrt(data.covariance[:, 0, 0])
    if isinstance(compared.observable, Dolp):
        known = compared if compared.covariance is not None else data.compared_by("dolp")
        assert known.covariance is not None, "made of data that have one"
        noisy |= known.values[:, 0] < _FEWEST * np.sqrt(known.covariance[:, 0, 0])
    return noisy
