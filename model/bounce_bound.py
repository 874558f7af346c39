"""How many bounces are enough: a bound on the light that needs more.

A ray meets at most ceil(pi/γ) walls of a groove with opening γ, because unfolded it is a straight line across spokes γ
apart. Light that needs more than K bounces is therefore in grooves with γ < pi/K, whose mean slope exceeds t_K, the
slope at γ = pi/K. Grooves end at one height, so that each takes light in proportion to its ground area, whatever the
incidence: the share in grooves steeper than t_K is the tail of the Gaussian slope vector, exp(-t_K²/2σ²). Absorbing
walls and shallower grooves only make it less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count

from model.domain import require_asymmetry, require_bounces
from model.groove_slope import slope_of_opening
from model.slopes import require_sigma

_MOST = 32


@dataclass(frozen=True)
class Tolerance:
    """As many bounces as leave no more than a fraction of the light.

    Parameters
    ----------
    fraction : float
        Above 0, below 1.
    """

    fraction: float

    def bounces(self, sigma: float, asymmetry: float = 0.0) -> int:
        """How many these are; arguments as for `light_beyond`.

        Raises
        ------
        ValueError
            If they are more than anyone would want to compute.
        """
        if light_beyond(_MOST, sigma, asymmetry) > self.fraction:
            raise ValueError(
                f"A tolerance of {self.fraction:g} asks for more than {_MOST} bounces at sigma = {sigma:g} and "
                f"asymmetry = {asymmetry:g}. Nothing was computed. Allow more light to be left out, or give a number."
            )
        return bounces_for(self.fraction, sigma, asymmetry)


def light_beyond(bounces: int, sigma: float, asymmetry: float = 0.0) -> float:
    """Upper bound of the fraction of light, at any incidence, that needs more than so many bounces.

    Parameters
    ----------
    bounces : int
        K, at least 1.
    sigma : float
        rms slope per axis, > 0.
    asymmetry : float
        a, at least 0 and below 1.

    Raises
    ------
    ValueError
        If an argument is outside its range.
    """
    require_bounces(bounces)
    require_asymmetry(asymmetry)
    require_sigma(sigma)
    if bounces == 1:
        return 1.0  # γ = pi: every groove is steeper than flat
    opening = math.pi / bounces
    steepest = slope_of_opening(math.sin(opening), math.cos(opening), asymmetry)
    assert isinstance(steepest, float)
    ratio = min(steepest / sigma, 1e3)  # beyond which the bound underflows to 0 anyway
    return math.exp(-0.5 * ratio * ratio)


def bounces_for(tolerance: float, sigma: float, asymmetry: float = 0.0) -> int:
    """Smallest number of bounces beyond which at most a fraction `tolerance` of the light remains.

    Parameters
    ----------
    tolerance : float
        Above 0, below 1.
    sigma, asymmetry
        As for `light_beyond`.

    Raises
    ------
    ValueError
        If an argument is outside its range.
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance is {tolerance:g}; allowed is above 0 and below 1. Nothing was computed.")
    return next(bounces for bounces in count(1) if light_beyond(bounces, sigma, asymmetry) <= tolerance)
