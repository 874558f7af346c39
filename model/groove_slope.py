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

from model.kernel.expression import Value, atan2, cos, guarded, sin, sqrt, where

# Steps of fourth order: so many for all, so many more where the last one still moved by more than this.
_STEPS, _MORE_STEPS = 2, 4
_SETTLED = 1e-4
_SERIES = 0.25


@dataclass(frozen=True)
class Side:
    """The grooves whose first wall is on one side of i: their total angle c to the verticals, and its complement.

    Attributes
    ----------
    total : Value
        c in radians, above 0 and below pi.
    signed : Value
        pi/2 - c.
    near : Value
        The smaller of c and pi - c, to full relative precision.
    steep : bool
        Whether c is at most pi/2.
    """

    total: Value
    signed: Value
    near: Value
    steep: bool


@dataclass(frozen=True)
class Grooves:
    """The groove found for a pair of directions.

    Attributes
    ----------
    slope : Value
        Mean slope t.
    first, second : Value
        Slopes of the two walls, the first being the one that is met first.
    relative_first, relative_second : Value
        The same over t: 1 ± a and 1 ∓ a.
    """

    slope: Value
    first: Value
    second: Value
    relative_first: Value
    relative_second: Value

    @property
    def symmetric(self) -> bool:
        """Whether both walls are known to be alike."""
        return _is_symmetric(self.relative_first - self.relative_second)


def sides(half_angle: Value, complement: Value) -> tuple[Side, Side]:
    """Both sides of the groove, the one of steeper grooves first.

    Parameters
    ----------
    half_angle, complement : Value
        H for odd, |D| for even numbers of bounces, and pi/2 less it, both to full relative precision.
    """
    return (
        Side(total=complement, signed=half_angle, near=complement, steep=True),
        Side(total=math.pi - complement, signed=-half_angle, near=complement, steep=False),
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
        # γ = pi/2 -+ |D|: near pi the sine, near pi/2 the cosine has more digits than γ.
        sine, cosine = sin(side.near), sin(side.signed)
    else:
        opening = side.total * (2.0 / bounces)
        if bounces % 2 and not _is_symmetric(skew):
            opening = _kepler(bounces, opening, skew)
        sine, cosine = sin(opening), cos(opening)
    slope = slope_of_opening(sine, cosine, skew)
    first, second = 1.0 + skew, 1.0 - skew
    return Grooves(slope, first * slope, second * slope, first, second)


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
    length: Value = 1.0 if _is_symmetric(asymmetry) else sqrt(cosine * cosine + both * (sine * sine))
    root = length + abs(cosine)
    # The two forms of the root of a quadratic: each adds numbers of one sign.
    return where(cosine >= 0.0, root, sine) / where(cosine >= 0.0, both * sine, root)


def _is_symmetric(skew: Value) -> bool:
    return isinstance(skew, float) and skew == 0.0


def _kepler(bounces: int, start: Value, skew: Value) -> Value:
    # The slope stays between k - a and k + a, so that a step cannot leave the root further away than it was.
    opening = start
    for _ in range(_STEPS):
        step, unsettled = _step(bounces, opening, start, skew)
        opening = opening - step
    return opening - guarded(unsettled, _more_steps(bounces, opening, start, skew))


def _more_steps(bounces: int, opening: Value, start: Value, skew: Value) -> Value:
    total: Value = 0.0
    for _ in range(_MORE_STEPS):
        total = total + _step(bounces, opening - total, start, skew)[0]
    return total


def _step(bounces: int, opening: Value, start: Value, skew: Value) -> tuple[Value, Value]:
    # Newton's step h, improved to fourth order by the inverse series of the equation, h + A h² + (2 A² - B) h³.
    sine, cosine = sin(opening), cos(opening)
    tilted, both = skew * sine, (1.0 - skew) * (1.0 + skew)
    cos_delta = sqrt(cosine * cosine + both * (sine * sine))
    inverse = 1.0 / cos_delta
    bend = both * inverse * inverse * tilted * inverse
    slope = 1.0 / (bounces - skew * cosine * inverse)
    newton = (bounces * (opening - start) - atan2(tilted, cos_delta)) * slope
    second = 0.5 * bend * slope
    third = both * skew * cosine * (1.0 + 2.0 * tilted * tilted) * inverse * (inverse * inverse) * (inverse * inverse)
    improved = newton * (1.0 + newton * (second + newton * (2.0 * second * second - third * slope * (1.0 / 6.0))))
    # Where grooves are all but one-sided the equation has a kink, across which the series means nothing.
    size = abs(newton) * (1.0 + abs(second))
    return where(size < _SERIES, improved, newton), size > _SETTLED
