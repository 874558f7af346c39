"""How well data determine parameters: standard errors, correlations, and what the data can hardly tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.geometry import FloatArray

_SINGULAR = 1e-8
_PART = 0.1
_BLOCK = 512


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What the Jacobian of whitened residuals says of parameters that are at no bound.

    Attributes
    ----------
    stderr : ndarray
        Shape (P,).
    correlation : ndarray
        Shape (P, P).
    condition : float
        Of the Jacobian with columns of unit length, at least 1: by how much less the data say of the combination that
        they know least about than of the one that they know best.
    weakest : ndarray
        Shape (P,): the change of parameters, one standard deviation long, that the data notice least.
    """

    stderr: FloatArray
    correlation: FloatArray
    condition: float
    weakest: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Shape (P, P)."""
        return self.correlation * np.outer(self.stderr, self.stderr)

    def scaled(self, factor: float) -> Uncertainty:
        """The same where the errors of the data are larger by a factor."""
        return Uncertainty(self.stderr * factor, self.correlation, self.condition, self.weakest * factor)

    def of(self, chosen: NDArray[np.bool_]) -> Uncertainty:
        """The same of some parameters, whatever the others are."""
        return Uncertainty(
            self.stderr[chosen], self.correlation[np.ix_(chosen, chosen)], self.condition, self.weakest[chosen]
        )

    def scattering(self, scores: FloatArray) -> Uncertainty:
        """The same where gradients scatter as these do, and not as independent errors of variance 1 make them scatter.

        The sandwich estimator A⁻¹BA⁻¹ of Huber (1967), with A of this and B the sum of the scores' squares.

        Parameters
        ----------
        scores : ndarray
            Shape (P, rows): the gradient that each row adds.
        """
        root = self.covariance @ scores
        covariance = root @ root.T
        stderr = np.sqrt(np.diag(covariance))
        along = float(np.linalg.norm(self.weakest @ scores))
        return Uncertainty(stderr, covariance / np.outer(stderr, stderr), self.condition, self.weakest * along)


def uncertainty(jacobian: FloatArray, names: Sequence[str]) -> Uncertainty:
    """Uncertainties of parameters from the Jacobian of whitened residuals.

    Parameters
    ----------
    jacobian : ndarray
        Shape (parameters, values).
    names : sequence of str
        The parameters, for the message when they are not determined.

    Raises
    ------
    FitError
        If the data do not determine all of the parameters.
    """
    if not names:
        return Uncertainty(np.empty(0), np.empty((0, 0)), 1.0, np.empty(0))
    lengths = np.linalg.norm(jacobian, axis=1)
    # Unit columns: whether parameters can be told apart must not depend on the units they are counted in.
    unit = jacobian.T / np.where(lengths > 0.0, lengths, 1.0)
    _, singular, directions = np.linalg.svd(_short(unit), full_matrices=False)
    blind = singular <= _SINGULAR * singular[0]
    if blind.any() or len(singular) < len(names):
        share = np.linalg.norm(directions[blind], axis=0)
        mixed = [name for name, part in zip(names, share, strict=True) if part > _PART]
        raise FitError(
            f"The data do not determine {' and '.join(mixed or names)}: there are changes of these that leave every "
            f"fitted value the same. No result is given. Measure more directions, or fix one of them."
        )
    covariance = (directions.T / singular**2) @ directions
    scale = np.sqrt(np.diag(covariance))
    return Uncertainty(
        stderr=scale / lengths,
        correlation=covariance / np.outer(scale, scale),
        condition=float(singular[0] / singular[-1]),
        weakest=directions[-1] / singular[-1] / lengths,
    )


def _short(tall: FloatArray) -> FloatArray:
    """A matrix of few rows with the same singular values and directions, by QR of blocks of rows, and of what is left.

    Blocks are small enough for one thread: a library that shares a tall matrix out among threads waits for all of them,
    which beside a running scan takes many times as long.
    """
    while len(tall) > 2 * _BLOCK:
        blocks = -(-len(tall) // _BLOCK)
        whole = np.zeros((blocks * _BLOCK, tall.shape[1]))
        whole[: len(tall)] = tall
        triangles = np.asarray(np.linalg.qr(whole.reshape(blocks, _BLOCK, -1), mode="r"))
        tall = triangles.reshape(-1, tall.shape[1])
    return tall
