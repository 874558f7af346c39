"""Models compared by how well they describe the same data: Akaike's criterion, held-out prediction, the DoLP's rms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from goniometer.errors import FitError
from model.comparison.candidates import Candidate
from model.comparison.held_out import ROUNDING, HeldOut, held_out
from model.comparison.measured_dolp import MeasuredDolp, measured_dolp
from model.fit.dataset import Dataset, Objective
from model.fit.family import SurfaceFamily
from model.fit.fit import fit
from model.fit.quantities import NOMINAL, is_weight
from model.fit.result import FitResult


@dataclass(frozen=True, eq=False)
class Compared:
    """One model beside the data.

    Attributes
    ----------
    candidate : Candidate
        The model, with what the data tell nothing of held.
    fit : FitResult or None
        Its best surface; None if it has none.
    aic : float or None
        Akaike's criterion of the fit: differences between models count, and the lowest is the best.
    held_out : HeldOut or None
        How well the model predicts what it was not fitted to; None if that could not be found out.
    dolp_rms : float or None
        Root mean square deviation of the degree of linear polarization, eq. (14) of Hao et al. 2023; None if the data
        do not hold it.
    refusals : tuple of str
        Why there is no fit or no prediction.
    """

    candidate: Candidate
    fit: FitResult | None = None
    aic: float | None = None
    held_out: HeldOut | None = None
    dolp_rms: float | None = None
    refusals: tuple[str, ...] = ()


def compare(data: Dataset, candidates: Sequence[Candidate], *, objective: Objective = "stokes") -> list[Compared]:
    """Fit models to data and rank them by Akaike's criterion, the best first; those that cannot be fitted come last.

    Parameters
    ----------
    data : Dataset
        What was measured.
    candidates : sequence of Candidate
        The models, such as those of `candidates`.
    objective : {"stokes", "normalised", "dolp", "rms"}
        What is compared, as for `fit`; "rms" is the paper's way, eq. (14).

    Raises
    ------
    FitError
        If the data cannot be brought into the form that the objective compares.
    """
    values = data.compared_by(objective)
    dolp = measured_dolp(data)
    ranked = [_compared(values, dolp, candidate) for candidate in candidates]
    return sorted(ranked, key=lambda one: math.inf if one.aic is None else one.aic)


def akaike(data: Dataset, found: FitResult) -> float:
    """Akaike's criterion of a fit, -2 ln L + 2 P, but for a constant that is the same for all models of the same data.

    Where errors are known that is chi-square + 2 P, without bias in a linear problem. Where they are not, their size is
    one more parameter, and the criterion is that of Hurvich and Tsai 1989 for few values, which is infinite if there
    are hardly more values than parameters.
    """
    parameters = len(found.parameters)
    if data.covariance is not None:
        return found.chi_square + 2.0 * parameters
    count, parameters = data.values.size, parameters + 1
    if count <= parameters + 1:
        return math.inf
    mean_square = max(found.rms**2, ROUNDING * float(np.mean(data.values**2)))
    correction = 2.0 * parameters * (parameters + 1) / (count - parameters - 1)
    return count * math.log(mean_square) + 2.0 * parameters + correction


def _compared(values: Dataset, dolp: MeasuredDolp | None, candidate: Candidate) -> Compared:
    if candidate.refusal:
        return Compared(candidate, refusals=(candidate.refusal,))
    candidate = replace(candidate, family=_told(candidate.family, values))
    try:
        found = fit(values, candidate.family)
    except FitError as error:
        return Compared(candidate, refusals=(str(error),))
    compared = Compared(candidate, found, akaike(values, found), dolp_rms=_dolp_rms(dolp, found))
    try:
        return replace(compared, held_out=held_out(values, candidate.family))
    except FitError as error:
        return replace(compared, refusals=(str(error),))


def _told(family: SurfaceFamily, values: Dataset) -> SurfaceFamily:
    """Without what ratios of light do not tell: how large weights and gain are, how rough facets that stand alone."""
    if values.observable.has_scale:
        return family
    family = replace(family, prior={name: known for name, known in family.prior.items() if not is_weight(name)})
    if "gain" in family.free:
        family = family.holding("gain", NOMINAL["gain"])
    if len(family.lobes) == 1 and "sigma" in family.free:
        # With the roughest facets no direction is so dark that the ratio would be lost.
        family = family.holding("sigma", family.free["sigma"][1])
    return family


def _dolp_rms(dolp: MeasuredDolp | None, found: FitResult) -> float | None:
    if dolp is None or np.isnan(dolp.values).all():
        return None
    s0, s1, s2 = found.stokes.T
    return float(np.sqrt(np.nanmean((np.hypot(s1, s2) / s0 - dolp.values) ** 2)))
