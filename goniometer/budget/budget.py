"""The precision that a recipe will reach, and what changes of it would cost and gain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.recipe import Recipe
from goniometer.budget.assumed_sample import AssumedSample
from goniometer.budget.forecast import Forecast, forecast
from goniometer.budget.recipe_changes import Change, changes, polarizer_sets
from goniometer.rig_file import Rig


@dataclass(frozen=True, eq=False)
class Outcome:
    """A changed recipe, in words, and what would come of it."""

    words: str
    forecast: Forecast


@dataclass(frozen=True, eq=False)
class Budget:
    """What comes of a recipe as it is, and of each change."""

    now: Forecast
    outcomes: tuple[Outcome, ...]

    def cheapest(self, name: str) -> Outcome | None:
        """The change that lowers a parameter's standard error most for each second it costs; None if none lowers it."""
        better = [outcome for outcome in self.outcomes if outcome.forecast.final[name] < self.now.final[name]]
        return max(better, key=lambda outcome: self._worth(outcome, name), default=None)

    def _worth(self, outcome: Outcome, name: str) -> tuple[float, float]:
        """Reduction per second; of several without limit, the quickest."""
        extra_s = outcome.forecast.duration_s - self.now.duration_s
        reduction = self.now.final[name] - outcome.forecast.final[name]
        return reduction / extra_s if extra_s > 0.0 else math.inf, -extra_s


def budget(recipe: Recipe, rig: Rig, sample: AssumedSample, wanted: str | None = None) -> Budget:
    """Predict what comes of a recipe and of its changes.

    Of the sets of three polarizers only the best is kept: for the parameter wanted, or else for all alike.

    Parameters
    ----------
    recipe, rig
        What is measured, and with what.
    sample : AssumedSample
        What is expected.
    wanted : str, optional
        The parameter that matters.

    Raises
    ------
    ConfigurationError
        When the fit's errors do not follow from those of the readings.
    ReductionError
        When the readings could not be reduced.
    """

    def outcomes(variants: Sequence[Change]) -> list[Outcome]:
        return [Outcome(variant.words, forecast(variant.recipe, rig, sample)) for variant in variants]

    every, triples = polarizer_sets(recipe, rig)
    best_triple = min(outcomes(triples), key=lambda outcome: _for_its_time(outcome.forecast, wanted), default=None)
    kept = [*outcomes(list(changes(recipe, rig))), *outcomes(every), *([best_triple] if best_triple else [])]
    return Budget(forecast(recipe, rig, sample), tuple(kept))


def _for_its_time(expected: Forecast, wanted: str | None) -> tuple[int, float]:
    """How many are not determined; of the others the mean logarithm of variance times bench time.

    The second would not change with more of the same readings.
    """
    stderrs = list(expected.final.values()) if wanted is None else [expected.final[wanted]]
    finite = [stderr for stderr in stderrs if math.isfinite(stderr)]
    mean = sum(math.log(stderr**2) for stderr in finite) / max(len(finite), 1)
    return len(stderrs) - len(finite), mean + math.log(expected.duration_s)
