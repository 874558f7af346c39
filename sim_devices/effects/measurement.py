"""When the light is looked at, for how long, and the random numbers that belong to it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

SAMPLE_S = 0.003

Stokes = NDArray[np.floating]


class Moment:
    """A stretch of time over which light is averaged; of no length for the light at an instant.

    Parameters
    ----------
    middle_s : float
        Its middle.
    exposure_s : float
        Its length.
    lit : float
        Share of it in which a chopper lets the lamp's light through, 0 to 1.

    Attributes
    ----------
    reflected : ndarray or None
        Stokes vector, (4,), to be taken for what the sample sends; None for what it does send.
    """

    reflected: Stokes | None = None

    def __init__(self, middle_s: float, exposure_s: float, lit: float = 1.0) -> None:
        self.middle_s, self.exposure_s, self.lit = middle_s, exposure_s, lit


class Trial(Moment):
    """A moment in which the sample is taken to send given light: what is made of it on its way is found so.

    Parameters
    ----------
    moment : Moment
        When, and for how long.
    reflected : ndarray
        Stokes vector, (4,).
    """

    def __init__(self, moment: Moment, reflected: Stokes) -> None:
        super().__init__(moment.middle_s, moment.exposure_s, moment.lit)
        self.reflected = reflected


class Expectation:
    """In the place of random numbers: those that are expected, of which no noise is left."""

    def poisson(self, mean: float) -> float:
        """The mean."""
        return mean

    def normal(self, mean: float, stddev: float) -> float:
        """The mean."""
        return mean


class Measurement(Moment):
    """A moment that a detector measures, with random numbers that are the same for the same seed and number.

    Parameters
    ----------
    middle_s, exposure_s, lit : float
        Middle, length, and share with light of the lamp.
    seed : int
        The scene's seed.
    number : int
        Counts the measurements of the bench from 0.
    """

    def __init__(self, middle_s: float, exposure_s: float, lit: float = 1.0, *, seed: int, number: int) -> None:
        super().__init__(middle_s, exposure_s, lit)
        self._key = [seed, number]

    @cached_property
    def random(self) -> np.random.Generator | Expectation:
        """Random numbers, made only when an effect draws some."""
        return np.random.default_rng(self._key)


class ExpectedMeasurement(Measurement):
    """A measurement without noise.

    Parameters
    ----------
    middle_s, exposure_s, lit : float
        Middle, length, and share with light of the lamp.
    """

    random = Expectation()

    def __init__(self, middle_s: float, exposure_s: float, lit: float = 1.0) -> None:
        Moment.__init__(self, middle_s, exposure_s, lit)


def seeded(seed: int, number: int, name: str) -> np.random.Generator:
    """Random numbers of their own for the `number`-th event of what `name` names."""
    return np.random.default_rng([seed, number, *name.encode()])
