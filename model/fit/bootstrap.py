"""How much a fit's parameters scatter when its own data are made anew with other noise: the parametric bootstrap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from goniometer.errors import FitError
from model.fit.bounds import off_bounds
from model.fit.dataset import Dataset, Objective
from model.fit.family import SurfaceFamily
from model.fit.levenberg_marquardt import minimise
from model.fit.problem import Problem
from model.fit.result import FitResult
from model.geometry import FloatArray

_AT_ONCE, _MOST_STEPS = 64, 1000


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Parameters of many fits to data made anew.

    Attributes
    ----------
    names : tuple of str
        The parameters.
    samples : ndarray
        Shape (count, len(names)).
    """

    names: tuple[str, ...]
    samples: FloatArray

    @property
    def stderr(self) -> dict[str, float]:
        """Standard deviation of each parameter."""
        return dict(zip(self.names, self.samples.std(axis=0, ddof=1).tolist(), strict=True))

    def interval(self, name: str, probability: float = 0.95) -> tuple[float, float]:
        """The range that holds the middle share of the samples of a parameter."""
        ends = 0.5 + np.array([-0.5, 0.5]) * probability
        low, high = np.quantile(self.samples[:, self.names.index(name)], ends)
        return float(low), float(high)


def bootstrap(
    data: Dataset,
    family: SurfaceFamily,
    result: FitResult,
    *,
    count: int = 200,
    objective: Objective = "stokes",
    seed: int = 0,
) -> Bootstrap:
    """Fit data that are the fitted surface's own values with new noise of the data's covariance, many times.

    Parameters
    ----------
    data, family, objective
        As they were fitted.
    result : FitResult
        The fit; every new one starts there.
    count : int
        How many, at least 2.
    seed : int
        Of the noise.

    Raises
    ------
    FitError
        If a fit does not settle.
    """
    if count < 2:
        raise ValueError(f"count is {count}; a scatter needs at least 2.")
    compared = data.compared_by(objective)
    for name, value in result.held.items():
        family = family.holding(name, value)
    random = np.random.default_rng(seed)
    noise = _noise(compared, result, count, random)
    values = np.moveaxis(result.fitted + noise, 1, 2)
    whitener = np.moveaxis(compared.whitener, 0, -1)[None]
    start = np.array([[result.values[name] for name in family.names]])
    samples = []
    for first in range(0, count, _AT_ONCE):
        some = values[first : first + _AT_ONCE]
        problem = Problem(family, compared.observable, compared.directions, some, whitener)
        problem = problem.with_scattered_priors(random).resolving(start)
        ends = minimise(
            problem,
            np.repeat(off_bounds(problem.family, start), len(some), axis=0),
            np.arange(len(some)),
            most_steps=_MOST_STEPS,
        )
        if not ends.settled.all():
            raise FitError(
                f"{int((~ends.settled).sum())} of {len(some)} bootstrap fits of {data.name} did not settle: the data "
                f"hardly determine {', '.join(family.names)}. No scatter is given. Look at the profile of a parameter."
            )
        samples.append(ends.x)
    return Bootstrap(family.names, np.concatenate(samples))


def _noise(data: Dataset, result: FitResult, count: int, generator: np.random.Generator) -> FloatArray:
    random = generator.standard_normal((count, *data.values.shape))
    if data.covariance is None:
        freedom = max(result.degrees_of_freedom, 1)
        return random * result.rms * float(np.sqrt(data.values.size / freedom))
    noise: FloatArray = np.einsum("nij,bnj->bni", np.linalg.cholesky(data.covariance), random)
    return noise
