"""Hyde, Schmidt and Havrilla's model: masked facets over a depolarizing Lambertian term."""

from __future__ import annotations

from model.literature.lambertian import Lambertian
from model.literature.microfacet import Microfacet
from model.literature.published import PublishedModel


class Hyde(PublishedModel):
    """Gaussian facets with the masking of Torrance and Sparrow 1967, and Lambertian light; Hyde et al. 2009.

    F = rho_s D G/(4 cos ti cos tr) · M + rho_d/π · depolarizer, G = min(1, 2 cos θ cos ti/cos β, 2 cos θ cos tr/cos β):
    the facets' term is a `Specular` lobe of one bounce in symmetric V-grooves. Where 1/cos³ stands in the density of
    slopes and one more 1/cos in the reflectance, the two make up the 1/cos⁴ of our D. Both terms are reciprocal.

    The paper could not be had; its abstract names the two terms. Taken as read: σ is our sigma, and the Lambertian term
    is constant with a weight of its own. How the paper sets this weight could not be checked.

    Parameters
    ----------
    rho_s, rho_d : float
        Weights of the facets and of the Lambertian term, >= 0; rho_s is 1 in the model itself.
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
        "Hyde et al. 2009: Gaussian facets with the masking of symmetric V-grooves, and a Lambertian term; read from "
        "the abstract, the Lambertian term constant with a weight of its own."
    )

    def __init__(self, rho_s: float, rho_d: float, sigma: float, index: complex) -> None:
        super().__init__([Microfacet(rho_s, sigma, index, masked=True), Lambertian(rho_d)])
