"""Wang, Zhu and Liu's three-component model for metals."""

from __future__ import annotations

from model.literature.lambertian import Lambertian
from model.literature.microfacet import Microfacet
from model.literature.published import PublishedModel
from model.lobes import Directional


class ThreeComponent(PublishedModel):
    """Specular, directional diffuse and ideal diffuse light; Wang et al. 2017, Zhu et al. 2018.

    F = rho_s D G/(4 cos ti cos tr) · M + rho_dd exp(-2 tan tr/σ²)/(√(2π) σ) · M + rho_d/π · depolarizer. The
    directional term depends on the exit angle alone: the model is not reciprocal.

    The papers could not be had. The abstract of Wang et al. 2017 names the three terms; Hao et al. 2023 call them
    specular, diffuse and body scattering, with Blinn's masking, which is that of symmetric V-grooves. Taken as read:
    the specular term as in `Hyde`; the directional term in shape and polarization from eq. (10) of Hao et al. 2023, who
    say that Zhu et al. 2018 brought such a lobe to polarimetric models; one σ, our sigma, in both.

    Parameters
    ----------
    rho_s, rho_d, rho_dd : float
        Weights of the specular, the ideal diffuse and the directional diffuse term, >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    source = (
        "Wang et al. 2017 and Zhu et al. 2018: specular, ideal diffuse and directional diffuse light; read from the "
        "abstract, the directional term from eq. (10) of Hao et al. 2023."
    )

    def __init__(self, rho_s: float, rho_d: float, rho_dd: float, sigma: float, index: complex) -> None:
        super().__init__(
            [Microfacet(rho_s, sigma, index, masked=True), Lambertian(rho_d), Directional(rho_dd, sigma, index)]
        )
