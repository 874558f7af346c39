"""The coherency matrix of a Mueller matrix: whether it is physical, and of how many Jones matrices it is a sum.

Source: Cloude, Optik 75, 26 (1986), here with trace M00 and in the basis of `mueller.PAULI`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.geometry import FloatArray
from model.mueller import PAULI, ComplexArray

# M_mn = Σ C_ab _MUELLER[m, n, a, b], by M_mn = ½ tr(PAULI_m J PAULI_n J†) of J = Σ c_a PAULI_a and C = c c†.
_MUELLER: ComplexArray = np.einsum("mij,ajk,nkl,bli->mnab", PAULI, PAULI, PAULI, PAULI) / 2.0


def coherency(mueller: ArrayLike) -> ComplexArray:
    """Hermitian coherency matrices (..., 4, 4) of Mueller matrices (..., 4, 4).

    That of a Jones matrix Σ c_a PAULI_a is c c†; that of a sum of Mueller matrices is the sum of theirs.
    """
    matrix = np.asarray(mueller, dtype=np.float64)
    hermitian: ComplexArray = np.einsum("mnab,...mn->...ab", _MUELLER.conj(), matrix) / 4.0
    return hermitian


def coherency_eigenvalues(mueller: ArrayLike) -> FloatArray:
    """Eigenvalues (..., 4) of the coherency matrix, largest first; their sum is M00.

    All but one are 0 for a Jones matrix, all are M00/4 for the ideal depolarizer.
    """
    return np.asarray(np.linalg.eigvalsh(coherency(mueller))[..., ::-1], dtype=np.float64)


def is_physical(mueller: ArrayLike, tolerance: float = 1e-12) -> NDArray[np.bool_]:
    """Whether Mueller matrices (..., 4, 4) are sums of Jones matrices.

    Parameters
    ----------
    mueller : array_like
        Mueller matrices.
    tolerance : float
        How far below 0 an eigenvalue of the coherency matrix may be, relative to M00; for rounding or noise.
    """
    lowest = coherency_eigenvalues(mueller)[..., -1]
    physical: NDArray[np.bool_] = lowest >= -tolerance * np.asarray(mueller, dtype=np.float64)[..., 0, 0]
    return physical
