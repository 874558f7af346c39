"""What is computed of every pixel, as a formula: from counts behind analyzer states to Stokes parameters and errors.

A step that is not called for leaves no trace in the formula, and so none in the compiled pass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.stokes.pixel_values import PixelValues, check_outputs, needs_variances, weights_of
from goniometer.errors import ReductionError
from model.kernel.expression import Symbol, Value, maximum, where


@dataclass(frozen=True)
class SensorNoise:
    """Variance of a pixel: that of the dark, and the photons' own (EMVA Standard 1288, release 4.0, eq. 7).

    Parameters
    ----------
    read_counts : float
        Standard deviation of a dark pixel, in counts; that of the quantization is among it.
    electrons_per_count : float
        How many electrons a count stands for.
    """

    read_counts: float
    electrons_per_count: float


@dataclass(frozen=True)
class PixelFormula:
    """How a pixel's counts become what is asked of it.

    Parameters
    ----------
    inverse : ndarray
        (3 or 4, N): Stokes parameters from the light behind N analyzer states, in their order (`inverse_of`). It is
        one for all pixels: a pixel's own errors do not weigh its states.
    outputs : tuple of str
        What is asked: `S0` to `S3`, `DoLP` and `AoLP_rad`, each also with `_variance`; `S0_S1_covariance` and those of
        other pairs.
    noise : SensorNoise, optional
        Needed for variances.
    saturation_counts : int, optional
        From here on a pixel says nothing; all that is asked of it is then NaN.
    has_dark, has_flat : bool
        Whether a dark frame is subtracted, and then each pixel divided by its sensitivity, NaN for a bad one.

    Raises
    ------
    ReductionError
        When an output is not among these, or needs a noise that is not given.
    """

    inverse: NDArray[np.float64]
    outputs: tuple[str, ...]
    noise: SensorNoise | None = None
    saturation_counts: int | None = None
    has_dark: bool = False
    has_flat: bool = False

    def __post_init__(self) -> None:
        check_outputs(self.inverse, self.outputs)
        if self.noise is None and needs_variances(self.outputs):
            raise ReductionError("Variances of counts need the sensor's noise, which is not given.")

    def counts(self) -> tuple[str, ...]:
        """Names of the frames."""
        return tuple(f"counts{state}" for state in range(self.inverse.shape[1]))

    def maps(self) -> tuple[str, ...]:
        """Names of the maps that belong to the sensor."""
        return tuple(name for name, is_there in (("dark", self.has_dark), ("flat", self.has_flat)) if is_there)

    def weights(self) -> dict[str, float]:
        """The elements of `inverse` by name."""
        return weights_of(self.inverse)

    def record(self, at: Mapping[str, Symbol]) -> list[Value]:
        """The outputs in their order, from symbols of counts, maps and weights."""
        gain: Value = 1.0 / at["flat"] if self.has_flat else 1.0
        light = [at[name] - at["dark"] if self.has_dark else at[name] for name in self.counts()]
        signals = [part * gain for part in light]
        variances = [self._variance(part, gain) for part in light] if self.noise else []
        found = PixelValues(self.inverse, at, signals, variances)
        values = [found.value(name) for name in self.outputs]
        if self.saturation_counts is None:
            return values
        limit = float(self.saturation_counts)
        brightest = maximum(*(at[name] for name in self.counts()))
        return [where(brightest >= limit, math.nan, value) for value in values]

    def _variance(self, light: Value, gain: Value) -> Value:
        assert self.noise is not None, "asked only where there is noise"
        # Counts as they come are never below 0.
        electrons = maximum(light, 0.0) if self.has_dark else light
        return (electrons * (1.0 / self.noise.electrons_per_count) + self.noise.read_counts**2) * (gain * gain)
