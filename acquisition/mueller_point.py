"""What a direction's solution is: its Stokes parameters, or its Mueller matrix; and whether that can be one at all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from acquisition.polarization import stokes_point
from acquisition.readings import MuellerPoint, Reading, StokesPoint
from model.coherency import coherency

_IMPLAUSIBLE = 1e-3
"""Probability with which noise alone may make a scan's matrices look unphysical: three standard deviations, about."""


def reduced_point(
    reading: Reading, elements: NDArray[np.float64], covariance: NDArray[np.float64], shape: tuple[int, int]
) -> StokesPoint:
    """The Stokes point of a direction, or its Mueller point where the light on the sample was polarized.

    Parameters
    ----------
    reading : Reading
        Any of the direction's readings, for its angles.
    elements, covariance : ndarray
        Elements of the Mueller matrix, row by row, (E,) in 1/sr, and (E, E) in 1/sr².
    shape : tuple of int
        Of how many rows and columns they are.
    """
    rows, columns = shape
    first = np.arange(rows) * columns
    point = stokes_point(reading, elements[first], covariance[np.ix_(first, first)])
    if columns == 1:
        return point
    return MuellerPoint(**vars(point), mueller=elements.reshape(shape), mueller_covariance=covariance)


def lowest_eigenvalue(point: MuellerPoint) -> tuple[float, float]:
    """The smallest eigenvalue of a whole matrix's coherency matrix, in 1/sr, and its standard error to first order.

    It is not below 0 for anything that reflects light (Cloude 1986). Noise pushes it below where it should be 0.
    """
    values, vectors = np.linalg.eigh(coherency(point.mueller))
    lowest = vectors[:, 0]
    units = coherency(np.eye(16).reshape(16, 4, 4))
    slopes = np.einsum("a,nab,b->n", lowest.conj(), units, lowest).real
    return float(values[0]), math.sqrt(slopes @ point.mueller_covariance @ slopes)


def unphysical(points: Sequence[StokesPoint]) -> str:
    """Which matrices nothing can have, noise considered; empty if there is none, or not all elements were measured.

    v† C v, with v the eigenvector of the smallest eigenvalue, is not below 0 for any physical matrix. So none is closer
    to the measured one, in standard errors, than that eigenvalue is to 0; and of the true one the square of that
    distance is distributed as chi-square with 16 degrees of freedom.
    """
    whole = [point for point in points if isinstance(point, MuellerPoint) and point.mueller.shape == (4, 4)]
    if not whole:
        return ""
    allowed = math.sqrt(chdtri(16, _IMPLAUSIBLE / len(whole)))
    found = [(point, *lowest_eigenvalue(point)) for point in whole]
    bad = [(point, value, stderr) for point, value, stderr in found if value < -allowed * stderr]
    if not bad:
        return ""
    point, value, stderr = min(bad, key=lambda one: one[1] / one[2])
    return (
        f"The Mueller matrix is not physical in {len(bad)} of {len(whole)} directions: at point {point.point} an "
        f"eigenvalue of its coherency matrix is {value:.3g} ± {stderr:.2g} 1/sr, and noise lets it fall to "
        f"{-allowed * stderr:.2g} at most. Look at the angles and retardances in the rig file, and whether the lamp "
        "is polarized"
    )
