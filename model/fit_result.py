"""What a fit found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from model.acceptance import Acceptance
from model.geometry import FloatArray
from model.surface import Surface


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    `stderr` is None, and `at_bound` true, for a parameter that ended at one of its bounds (a weight: at 0): there the
    data determine on which side of the bound it wants to be, and not how well it is known.
    """

    value: float
    stderr: float | None
    at_bound: bool


@dataclass(frozen=True, eq=False)
class FitResult:
    """The best surface of a family, and how well the data determine it.

    Attributes
    ----------
    parameters : dict of str to Estimate
        Every free parameter: sigma, n, k as far as free, then the lobes' weights.
    chi_square : float
        Sum of the squared whitened residuals.
    degrees_of_freedom : int
        Values fitted less parameters with a standard error; chi_square is about this when model and errors are right.
    names : tuple of str
        The parameters with a standard error, in the order of `correlation`.
    correlation : ndarray
        Shape (len(names), len(names)).
    stokes : ndarray
        Fitted S0, S1, S2, shape (N, 3), in 1/sr.
    surface : Surface
        The fitted surface.
    """

    parameters: dict[str, Estimate]
    chi_square: float
    degrees_of_freedom: int
    names: tuple[str, ...]
    correlation: FloatArray
    stokes: FloatArray
    surface: Surface | Acceptance

    @property
    def description(self) -> str:
        """What the surface consists of and leaves out."""
        return self.surface.describe()

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and text, ready for JSON."""
        return {
            "parameters": {
                name: {"value": estimate.value, "stderr": estimate.stderr, "at_bound": estimate.at_bound}
                for name, estimate in self.parameters.items()
            },
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.degrees_of_freedom,
            "names": list(self.names),
            "correlation": self.correlation.tolist(),
            "stokes": self.stokes.tolist(),
            "description": self.description,
        }
