"""How well data determine parameters: standard errors and correlations from the Jacobian at the optimum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from goniometer.errors import FitError
from model.geometry import FloatArray
from model.varpro import Projection

# Central differences in the unit box leave relative errors of about 1e-7 in the Jacobian.
_STEP = 1e-5
_SINGULAR = 1e-8


def jacobian(projection: Projection, unit: FloatArray, weights: FloatArray) -> FloatArray:
    """Derivatives of the whitened model by the shape parameters, then by the weights; shape (3N, parameters)."""
    by_shape = []
    for axis, slope in enumerate(projection.slopes(unit)):
        # At a bound the difference is one-sided: no surface outside the bounds is asked for.
        below, above = unit.copy(), unit.copy()
        below[axis], above[axis] = max(unit[axis] - _STEP, 0.0), min(unit[axis] + _STEP, 1.0)
        rise = (projection.columns(above) - projection.columns(below)) @ weights
        by_shape.append(rise / ((above[axis] - below[axis]) * slope))
    return np.column_stack([*by_shape, projection.columns(unit)])


def standard_errors(jacobian: FloatArray, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Standard errors and correlations of parameters from the Jacobian of whitened residuals.

    Parameters
    ----------
    jacobian : ndarray
        Shape (values, parameters).
    names : sequence of str
        The parameters, for the message when they are not determined.

    Returns
    -------
    stderr, correlation : ndarray
        Shapes (parameters,) and (parameters, parameters).

    Raises
    ------
    FitError
        If the data do not determine all of the parameters.
    """
    if not names:
        return np.empty(0), np.empty((0, 0))
    lengths = np.linalg.norm(jacobian, axis=0)
    # Unit columns: whether parameters can be told apart must not depend on the units they are counted in.
    _, singular, directions = np.linalg.svd(jacobian / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    blind = singular <= _SINGULAR * singular[0]
    if blind.any():
        share = np.linalg.norm(directions[blind], axis=0)
        mixed = [name for name, part in zip(names, share, strict=True) if part > 0.1]
        raise FitError(
            f"The data do not determine {' and '.join(mixed)}: there are changes of these that leave every fitted "
            f"value the same. No result is given. Measure more directions, or fix one of them."
        )
    covariance = (directions.T / singular**2) @ directions
    scale = np.sqrt(np.diag(covariance))
    return scale / lengths, covariance / np.outer(scale, scale)
