"""Fresnel reflection off one facet, in real arithmetic that does not cancel.

Jones vectors are (E_s, E_p) with (s, p, q) right-handed before and after reflection, time dependence exp(-i omega t)
and index N = n + ik with k >= 0. At normal incidence r_p = -r_s, which is one and the same reflection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.geometry import FloatArray

_TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True)
class Reflection:
    """What a reflection does to Stokes vectors, in the facet's own s-p frame.

    Attributes
    ----------
    mean : ndarray
        (Rs + Rp)/2.
    half_difference : ndarray
        (Rs - Rp)/2.
    cross_real, cross_imag : ndarray
        Real and imaginary part of r_s r_p*.
    """

    mean: FloatArray
    half_difference: FloatArray
    cross_real: FloatArray
    cross_imag: FloatArray

    def mueller(self) -> FloatArray:
        """Mueller matrices in the facet's s-p frame, shape (..., 4, 4)."""
        matrix = np.zeros((*np.shape(self.mean), 4, 4))
        matrix[..., 0, 0] = matrix[..., 1, 1] = self.mean
        matrix[..., 0, 1] = matrix[..., 1, 0] = self.half_difference
        matrix[..., 2, 2] = matrix[..., 3, 3] = self.cross_real
        matrix[..., 2, 3], matrix[..., 3, 2] = -self.cross_imag, self.cross_imag
        return matrix


@dataclass(frozen=True)
class Amplitudes:
    """Amplitude coefficients without cancellation: r_s = e (z + sin²), -r_p = e (z - sin²), with |e|² = scale.

    Attributes
    ----------
    z_re, z_im : ndarray
        Real and imaginary part of z = cos·sqrt(N² - sin²).
    scale : ndarray
        Squared size of the common factor e, whose phase no Mueller matrix knows.
    """

    z_re: FloatArray
    z_im: FloatArray
    scale: FloatArray


def amplitudes(cos_facet: FloatArray, sin2_facet: FloatArray, index: complex) -> Amplitudes:
    """Fresnel coefficients of one facet, common factor apart.

    Textbook forms subtract nearly equal numbers in Rs - Rp, near normal incidence and for metals. With d =
    sqrt(N² - sin²) and z = c d one has r_s = (1 - N²)/(c + d)² and r_p = -r_s (z - sin²)/(z + sin²), in which nothing
    that matters cancels.

    Parameters
    ----------
    cos_facet, sin2_facet : ndarray
        Cosine and squared sine of the angle of incidence on the facet, given separately to keep both exact.
    index : complex
        n + ik, n > 0, k >= 0, relative to the medium of incidence.
    """
    c, s2, n, k = cos_facet, sin2_facet, index.real, index.imag
    contrast_re, contrast_im = (n - 1.0) * (n + 1.0) - k * k, 2.0 * n * k  # N² - 1
    # N² - sin²: near n = 1 as (N² - 1) + cos², elsewhere with fewer roundings.
    q = contrast_re + c * c if abs(contrast_re) < 0.5 else n * n - k * k - s2
    larger = np.sqrt((np.hypot(q, contrast_im) + np.abs(q)) / 2.0)
    smaller = contrast_im / (2.0 * np.maximum(larger, _TINY))
    d_re, d_im = np.where(q >= 0.0, larger, smaller), np.where(q >= 0.0, smaller, larger)

    z_re, z_im = c * d_re, c * d_im
    sum_squared = np.maximum((c + d_re) ** 2 + d_im**2, _TINY)
    r_s2 = (np.hypot(contrast_re, contrast_im) / sum_squared) ** 2
    return Amplitudes(z_re=z_re, z_im=z_im, scale=r_s2 / ((z_re + s2) ** 2 + z_im**2))


def reflect(cos_facet: FloatArray, sin2_facet: FloatArray, index: complex) -> Reflection:
    """Fresnel reflection at the local angle of incidence, as it acts on Stokes vectors.

    Parameters
    ----------
    cos_facet, sin2_facet : ndarray
        Cosine and squared sine of the angle of incidence on the facet, given separately to keep both exact.
    index : complex
        n + ik, n > 0, k >= 0, relative to the medium of incidence.
    """
    s2, at = sin2_facet, amplitudes(cos_facet, sin2_facet, index)
    r_s2 = at.scale * ((at.z_re + s2) ** 2 + at.z_im**2)
    r_p2 = at.scale * ((at.z_re - s2) ** 2 + at.z_im**2)
    return Reflection(
        mean=(r_s2 + r_p2) / 2.0,
        half_difference=2.0 * at.scale * s2 * at.z_re,
        cross_real=-at.scale * ((at.z_re - s2) * (at.z_re + s2) + at.z_im**2),
        cross_imag=2.0 * at.scale * s2 * at.z_im,
    )


def require_index(index: complex) -> None:
    """Raise ValueError unless the index can be n + ik of a material."""
    if not (0.0 < index.real < np.inf and 0.0 <= index.imag < np.inf):
        raise ValueError(f"index is {index}; it is n + ik with n above 0 and k of at least 0, both finite.")
