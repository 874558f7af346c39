"""What ``goniometer fit --profile`` and ``--bootstrap`` add: intervals that do not lean on the standard error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import in_radians, model_name, named_in_degrees, surface_family
from goniometer.errors import ConfigurationError
from goniometer.plus_minus import number_and_error
from model.fit import Dataset, FitResult
from model.fit.bootstrap import bootstrap
from model.fit.profile import profile

_PROBABILITY = 0.95
_FEWEST = 40
"""Fits of which one lies beyond each end of an interval: fewer have no such ends."""
_END = 2.67
"""Of N normal samples the standard error of the quantiles at 2.5 and 97.5 %, in standard deviations over √N."""


@dataclass(frozen=True)
class Intervals:
    """Ranges that hold a parameter's true value with 95 % probability, under the names that people use.

    Attributes
    ----------
    profiles : dict of str to (low, high)
        Where the likelihood says so.
    scatter : dict of str to (low, high)
        Where fits to data made anew say so; empty if they are too few.
    scatter_stderr : dict of str to float
        Standard deviation of these fits.
    count : int
        How many they were.
    """

    profiles: dict[str, tuple[float, float]] = field(default_factory=dict)
    scatter: dict[str, tuple[float, float]] = field(default_factory=dict)
    scatter_stderr: dict[str, float] = field(default_factory=dict)
    count: int = 0

    def lines(self) -> list[str]:
        """The intervals in words, one line each."""
        lines = [
            f"{name}: from {low:.6g} to {high:.6g}, says its profile." for name, (low, high) in self.profiles.items()
        ]
        lines += [self._scattered(name, low, high) for name, (low, high) in self.scatter.items()]
        lines = ["With 95 % probability", *lines] if lines else []
        return lines if self.scatter or not self.count else [*lines, *self._scattered_alone()]

    def _scattered(self, name: str, low: float, high: float) -> str:
        doubt = _END / self.count**0.5 * self.scatter_stderr[name]
        (first, error), (last, _) = (number_and_error(end, doubt) for end in (low, high))
        ends = f"from {first} to {last}, each end ± {error}" if error else f"from {low:.6g} to {high:.6g}"
        return f"{name}: {ends}, say {self.count} fits to data made anew."

    def _scattered_alone(self) -> Iterator[str]:
        share = 100.0 / (2.0 * (self.count - 1)) ** 0.5
        yield (
            f"{self.count} fits to data made anew scatter by (standard deviations, each known to {share:.0f} %; for an "
            f"interval of 95 % ask for 200 fits, and at least {_FEWEST})"
        )
        yield from (f"{name}: {spread:.1g}" for name, spread in self.scatter_stderr.items())


def intervals(
    data: Dataset,
    choice: FitChoice,
    acceptance_sr: float | None,
    result: FitResult,
    profiled: Sequence[str],
    count: int,
) -> Intervals:
    """Find the intervals asked for.

    Parameters
    ----------
    data, choice, acceptance_sr
        As they were fitted.
    result : FitResult
        The fit.
    profiled : sequence of str
        Parameters whose profile is wanted, as a recipe names them.
    count : int
        Fits to data made anew; 0 for none.

    Raises
    ------
    ConfigurationError
        If there is no such parameter, or the fit was robust: then neither the likelihood nor the noise is known.
    FitError
        If the data cannot answer.
    """
    if not profiled and not count:
        return Intervals()
    if choice.robust:
        raise ConfigurationError(["A robust fit has no likelihood: leave out --profile and --bootstrap, or --robust."])
    known = {model_name(name): name for name in choice.free}
    missing = [name for name in profiled if model_name(name) not in result.parameters]
    if missing:
        raise ConfigurationError([f"--profile {name}: the fit has {', '.join(result.parameters)}." for name in missing])
    family = surface_family(choice, acceptance_sr)
    profiles, scatter, stderr = {}, {}, {}
    with named_in_degrees():
        found = {name: profile(data, family, result, model_name(name), objective=choice.objective) for name in profiled}
        anew = bootstrap(data, family, result, count=count, objective=choice.objective) if count else None
    for name, followed in found.items():
        low, high = followed.interval(_PROBABILITY)
        profiles[name] = _shown(name, low), _shown(name, high)
    if anew:
        for model, spread in anew.stderr.items():
            name = known.get(model, model)
            if count >= _FEWEST:
                low, high = anew.interval(model, _PROBABILITY)
                scatter[name] = _shown(name, low), _shown(name, high)
            stderr[name] = _shown(name, spread)
    return Intervals(profiles, scatter, stderr, count)


def _shown(name: str, value: float) -> float:
    return value / float(in_radians(name, np.array(1.0)))
