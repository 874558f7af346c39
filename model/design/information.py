"""What readings would tell of parameters, before they are taken: Fisher's information."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from model.fit.family import SurfaceFamily
from model.fit.observable import Elements, Observable
from model.fit.problem import Problem
from model.geometry import FloatArray

# Of information in units of each parameter's own: where readings tell less of a combination, it is rounding.
_NOTHING = 1e-13
# A parameter's part in a combination of which nothing is told, above what rounding mixes in.
_PART = 1e-5


def information(
    family: SurfaceFamily,
    directions: tuple[FloatArray, FloatArray, FloatArray],
    covariance: FloatArray,
    values: Mapping[str, float],
    observable: Observable = Elements(),  # noqa: B008 (frozen)
) -> FloatArray:
    """Fisher's information on the free parameters, of each direction by itself.

    That of a scan is the sum over its directions, and with a prior also of 1/variance; its inverse is the covariance
    that a fit will report.

    Parameters
    ----------
    family : SurfaceFamily
        What is free, in the order of `family.names`.
    directions : tuple of ndarray
        Incidence, exit and azimuth, shape (N,), in rad.
    covariance : ndarray
        Shape (N, M, M), of the values that will be measured in each direction.
    values : mapping of str to float
        Where in the parameters' space; every free parameter.
    observable : Observable
        What will be measured.

    Returns
    -------
    ndarray
        Shape (N, P, P).
    """
    count, width = covariance.shape[:2]
    whitener = np.moveaxis(np.linalg.inv(np.linalg.cholesky(covariance)), 0, -1)[None]
    problem = Problem(family, observable, directions, np.zeros((1, width, count)), whitener)
    x = np.array([[values[name] for name in family.names]])
    jacobian = problem.difference(x, np.zeros(1, np.int64)).jacobian[0][:, : width * count]
    rows = jacobian.reshape(len(family.names), width, count)
    told: FloatArray = np.einsum("pmn,qmn->npq", rows, rows)
    return told


def prior_information(family: SurfaceFamily) -> FloatArray:
    """What the family's priors tell, shape (P, P)."""
    told = np.zeros((len(family.names), len(family.names)))
    for name, (_, stddev) in family.prior.items():
        place = family.names.index(name)
        told[place, place] = 1.0 / stddev**2
    return told


def standard_errors(told: FloatArray) -> FloatArray:
    """The least standard errors (P,) that information (P, P) allows, those of an efficient fit.

    A parameter is infinitely uncertain if it can change together with others, or alone, and leave every reading the
    same.
    """
    lengths = np.sqrt(np.diag(told))
    # In units of what each parameter would be known to alone, so that no unit decides what is singular.
    unit = np.where(lengths > 0.0, lengths, 1.0)
    strengths, combinations = np.linalg.eigh(told / np.outer(unit, unit))
    blind = strengths <= _NOTHING * strengths[-1]
    share = np.linalg.norm(combinations[:, blind], axis=1)
    variance = (combinations[:, ~blind] ** 2 / strengths[~blind]).sum(axis=1)
    errors: FloatArray = np.where(share > _PART, np.inf, np.sqrt(variance) / unit)
    return errors
