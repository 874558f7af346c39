"""The degree of linear polarization under unpolarized light that data hold, whatever they are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.fit.dataset import Dataset
from model.fit.observable import Dolp, Elements, Ratios
from model.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class MeasuredDolp:
    """Degrees of linear polarization and their standard errors, shape (N,); NaN where S0 is not above 0.

    `stderr` is None if nobody knows the errors of the data.
    """

    values: FloatArray
    stderr: FloatArray | None


def measured_dolp(data: Dataset) -> MeasuredDolp | None:
    """The DoLP √(S1² + S2²)/S0 of data, with errors to first order; None if they do not hold it.

    Parameters
    ----------
    data : Dataset
        DoLP, or S0, S1 and S2 or the first column of a Mueller matrix, or ratios to its first element.
    """
    measured, covariance = data.observable, data.covariance
    if isinstance(measured, Dolp):
        return MeasuredDolp(data.values[:, 0], None if covariance is None else np.sqrt(covariance[:, 0, 0]))
    if not isinstance(measured, Elements | Ratios):
        return None
    row = measured.elements // 4
    needed = (row, 2 * row) if isinstance(measured, Ratios) else (0, row, 2 * row)
    if not set(needed) <= set(measured.picked):
        return None
    columns = [measured.picked.index(element) for element in needed]
    *rest, s1, s2 = data.values[:, columns].T
    s0 = np.where(rest[0] > 0.0, rest[0], np.nan) if rest else np.ones(len(data))
    dolp = np.hypot(s1, s2) / s0
    if covariance is None:
        return MeasuredDolp(dolp, None)
    azimuth = np.arctan2(s2, s1)
    slopes = np.array([-dolp, np.cos(azimuth), np.sin(azimuth)][-len(columns) :]) / s0
    own = covariance[:, columns][:, :, columns]
    return MeasuredDolp(dolp, np.sqrt(np.einsum("in,nij,jn->n", slopes, own, slopes)))
