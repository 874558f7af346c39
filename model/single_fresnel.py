"""Eq. (6) of Hao et al. 2023 as it is printed: one facet and one Fresnel matrix for any number of bounces.

Light falls on the facet that mirrors i into r, in the symmetric groove that has it for a wall. Eqs. (3) and (4) divide
the light on it, of width p_1, into what leaves after one bounce, after two, …; summed over the first K they are

    G = 1 - max(min(p_1 … p_{K+1}), shadow, 0)/p_1,

all of it as if it had left towards r. With every bounce summed G is min(1, 2 cos θ_h cos ti/cos β), the masking of
the incoming light alone, so that the lobe is not reciprocal.
"""

from __future__ import annotations

import math

from model.geometry import Angles, facet
from model.groove_plane import groove_plane
from model.groove_reflectance import facet_mueller
from model.kernel.expression import Value, cos, maximum, minimum, where
from model.matrix import Matrix, scaled
from model.slopes import normal_density


def single_fresnel_mueller(at: Angles, bounces: int, sigma: Value, n: Value, k: Value) -> Matrix:
    """Mueller matrix D G/(4 cos ti cos tr) M in 1/sr, G summed over the first so many bounces.

    Parameters
    ----------
    at : Angles
        Where the light comes from and goes to.
    bounces : int
        How many to sum over, at least 1.
    sigma : Value
        rms slope per axis.
    n, k : Value
        Refractive index n + ik of the facet.
    """
    wall = facet(at)
    reflectance = normal_density(wall.slope, sigma) * _visible_share(at, bounces)
    return scaled(facet_mueller(wall, n, k), reflectance / (4.0 * wall.cos_incidence * wall.cos_exit))


def _visible_share(at: Angles, bounces: int) -> Value:
    # p_j/p_1 is cos(D + (j - 1) γ)/cos D with γ = pi - 2 H, as long as that angle is below pi/2.
    plane = groove_plane(at)
    lean = plane.leaning * plane.half_difference.radians
    last = lean + 2.0 * bounces * plane.half_sum.complement
    met = where(last < math.pi / 2.0, minimum(plane.half_difference.cos, cos(last)), 0.0)
    shadow = -cos(lean + 2.0 * plane.half_sum.radians)
    return maximum(1.0 - maximum(met, shadow, 0.0) / plane.half_difference.cos, 0.0)
