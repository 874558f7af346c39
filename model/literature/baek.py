"""Baek, Jeon, Tong and Kim's model for dielectrics: a mirror-like lobe and polarized diffuse light."""

from __future__ import annotations

from model.literature.body_diffuse import BodyDiffuse
from model.literature.ggx import Ggx
from model.literature.published import PublishedModel


class Baek2018(PublishedModel):
    """GGX facets, and light from inside the body that the surface polarizes on its way out; Baek et al. 2018.

    F = rho_s D G/(4 cos ti cos tr) · M + rho_d/π · T(tr) · depolarizer · T(ti). Specular light is s-polarized, diffuse
    light p-polarized. Both terms are reciprocal.

    The paper could not be had. Its structure is that of Mitsuba 3's `pplastic`, which follows it and offers Beckmann or
    GGX facets with Smith's masking. Taken as read: GGX, as another renderer of the model has it, with the product of
    Smith's factors for both rays; the albedo rho_d without a factor 1/n² for the widening of the light that leaves.
    The authors' roughness is alpha here: GGX slopes have no rms, so that no sigma is equal to it.

    Parameters
    ----------
    rho_s, rho_d : float
        Weights of the specular and of the diffuse term, >= 0.
    alpha : float
        Width of the GGX slopes, > 0.
    index : complex
        Refractive index, > 0; the model is of dielectrics, so that it must be real.

    Raises
    ------
    ValueError
        If a value is outside its range, or the index is not real.
    """

    source = (
        "Baek et al. 2018: specular facets and polarized diffuse light; read from a renderer that follows it, with GGX "
        "slopes and Smith's masking."
    )

    def __init__(self, rho_s: float, rho_d: float, alpha: float, index: complex) -> None:
        n = complex(index)
        if n.imag:
            raise ValueError(
                f"index is {index}; the model of Baek et al. 2018 is of dielectrics and takes a real index, k = 0: "
                f"light that enters a metal does not come out again."
            )
        super().__init__([Ggx(rho_s, alpha, n.real), BodyDiffuse(rho_d, n.real)])
