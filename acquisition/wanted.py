"""Whether a fit is as certain as a recipe wants, and can be believed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from acquisition.fit_points import in_degrees
from model.fit import FitResult

IMPLAUSIBLE = 1e-3
"""Probability of a chi-square below which the model is taken to miss the data: three standard deviations, about."""


@dataclass(frozen=True)
class Judgement:
    """What a fit is worth to a scan that wants standard errors.

    Attributes
    ----------
    standing : str
        Every wanted standard error beside the one that there is.
    unmet : tuple of str
        Parameters whose standard error is still too large, the largest in units of the wanted one first.
    doubts : tuple of str
        Why the fit's standard errors are not to be trusted.
    """

    standing: str
    unmet: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def is_reached(self) -> bool:
        """Whether all that is wanted is known, beyond doubt."""
        return not (self.unmet or self.doubts)


def misfit(result: FitResult) -> str:
    """Why the fit does not describe the data, empty if it does."""
    if result.degrees_of_freedom < len(result.names):
        return "the data are not yet twice as many as the parameters, so that nothing shows whether the model is right"
    if result.p_value is not None and result.p_value < IMPLAUSIBLE:
        return (
            f"the model misses the data by more than their noise (chi-square {result.chi_square:.4g} for "
            f"{result.degrees_of_freedom} degrees of freedom)"
        )
    return ""


def judge(result: FitResult, wanted: Mapping[str, float]) -> Judgement:
    """Compare the standard errors of a fit with those that are wanted.

    Parameters
    ----------
    result : FitResult
        As the model has it, with angles in rad.
    wanted : mapping of str to float
        Wanted standard errors of free parameters, by the names that a recipe uses, angles in degrees.
    """
    shown = in_degrees(result)
    excess = {name: _excess(shown, name, error) for name, error in wanted.items()}
    unmet = sorted((name for name in excess if excess[name] > 1.0), key=lambda name: -excess[name])
    standing = ", ".join(_standing(shown, name, error) for name, error in wanted.items())
    return Judgement(standing, tuple(unmet), tuple(_doubts(shown, wanted)))


def _excess(shown: FitResult, name: str, error: float) -> float:
    """The standard error in units of the wanted one; infinite where nobody knows it."""
    stderr = shown.parameters[name].stderr
    return float("inf") if stderr is None else stderr / error


def _standing(shown: FitResult, name: str, error: float) -> str:
    estimate = shown.parameters[name]
    stderr = estimate.stderr
    if stderr is None:
        return f"{name} {'at its bound' if estimate.at_bound else 'not determined'}"
    return f"{name} {stderr:.3g} {'<=' if stderr <= error else '>'} {error:g}"


def _doubts(shown: FitResult, wanted: Mapping[str, float]) -> Iterator[str]:
    if doubt := misfit(shown):
        yield doubt
    for other in shown.alternatives:
        for name, error in wanted.items():
            value = other.parameters[name]
            if abs(value - shown.parameters[name].value) > error:
                yield f"{name} may as well be {value:.4g}, with a chi-square only {other.excess:.2g} higher"
