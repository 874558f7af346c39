"""Hao, Duan, Liu, Yang and Zhan's model as they print it."""

from __future__ import annotations

from model.bounce_bound import Tolerance
from model.literature.published import PublishedModel
from model.lobes import Diffuse, Directional, Specular


class Hao2023(PublishedModel):
    """Three lobes of V-grooves with one facet and one Fresnel matrix for any number of bounces; Hao et al. 2023.

    F of eq. (5): the specular lobe of eq. (6) in the single-fresnel reading, the diffuse lobe of eq. (8) with the
    printed power laws and clamped at zero, and the directional lobe of eq. (10) with the printed exponent and the
    prefactor 1/(√(2π) σ), where eqs. (11) and (13) print 1/√(2πσ). Their σ is our sigma.

    Neither the directional lobe nor the specular one with more than one bounce is reciprocal, and the latter grows
    beyond all bounds towards grazing exit. The single-fresnel reading knows symmetric grooves only; for asymmetric ones
    see `Specular` in its default reading.

    Parameters
    ----------
    rho_s, rho_d, rho_dd : float
        Weights of the specular, the diffuse and the directional lobe, >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    bounces : int or Tolerance
        How many the masking factor is summed over; the paper draws up to four.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    source = "Hao et al. 2023, as printed: eqs. (5), (6), (8), (10) in the single-fresnel reading."

    def __init__(
        self,
        rho_s: float,
        rho_d: float,
        rho_dd: float,
        sigma: float,
        index: complex,
        bounces: int | Tolerance = 4,
    ) -> None:
        super().__init__(
            [
                Specular(rho_s, sigma, index, bounces=bounces, reading="single-fresnel"),
                Diffuse(rho_d, sigma),
                Directional(rho_dd, sigma, index),
            ]
        )
