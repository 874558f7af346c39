"""What ``goniometer fit --profile`` and ``--bootstrap`` add: intervals that do not lean on the standard error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import in_radians, model_name, surface_family
from goniometer.errors import ConfigurationError
from goniometer.plus_minus import plus_minus
from model.fit import Dataset, FitResult
from model.fit.bootstrap import bootstrap
from model.fit.profile import profile

_PROBABILITY = 0.95


@dataclass(frozen=True)
class Intervals:
    """Ranges that hold a parameter's true value with 95 % probability, under the names that people use.

    Attributes
    ----------
    profiles : dict of str to (low, high)
        Where the likelihood says so.
    scatter : dict of str to (low, high)
        Where fits to data made anew say so.
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
        for name, (low, high) in self.scatter.items():
            middle = plus_minus(0.5 * (low + high), self.scatter_stderr[name])
            lines.append(f"{name}: from {low:.6g} to {high:.6g}, say {self.count} fits to data made anew ({middle}).")
        return ["With 95 % probability", *lines] if lines else []


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
    for name in profiled:
        low, high = profile(data, family, result, model_name(name), objective=choice.objective).interval(_PROBABILITY)
        profiles[name] = _shown(name, low), _shown(name, high)
    if count:
        anew = bootstrap(data, family, result, count=count, objective=choice.objective)
        for model, spread in anew.stderr.items():
            name = known.get(model, model)
            low, high = anew.interval(model, _PROBABILITY)
            scatter[name] = _shown(name, low), _shown(name, high)
            stderr[name] = _shown(name, spread)
    return Intervals(profiles, scatter, stderr, count)


def _shown(name: str, value: float) -> float:
    return value / float(in_radians(name, np.array(1.0)))
