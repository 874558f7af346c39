"""How well a robust fit knows its parameters, where some rows are not what their errors say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from model.fit.uncertainty import Uncertainty, uncertainty
from model.geometry import FloatArray

# Share of a row that the fit must have left it, to tell anything of its error.
_TELLS = 0.05
# Values a parameter, below which the scatter of rows tells nothing.
_FEWEST = 2


def robust_uncertainty(
    jacobian: FloatArray, residuals: FloatArray, shape: tuple[int, ...], tolerated: float, names: Sequence[str]
) -> Uncertainty:
    """Uncertainties of parameters whose rows count by Huber's loss, from how the rows' gradients scatter.

    The errors of the data say nothing of how outliers scatter: where one row in seven is one, the inverse of the normal
    matrix makes standard errors up to a third too small.

    Parameters
    ----------
    jacobian, residuals : ndarray
        Shapes (P, R) and (R' <= R,), of a robust `Difference`: rows of data, and behind them what is known beforehand.
    shape : tuple of int
        (M, N): how many values a row has, and how many rows there are.
    tolerated : float
        Length of a row's whitened difference beyond which it counts by that length.
    names : sequence of str
        The parameters.

    Raises
    ------
    FitError
        If the data do not determine all of the parameters.
    """
    width, rows = shape
    by_row, known = jacobian[:, : width * rows].reshape(-1, width, rows), jacobian[:, width * rows :]
    left = residuals[: width * rows].reshape(width, rows)
    length = np.sqrt((left * left).sum(axis=0))
    # Beyond the limit the gradient's length no longer changes, only its direction.
    outwards = np.where(length > tolerated, left / np.where(length > 0.0, length, 1.0), 0.0)
    curved = by_row - outwards * np.einsum("mn,pmn->pn", outwards, by_row)[:, None]
    plain = uncertainty(np.concatenate([curved.reshape(len(jacobian), -1), known], axis=1), names)
    if width * rows < _FEWEST * len(names):
        return plain
    scores = np.einsum("mn,pmn->pn", _without_itself(left, curved, plain.covariance), by_row)
    return plain.scattering(np.concatenate([scores, known], axis=1))


def _without_itself(left: FloatArray, curved: FloatArray, covariance: FloatArray) -> FloatArray:
    """How far each row (M, N) would be off a fit without it (MacKinnon and White 1985, HC3).

    A row that alone determines something is fitted whatever its error: there the error of the data counts.
    """
    leverage = np.einsum("pmn,pkn->nmk", curved, np.tensordot(covariance, curved, 1))
    shares, axes = np.linalg.eigh(np.eye(len(left)) - leverage)
    along = np.einsum("nmk,mn->nk", axes, left)
    alone = np.where(shares > _TELLS, along / np.where(shares > _TELLS, shares, 1.0), 1.0)
    off: FloatArray = np.einsum("nmk,nk->mn", axes, alone)
    return off
