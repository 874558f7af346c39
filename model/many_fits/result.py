"""What a fit of many pixels found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from model.geometry import FloatArray


class Status(IntEnum):
    """What became of a pixel; all but the first have NaN for a result."""

    FITTED = 0
    TOO_FEW = 1
    """Fewer values were measured than there are parameters."""
    ONE_VALUE = 2
    """All directions hold the same values: the pixel is dead, stuck, saturated or dark."""
    NOT_SETTLED = 3
    """Least squares did not end, because the values hardly tell some parameters apart."""
    UNDETERMINED = 4
    """There are changes of parameters that leave every fitted value the same."""
    UNPOLARIZED = 5
    """No direction shows any polarization, not even noise, from which n or k could be found."""


@dataclass(frozen=True, eq=False)
class ManyFits:
    """The best surface of a family for each of B pixels.

    Attributes
    ----------
    names : tuple of str
        The P free parameters.
    parameters : ndarray
        Shape (B, P).
    stderr : ndarray
        Shape (B, P); NaN for parameters at a bound, and for those that the data know less of than their bounds, of
        which almost any value would do as well. They follow from the data's errors, and are not rescaled by
        chi_square; where errors are not known, they follow from the scatter about the fit.
    at_bound : ndarray of bool
        Shape (B, P): parameters that would go beyond their bound if they could.
    chi_square : ndarray
        Shape (B,): sum of the squared residuals, in units of their errors where these are known.
    degrees_of_freedom : ndarray of int
        Shape (B,): values fitted, and priors, less parameters with a standard error.
    status : ndarray of int
        Shape (B,), of `Status`. Of what was not fitted all of the above is NaN, false or 0.
    """

    names: tuple[str, ...]
    parameters: FloatArray
    stderr: FloatArray
    at_bound: NDArray[np.bool_]
    chi_square: FloatArray
    degrees_of_freedom: NDArray[np.int64]
    status: NDArray[np.int64]

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Which pixels (B,) have a result."""
        settled: NDArray[np.bool_] = self.status == Status.FITTED
        return settled

    @classmethod
    def none_yet(cls, names: tuple[str, ...], count: int) -> ManyFits:
        """The result of so many pixels before any was fitted."""
        return cls(
            names,
            parameters=np.full((count, len(names)), np.nan),
            stderr=np.full((count, len(names)), np.nan),
            at_bound=np.zeros((count, len(names)), bool),
            chi_square=np.full(count, np.nan),
            degrees_of_freedom=np.zeros(count, np.int64),
            status=np.full(count, Status.FITTED, np.int64),
        )

    @classmethod
    def joined(cls, parts: Sequence[ManyFits]) -> ManyFits:
        """The results of parts of an image, as one."""
        first, *_ = parts
        arrays = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(cls)
            if field.name != "names"
        }
        return cls(first.names, **arrays)
