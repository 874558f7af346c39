"""Fresnel reflection off one facet, in real arithmetic that does not cancel.

Jones vectors are (E_s, E_p) with (s, p, q) right-handed before and after reflection, time dependence exp(-i omega t)
and index N = n + ik with k >= 0. At normal incidence r_p = -r_s, which is one and the same reflection.
"""

from __future__ import annotations

from dataclasses import dataclass

from model.kernel.expression import Value, maximum, sqrt, where
from model.matrix import Matrix

_LARGEST = 1e8
_SMALLEST = 1e-8
# Below any square root that is divided by; what is divided is then 0.
_TINY = 1e-290


@dataclass(frozen=True)
class Amplitudes:
    """Amplitude coefficients without cancellation: r_s = e (z + w), -r_p = e (z - w), with |e|² = scale.

    Attributes
    ----------
    z_re, z_im : Value
        Real and imaginary part of z, of the order of 1.
    unit : Value
        Factor that brought z there: w = sin²·unit, and all that goes with sin² takes it likewise.
    scale : Value
        Squared size of the common factor e, whose phase no Mueller matrix knows.
    """

    z_re: Value
    z_im: Value
    unit: Value
    scale: Value


def amplitudes(cos_facet: Value, sin2_facet: Value, n: Value, k: Value) -> Amplitudes:
    """Fresnel coefficients of one facet, common factor apart.

    Textbook forms subtract nearly equal numbers in Rs - Rp, near normal incidence and for metals. With d =
    sqrt(N² - sin²) and z = c d one has r_s = (1 - N²)/(c + d)² and r_p = -r_s (z - sin²)/(z + sin²), in which nothing
    that matters cancels.

    Parameters
    ----------
    cos_facet, sin2_facet : Value
        Cosine and squared sine of the angle of incidence on the facet, given separately to keep both exact.
    n, k : Value
        Refractive index n + ik relative to the medium of incidence.
    """
    c, s2 = cos_facet, sin2_facet
    contrast_re, contrast_im = (n - 1.0) * (n + 1.0) - k * k, 2.0 * n * k  # N² - 1
    # N² - sin²: near n = 1 as (N² - 1) + cos², elsewhere with fewer roundings.
    q = where(abs(contrast_re) < 0.5, contrast_re + c * c, n * n - k * k - s2)
    size = maximum(sqrt(q * q + contrast_im * contrast_im), abs(q), contrast_im)
    larger = sqrt((size + abs(q)) * 0.5)
    smaller = contrast_im / (2.0 * maximum(larger, _TINY))
    d_re, d_im = where(q >= 0.0, larger, smaller), where(q >= 0.0, smaller, larger)

    z_re, z_im = c * d_re, c * d_im
    sum_re = c + d_re
    sum2 = maximum(sum_re * sum_re + d_im * d_im, _TINY)
    unit = maximum(z_re + z_im + s2, _TINY)
    # One division for two: both are of an order that their product keeps.
    inverse = 1.0 / (sum2 * unit)
    z_re, z_im, w = z_re * inverse * sum2, z_im * inverse * sum2, s2 * inverse * sum2
    r_s = sqrt(contrast_re * contrast_re + contrast_im * contrast_im) * inverse * unit
    sum_re = z_re + w
    return Amplitudes(z_re, z_im, inverse * sum2, r_s * r_s / (sum_re * sum_re + z_im * z_im))


def reflection(cos_facet: Value, sin2_facet: Value, n: Value, k: Value) -> Matrix:
    """Mueller matrix of one reflection in the facet's own s-p frame; arguments as for `amplitudes`."""
    at = amplitudes(cos_facet, sin2_facet, n, k)
    w = sin2_facet * at.unit
    plus, minus, phase = at.z_re + w, at.z_re - w, at.z_im * at.z_im
    s, p = plus * plus + phase, minus * minus + phase
    mean, half_difference = at.scale * (s + p) * 0.5, 2.0 * at.scale * w * at.z_re
    cross_re, cross_im = -at.scale * (minus * plus + phase), 2.0 * at.scale * w * at.z_im
    return (
        (mean, half_difference, 0.0, 0.0),
        (half_difference, mean, 0.0, 0.0),
        (0.0, 0.0, cross_re, -cross_im),
        (0.0, 0.0, cross_im, cross_re),
    )


def require_index(index: complex) -> None:
    """Raise ValueError unless the index can be n + ik of a material."""
    if not (_SMALLEST <= index.real <= _LARGEST and 0.0 <= index.imag <= _LARGEST):
        raise ValueError(
            f"index is {index}; it is n + ik with n above 0 and k of at least 0 "
            f"(n from {_SMALLEST:g} to {_LARGEST:g}, k to {_LARGEST:g})."
        )
