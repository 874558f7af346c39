"""What a fit found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from model.acceptance import Acceptance
from model.geometry import FloatArray
from model.surface import Surface


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter.

    `stderr` is None for a parameter that ended at one of its bounds (a weight: at 0), where `at_bound` is true: there
    the data determine on which side of the bound it wants to be, and not how well it is known. Where `at_bound` is
    false, it is not determined: any value between its bounds is possible, or nothing tells the errors of the data.
    """

    value: float
    stderr: float | None
    at_bound: bool


@dataclass(frozen=True)
class Alternative:
    """Another optimum, hardly worse than the best: the parameters, and by how much its chi-square is higher."""

    parameters: dict[str, float]
    excess: float


@dataclass(frozen=True)
class Outlier:
    """A row of the data that lies too far from the fit for its errors: how many standard deviations, all in all."""

    row: int
    deviations: float


@dataclass(frozen=True)
class Weakness:
    """The change of parameters that the data notice least: together by these amounts, for one standard deviation.

    `best_exit_rad` is the exit angle, positive on the mirror side, at which a further reading would tell most.
    """

    changes: dict[str, float]
    best_exit_rad: float


@dataclass(frozen=True, eq=False)
class FitResult:
    """The best surface of a family, and how well the data determine it.

    Attributes
    ----------
    parameters : dict of str to Estimate
        Every free parameter: those that shape the lobes, the lobes' weights, the instrument's.
    chi_square : float
        Sum of the squared whitened residuals; where the data have no errors of their own, as counted by their scatter.
    degrees_of_freedom : int
        Values fitted, and priors, less parameters that are not at a bound.
    p_value : float or None
        How often chance alone gives a chi-square as high; None where the data have no errors of their own.
    rms : float
        Root mean square of what the fit leaves, in units of the values, eq. (14) of Hao et al. 2023.
    names : tuple of str
        The parameters with a standard error, in the order of `correlation`.
    correlation : ndarray
        Shape (len(names), len(names)).
    condition : float
        Of the Jacobian with unit columns; what is above some 1e3 hangs by digits of the data that they may not have.
    weakness : Weakness or None
        What the data can hardly tell apart; None with fewer than two parameters, and of a fit that follows a scan.
    alternatives : tuple of Alternative
        Other optima with a chi-square less than 4 above the best.
    outliers : tuple of Outlier
        Rows that do not belong to the others, the worst first.
    biased : int
        Rows whose ratios are so noisy that they are biased; see `noisy_ratios`.
    held : dict of str to float
        Parameters that the fit had to hold because the data cannot tell them, such as the scale of ratios.
    columns : tuple of str
        What was compared, M values a direction.
    fitted : ndarray
        These values as the fit has them, shape (N, M).
    stokes : ndarray
        Fitted S0, S1, S2 under unpolarized light, shape (N, 3), in 1/sr.
    surface : Surface or Acceptance
        The fitted surface, as it is seen.
    """

    parameters: dict[str, Estimate]
    chi_square: float
    degrees_of_freedom: int
    names: tuple[str, ...]
    correlation: FloatArray
    columns: tuple[str, ...]
    fitted: FloatArray
    stokes: FloatArray
    surface: Surface | Acceptance
    p_value: float | None = None
    rms: float = np.nan
    condition: float = 1.0
    weakness: Weakness | None = None
    alternatives: tuple[Alternative, ...] = ()
    outliers: tuple[Outlier, ...] = ()
    biased: int = 0
    held: dict[str, float] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, float]:
        """The parameters' values alone."""
        return {name: estimate.value for name, estimate in self.parameters.items()}

    @property
    def covariance(self) -> FloatArray:
        """Covariance of `names`, shape (len(names), len(names))."""
        stderr = np.array([self.parameters[name].stderr for name in self.names], np.float64)
        return self.correlation * np.outer(stderr, stderr)

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
            "held": dict(self.held),
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.degrees_of_freedom,
            "p_value": self.p_value,
            "rms": self.rms,
            "names": list(self.names),
            "correlation": self.correlation.tolist(),
            "condition": self.condition,
            "alternatives": [
                {"parameters": dict(other.parameters), "excess": other.excess} for other in self.alternatives
            ],
            "biased": self.biased,
            "outliers": [{"row": outlier.row, "deviations": outlier.deviations} for outlier in self.outliers],
            "columns": list(self.columns),
            "fitted": self.fitted.tolist(),
            "stokes": self.stokes.tolist(),
            "description": self.description,
        }
