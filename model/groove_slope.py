"""Which groove sends light from i to r in a given number of bounces: its slope and opening angle.

With κ = pi/2 - α, the angle of a wall against the vertical, the condition n1·α1 + n2·α2 = Θ reads n1·κ1 + n2·κ2 = c,
where c = pi/2 - H for odd and pi/2 - |D| for even numbers of bounces on one side of the groove, and pi less that on
the other. Since tan κ2/tan κ1 = (1 ± a)/(1 ∓ a), the walls' difference δ = κ2 - κ1 obeys sin δ = ±a sin γ with
γ = κ1 + κ2 the opening, so that

    k γ = 2 c (even k),    k γ - asin(±a sin γ) = 2 c (odd k):

closed for even k and for a = 0, otherwise an equation of Kepler's kind whose slope stays between k - 1 and k + 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from model.groove_plane import Angle
from model.kernel.expression import Value, atan2, cos, guarded, sin, sqrt, where

# Two steps of fourth order for all, so many more where the second one still moved by more than this.
_MORE_STEPS = 4
_SETTLED = 1e-4
_SERIES = 0.25


@dataclass(frozen=True)
class Side:
    """The grooves whose first wall is on one side of i: their total angle c to the verticals.

    Attributes
    ----------
    total : Value
        c in radians, above 0 and below pi.
    sin, cos : Value
        Of c, to full relative precision.
    steep : bool
        Whether c is at most pi/2.
    """

    total: Value
    sin: Value
    cos: Value
    steep: bool


@dataclass(frozen=True)
class Grooves:
    """The groove found for a pair of directions.

    Attributes
    ----------
    sin_half, cos_half : Value
        Sine and cosine of γ/2, half the opening.
    slope : Value
        Mean slope t.
    first, second : Value
        Slopes of the two walls, the first being the one that is met first.
    relative_first, relative_second : Value
        The same over t: 1 ± a and 1 ∓ a.
    """

    sin_half: Value
    cos_half: Value
    slope: Value
    first: Value
    second: Value
    relative_first: Value
    relative_second: Value

    @property
    def symmetric(self) -> bool:
        """Whether both walls are known to be alike."""
        return _is_symmetric(self.relative_first - self.relative_second)


def sides(lean: Angle) -> tuple[Side, Side]:
    """Both sides of the groove, the one of steeper grooves first.

    Parameters
    ----------
    lean : Angle
        H for odd, |D| for even numbers of bounces.
    """
    return (
        Side(total=lean.complement, sin=lean.cos, cos=lean.sin, steep=True),
        Side(total=math.pi - lean.complement, sin=lean.cos, cos=-lean.sin, steep=False),
    )


def solve(bounces: int, side: Side, skew: Value) -> Grooves:
    """Find the groove for two bounces or more.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 2.
    side : Side
        From `sides`.
    skew : Value
        +a where the first wall is the steeper one, -a where it is the flatter one, the number 0 in symmetric grooves.
    """
    if bounces == 2:
        # γ is c, of which sine and cosine have more digits near pi and pi/2 than c itself.
        larger = sqrt((1.0 + abs(side.cos)) * 0.5)
        smaller = side.sin / (2.0 * larger)
        sin_half, cos_half = (smaller, larger) if side.steep else (larger, smaller)
        sine, cosine = side.sin, side.cos
    else:
        half_opening = side.total * (1.0 / bounces)
        if bounces % 2 and not _is_symmetric(skew):
            half_opening = _kepler(bounces, 2.0 * half_opening, skew) * 0.5
        sin_half, cos_half = sin(half_opening), cos(half_opening)
        sine, cosine = 2.0 * sin_half * cos_half, (cos_half - sin_half) * (cos_half + sin_half)
    symmetric = _is_symmetric(skew)
    slope = cos_half / sin_half if symmetric else slope_of_opening(sine, cosine, skew)
    first, second = 1.0 + skew, 1.0 - skew
    return Grooves(sin_half, cos_half, slope, first * slope, second * slope, first, second)


def slope_of_opening(sine: Value, cosine: Value, asymmetry: Value) -> Value:
    """Mean slope t of the groove with opening γ: the root of (1 - a²) t² sin γ - 2 t cos γ - sin γ = 0.

    Parameters
    ----------
    sine, cosine : Value
        Of the opening γ, between 0 and pi.
    asymmetry : Value
        a, of either sign.
    """
    both = (1.0 - asymmetry) * (1.0 + asymmetry)
    root = sqrt(cosine * cosine + both * (sine * sine)) + abs(cosine)
    # The two forms of the root of a quadratic: each adds numbers of one sign.
    return where(cosine >= 0.0, root, sine) / where(cosine >= 0.0, both * sine, root)


def _is_symmetric(skew: Value) -> bool:
    return isinstance(skew, float) and skew == 0.0


def _kepler(bounces: int, start: Value, skew: Value) -> Value:
    # The slope stays between k - a and k + a, so that a step cannot leave the root further away than it was.
    opening = start - _first_step(bounces, start, skew)
    step, unsettled = _step(bounces, opening, start, skew)
    opening = opening - step
    return opening - guarded(unsettled, _more_steps(bounces, opening, start, skew))


def _more_steps(bounces: int, opening: Value, start: Value, skew: Value) -> Value:
    total: Value = 0.0
    for _ in range(_MORE_STEPS):
        total = total + _step(bounces, opening - total, start, skew)[0]
    return total


def _first_step(bounces: int, start: Value, skew: Value) -> Value:
    # asin x and 1/sqrt(1 - x²) as series in x = a sin γ: enough to begin with, even where they hardly converge.
    x = skew * sin(start)
    x2 = x * x
    delta = x * (1.0 + x2 * (1 / 6 + x2 * (3 / 40 + x2 * (15 / 336 + x2 * (105 / 3456)))))
    inverse = 1.0 + x2 * (1 / 2 + x2 * (3 / 8 + x2 * (5 / 16 + x2 * (35 / 128))))
    return _improved(bounces, -delta, x, skew * cos(start), inverse, skew)[0]


def _step(bounces: int, opening: Value, start: Value, skew: Value) -> tuple[Value, Value]:
    x, tilted = skew * sin(opening), cos(opening)
    cos_delta = sqrt(tilted * tilted + (1.0 - skew) * (1.0 + skew) * (sin(opening) * sin(opening)))
    excess = bounces * (opening - start) - atan2(x, cos_delta)
    step, size = _improved(bounces, excess, x, skew * tilted, 1.0 / cos_delta, skew)
    return step, size > _SETTLED


def _improved(
    bounces: int, excess: Value, a_sin: Value, a_cos: Value, inverse: Value, skew: Value
) -> tuple[Value, Value]:
    # Newton's step h, improved to fourth order by the inverse series of the equation, h + A h² + (2 A² - B) h³.
    slope = 1.0 / (bounces - a_cos * inverse)
    newton = excess * slope
    bend = (1.0 - skew) * (1.0 + skew) * (inverse * inverse) * inverse
    second = 0.5 * bend * a_sin * slope
    third = (1.0 / 6.0) * bend * a_cos * (1.0 + 2.0 * a_sin * a_sin) * (inverse * inverse) * slope
    improved = newton * (1.0 + newton * (second + newton * (2.0 * second * second - third)))
    # Where grooves are all but one-sided the equation has a kink, across which the series means nothing.
    size = abs(newton) * (1.0 + abs(second))
    return where(size < _SERIES, improved, newton), size
