"""Priest and Germer's microfacet model, the first polarimetric one in wide use."""

from __future__ import annotations

from model.literature.microfacet import Microfacet
from model.literature.published import PublishedModel


class PriestGermer(PublishedModel):
    """Gaussian facets without shadowing or masking; Priest and Germer 2000, Priest and Meier 2002.

    F = exp(-tan²θ/2σ²)/(2π · 4σ² cos⁴θ cos ti cos tr) · M, θ the tilt of the facet that mirrors i into r, M its Fresnel
    matrix between the macro frames. Their σ² is the variance of slopes per axis, so that their σ is our sigma; their
    1/(2π · 4σ² cos⁴θ) is our D/4. It is reciprocal, and grows beyond all bounds towards grazing angles.

    The papers could not be had: this is the form in which the model is commonly quoted. Angles of rotation by arccos,
    as it is usually written down with, have the wrong sign for half of all azimuths; here they come from vectors.

    Parameters
    ----------
    rho_s : float
        Weight >= 0; 1 in the model itself.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    source = "Priest and Germer 2000: Gaussian facets without shadowing, in the form commonly quoted, D with 1/cos⁴."

    def __init__(self, rho_s: float, sigma: float, index: complex) -> None:
        super().__init__([Microfacet(rho_s, sigma, index, masked=False)])
