"""Sine, cosine, exponential and arctangent in arithmetic without a branch, accurate to about the last bit.

An argument is brought near 0 by what the function repeats or adds, and a minimax polynomial does the rest. The
polynomials are our own: Remez's exchange for the least relative error of the function, coefficients rounded one after
another and those left fitted anew. The bound beside each (float64, float32) is that error in exact arithmetic.
Rounding errors are part of the design: a compiler that reorders sums, or fuses products with them, spoils it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from model.kernel.expression import Value, fma, maximum, minimum, nearest, odd, power_of_two, second_bit, where

Precision = Literal["float64", "float32"]

# Sums of parts, each the nearest number to what those before it leave.
_HALF_PI: dict[Precision, tuple[float, float, float]] = {
    "float64": (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33),
    "float32": (1.5707964, -4.371139e-08, -1.7151245e-15),
}
_LN_2: dict[Precision, tuple[float, float]] = {
    "float64": (0.6931471805599453, 2.3190468138462996e-17),
    "float32": (0.6931472, -1.9046542e-09),
}

# exp rounds to 0 here and below.
_VANISHING: dict[Precision, float] = {"float64": -746.0, "float32": -104.0}
# The same of exp(2 x). Single precision ends where its digits do: with fewer of them numbers are slow to compute with.
_HALF_VANISHING: dict[Precision, float] = {"float64": -373.0, "float32": -43.0}
# 2 to this power is a normal number, and so is what else exp of the above is to be multiplied by.
_LEAST_EXPONENT: dict[Precision, float] = {"float64": -1000.0, "float32": -100.0}

_TAN_HALF = 0.5463024898437905

# (sin x/x - 1)/x² in x², |x| <= pi/4: 2**-57.9 and 2**-27.9 of sin x.
_SINE: dict[Precision, tuple[float, ...]] = {
    "float64": (
        -0.1666666666666663,
        0.00833333333332184,
        -0.00019841269829358525,
        2.755731353850893e-06,
        -2.5050734387519514e-08,
        1.5895433134782077e-10,
    ),
    "float32": (-0.16666655, 0.008332187, -0.00019517897),
}
# (cos x - 1 + x²/2)/x⁴ in x², |x| <= pi/4: 2**-63.9 and 2**-33.0 of cos x.
_COSINE: dict[Precision, tuple[float, ...]] = {
    "float64": (
        0.041666666666666595,
        -0.0013888888888873342,
        2.4801587289002062e-05,
        -2.7557314217028066e-07,
        2.0875705393753876e-09,
        -1.1358749082532837e-11,
    ),
    "float32": (0.041666646, -0.001388731, 2.4432327e-05),
}
# (exp x - 1 - x)/x², |x| <= ln(2)/2: 2**-56.5 and 2**-28.2 of exp x.
_EXPONENTIAL: dict[Precision, tuple[float, ...]] = {
    "float64": (
        0.5000000000000011,
        0.16666666666666438,
        0.04166666666652576,
        0.008333333333473652,
        0.0013888888944877647,
        0.0001984126956089135,
        2.480149190640778e-05,
        2.75575185958562e-06,
        2.763059582165422e-07,
        2.5029797174798214e-08,
    ),
    "float32": (0.49999994, 0.16666517, 0.041668102, 0.0083691915, 0.0013838881),
}
# (atan x/x - 1)/x² in x², |x| <= tan(1/2): 2**-58.7 and 2**-26.1 of atan x.
_ARCTANGENT: dict[Precision, tuple[float, ...]] = {
    "float64": (
        -0.3333333333333317,
        0.19999999999956367,
        -0.14285714281619838,
        0.11111110917141749,
        -0.0909090365373949,
        0.07692209333454376,
        -0.06665457421445795,
        0.05871931916259327,
        -0.051991501265731245,
        0.0448014756208778,
        -0.034623409014723876,
        0.02033812245618326,
        -0.006414890704940324,
    ),
    "float32": (-0.33333117, 0.19989386, -0.14114207, 0.09863086, -0.04637783),
}


def sine_cosine(angle: Value, precision: Precision) -> tuple[Value, Value]:
    """Sine and cosine, to 1 ulp also where they are tiny, by the reduction of Cody and Waite 1980.

    Parameters
    ----------
    angle : Value
        Radians; up to 1e6 in size for float64, 1e4 for float32.
    precision : Precision
        Type in which the arithmetic is done.
    """
    high, middle, low = _HALF_PI[precision]
    quarters = nearest(angle * (1.0 / (high + middle)))
    # The first difference is exact; what rounding takes from the second is coarse - x - quarters·middle (Dekker 1971).
    coarse = fma(quarters, -high, angle)
    x = coarse - quarters * middle
    rest = fma(quarters, -low, fma(quarters, -middle, coarse - x))
    square = fma(x, x, 2.0 * rest * x)
    sine = x + fma(square * x, _polynomial(square, _SINE[precision]), rest)
    cosine = fma(square, fma(square, _polynomial(square, _COSINE[precision]), -0.5), 1.0)
    swapped = odd(quarters)
    rotated_sine, rotated_cosine = where(swapped, cosine, sine), where(swapped, sine, cosine)
    return (
        where(second_bit(quarters), -rotated_sine, rotated_sine),
        where(second_bit(quarters + 1.0), -rotated_cosine, rotated_cosine),
    )


def exponential(x: Value, precision: Precision) -> Value:
    """Exponential function to 1 ulp, underflowing gradually.

    Parameters
    ----------
    x : Value
        Up to 80; -inf gives 0.
    precision : Precision
        Type in which the arithmetic is done.
    """
    high, low = _LN_2[precision]
    x = maximum(x, _VANISHING[precision])
    doublings = nearest(x * (1.0 / high))
    x = fma(doublings, -low, fma(doublings, -high, x))
    mantissa = fma(x, fma(x, _polynomial(x, _EXPONENTIAL[precision]), 1.0), 1.0)
    normal = maximum(doublings, _LEAST_EXPONENT[precision])
    return mantissa * power_of_two(normal) * power_of_two(doublings - normal)


def damped_exponential(factor: Value, x: Value, precision: Precision) -> Value:
    """Product factor · exp(2 x) by halves, exactly 0 where exp(2 x) is.

    Parameters
    ----------
    factor : Value
        Any number, as long as its product with exp(2 x) is in range.
    x : Value
        Not above 0.
    precision : Precision
        Type in which the arithmetic is done.
    """
    # What is not taken is computed too, and must not be slow either.
    root = exponential(maximum(x, _HALF_VANISHING[precision]), precision)
    return where(x > _HALF_VANISHING[precision], root * (factor * root), 0.0)


def arctangent2(y: Value, x: Value, precision: Precision) -> Value:
    """Angle of the point (x, y) in the right half plane to 1.5 ulp (float32: 2), in radians from -pi/2 to pi/2.

    Parameters
    ----------
    y, x : Value
        Coordinates, x >= 0, not both 0, |y| + x without overflow.
    precision : Precision
        Type in which the arithmetic is done.
    """
    half_pi, half_pi_rest, _ = _HALF_PI[precision]
    # abs(x) is x, but lets the angle with y and x exchanged share all but the last two lines.
    larger, smaller = maximum(abs(y), abs(x)), minimum(abs(y), abs(x))
    # Angles above 1/2 are measured from pi/4: there the difference is exact, and no result has a finer last bit.
    diagonal = smaller > _TAN_HALF * larger
    tangent = where(diagonal, smaller - larger, smaller) / where(diagonal, smaller + larger, larger)
    square = tangent * tangent
    cube, bend = square * tangent, _polynomial(square, _ARCTANGENT[precision])
    beyond = 0.5 * half_pi + (tangent + fma(cube, bend, 0.5 * half_pi_rest))
    angle = where(diagonal, beyond, fma(cube, bend, tangent))
    angle = where(abs(y) > x, (half_pi - angle) + half_pi_rest, angle)
    return where(y < 0.0, -angle, angle)


def _polynomial(x: Value, coefficients: Sequence[float]) -> Value:
    # Two chains side by side for one more product; the first coefficient comes last and alone, to be rounded once.
    first, *others = coefficients
    square = x * x
    return fma(x, fma(x, _horner(square, others[1::2]), _horner(square, others[::2])), first)


def _horner(x: Value, coefficients: Sequence[float]) -> Value:
    *lower, value = coefficients
    result: Value = value
    for coefficient in reversed(lower):
        result = fma(result, x, coefficient)
    return result
