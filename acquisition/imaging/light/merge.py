"""Several exposures of one state become one image, each pixel weighted by how well each exposure shows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.dark_level import DarkLevel
from acquisition.imaging.light.exposure import Exposure

Map = NDArray[np.float32]

_CONTRADICTION = 6.0**2
"""A chi-square that exposures of the same light do not reach: 6 standard deviations between two."""


def merged(exposures: Sequence[Exposure], dark: Dark | None, rows: slice) -> tuple[Map, Map, NDArray[np.bool_]]:
    """Light, variance, and at which pixels the exposures contradict each other.

    The weights are inverse variances (Hasinoff et al. 2010), of the light that all exposures together show: a weight
    from a pixel's own counts would favour those that came out low. The first estimate has weights that depend on no
    counts at all, the exposures' durations, which are right where photons make all the noise. It gives the second its
    weights, and the second the last: that is as near to the best weighted mean as makes no difference, and its error
    has the same covariance with each exposure, so that it favours none. Exposures in which a pixel is saturated have no
    weight.
    """
    if len(exposures) == 1:
        return _alone(exposures[0], dark, rows)
    lights = [exposure.light(rows) for exposure in exposures]
    light, _ = _weighted(lights, [np.full_like(one, of.light_s) for of, one in zip(exposures, lights, strict=True)])
    by_dark = [_of_dark(exposure, dark, rows) for exposure in exposures]
    for _ in range(2):
        noises = [exposure.noise(light, rows) for exposure in exposures]
        weights = [1.0 / (noise + own) for noise, own in zip(noises, by_dark, strict=True)]
        light, shares = _weighted(lights, weights)
    variance = np.zeros_like(light)
    of_levels: dict[DarkLevel, Map] = {}
    for exposure, noise, share in zip(exposures, noises, shares, strict=True):
        variance += share * share * noise
        for level, error in exposure.dark_shares:
            of_levels[level] = of_levels.get(level, np.float32(0.0)) + share * np.float32(error)
    for level, of_level in of_levels.items():
        assert dark is not None, "what has levels"
        variance += of_level * of_level * dark.level_variance(level, rows)
    return light, variance, _contradictions(lights, weights, light)


def _alone(exposure: Exposure, dark: Dark | None, rows: slice) -> tuple[Map, Map, NDArray[np.bool_]]:
    """Light and variance from one exposure, whose own counts are the only estimate of its noise."""
    light = exposure.light(rows)
    variance = exposure.noise(light, rows)
    variance += _of_dark(exposure, dark, rows)
    return light, variance, np.zeros(light.shape, np.bool_)


def _weighted(lights: Sequence[Map], weights: Sequence[Map]) -> tuple[Map, list[Map]]:
    """Mean over exposures, and the share of each in it; NaN where all are. Weights of what is NaN become 0."""
    total, light = np.zeros_like(lights[0]), np.zeros_like(lights[0])
    for one, weight in zip(lights, weights, strict=True):
        np.copyto(weight, np.float32(0.0), where=np.isnan(one))
        total += weight
    total[total == 0.0] = np.nan
    shares = [weight / total for weight in weights]
    for one, share in zip(lights, shares, strict=True):
        np.add(light, one * share, out=light, where=share != 0.0)
    return light, shares


def _of_dark(exposure: Exposure, dark: Dark | None, rows: slice) -> Map | np.float32:
    """Variance of an exposure's light by its dark alone."""
    total: Map | np.float32 = np.float32(0.0)
    for level, share in exposure.dark_shares:
        assert dark is not None, "what has shares"
        total = total + dark.level_variance(level, rows) * np.float32(share**2)
    return total


def _contradictions(lights: Sequence[Map], weights: Sequence[Map], light: Map) -> NDArray[np.bool_]:
    chi_square = np.zeros_like(light)
    for one, weight in zip(lights, weights, strict=True):
        apart = one - light
        np.add(chi_square, apart * apart * weight, out=chi_square, where=weight > 0.0)
    return np.asarray(chi_square > _CONTRADICTION)
