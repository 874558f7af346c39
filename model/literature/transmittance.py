"""Share of light that a smooth surface of real refractive index lets through, without cancellation."""

from __future__ import annotations

from dataclasses import dataclass

from model.kernel.expression import Value, maximum, sqrt


@dataclass(frozen=True)
class Transmittance:
    """Half the sum and half the difference, s less p, of the transmittances of power for s and p.

    They are the first two elements of the first row of the transmission's Mueller matrix, and of the first column.
    """

    mean: Value
    half_difference: Value


def transmittance(cosine: Value, sine: Value, n: Value) -> Transmittance:
    """Fresnel transmittances into a medium, or by reciprocity out of it, by the angle outside.

    With w = sqrt(n² - sin²): Ts = 4 c w/(c + w)², Tp = 4 n² c w/(n² c + w)², and Ts - Tp = -4 c w sin² (n² - 1)² over
    the product of both denominators, in which nothing cancels. Where n < 1 reflects totally both are 0.

    Parameters
    ----------
    cosine, sine : Value
        Of the angle outside, from the surface's normal.
    n : Value
        Refractive index of the medium relative to the outside.
    """
    contrast = (n - 1.0) * (n + 1.0)
    w = sqrt(maximum(contrast + cosine * cosine, 0.0))
    inverse_s, inverse_p = 1.0 / (cosine + w), 1.0 / (n * n * cosine + w)
    s = 4.0 * (cosine * inverse_s) * (w * inverse_s)
    p = 4.0 * (n * cosine * inverse_p) * (n * w * inverse_p)
    bend = sine * contrast * inverse_p
    return Transmittance(mean=(s + p) * 0.5, half_difference=-0.5 * s * bend * bend)
