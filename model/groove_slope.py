"""Which groove sends light from i to r in a given number of bounces: its slope and opening angle.

With κ = pi/2 - α, the angle of a wall against the vertical, the condition n1·α1 + n2·α2 = Θ reads n1·κ1 + n2·κ2 = c,
where c = pi/2 - H for odd and pi/2 - |D| for even numbers of bounces on one side of the groove, and pi less that on
the other. Since tan κ2/tan κ1 = (1 ± a)/(1 ∓ a), the walls' difference δ = κ2 - κ1 obeys sin δ = ±a sin γ with
γ = κ1 + κ2 the opening, so that

    k γ = 2 c (even k),    k γ - asin(±a sin γ) = 2 c (odd k):

closed for even k and for a = 0, otherwise an equation of Kepler's kind whose slope stays between k - 1 and k + 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.geometry import FloatArray

_LARGEST_STEPS = 6
# A step this small, on top of a function whose slope is at least 2, is rounding.
_SETTLED = 4.0 * np.finfo(np.float64).eps


@dataclass(frozen=True)
class Side:
    """The grooves whose first wall is on one side of i: their total angle c to the verticals, and its complement.

    Attributes
    ----------
    total : ndarray
        c in radians, above 0 and below pi.
    signed : ndarray
        pi/2 - c.
    near : ndarray
        The smaller of c and pi - c, to full relative precision.
    steep : bool
        Whether c is at most pi/2.
    """

    total: FloatArray
    signed: FloatArray
    near: FloatArray
    steep: bool


@dataclass(frozen=True)
class Grooves:
    """The grooves found, one for every pair of directions.

    Attributes
    ----------
    slope : ndarray
        Mean slope t.
    first, second : ndarray
        Slopes of the two walls, the first being the one that is met first.
    relative_first, relative_second : float
        The same over t: 1 ± a and 1 ∓ a.
    """

    slope: FloatArray
    first: FloatArray
    second: FloatArray
    relative_first: float
    relative_second: float


def sides(half_angle: FloatArray, complement: FloatArray) -> tuple[Side, Side]:
    """Both sides of the groove, the one of steeper grooves first.

    Parameters
    ----------
    half_angle, complement : ndarray
        H for odd, |D| for even numbers of bounces, and pi/2 less it, both to full relative precision.
    """
    return (
        Side(total=complement, signed=half_angle, near=complement, steep=True),
        Side(total=np.pi - complement, signed=-half_angle, near=complement, steep=False),
    )


def solve(bounces: int, side: Side, skew: float) -> Grooves:
    """Find the groove for two bounces or more.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 2.
    side : Side
        From `sides`.
    skew : float
        +a where the first wall is the steeper one, -a where it is the flatter one.

    Raises
    ------
    ArithmeticError
        If the opening angle did not settle; the bounds on the equation's slope rule this out.
    """
    if bounces == 2:
        # γ = pi/2 -+ |D|: near pi the sine, near pi/2 the cosine has more digits than γ.
        sin, cos = np.sin(side.near), np.sin(side.signed)
    else:
        opening = 2.0 * side.total / bounces
        if bounces % 2 and skew:
            opening = _kepler(bounces, opening, skew)
        sin, cos = np.sin(opening), np.cos(opening)
    slope = slope_of_opening(sin, cos, skew)
    first, second = 1.0 + skew, 1.0 - skew
    return Grooves(slope, first * slope, second * slope, first, second)


def slope_of_opening(sin: FloatArray, cos: FloatArray, asymmetry: float) -> FloatArray:
    """Mean slope t of the groove with opening γ: the root of (1 - a²) t² sin γ - 2 t cos γ - sin γ = 0.

    Parameters
    ----------
    sin, cos : ndarray
        Of the opening γ, between 0 and pi.
    asymmetry : float
        a, of either sign.
    """
    both = (1.0 - asymmetry) * (1.0 + asymmetry)
    root = np.hypot(cos, np.sqrt(both) * sin) + np.abs(cos)
    # The two forms of the root of a quadratic: each adds numbers of one sign.
    slope: FloatArray = np.where(cos >= 0.0, root, sin) / np.where(cos >= 0.0, both * sin, root)
    return slope


def _kepler(bounces: int, start: FloatArray, skew: float) -> FloatArray:
    # The slope stays between k - a and k + a: no step can leave the root further away than it was.
    opening = start
    both = np.sqrt((1.0 - skew) * (1.0 + skew))
    for _ in range(_LARGEST_STEPS):
        sin, cos = np.sin(opening), np.cos(opening)
        cos_delta = np.hypot(cos, both * sin)
        excess = bounces * (opening - start) - np.arctan2(skew * sin, cos_delta)
        step = excess / (bounces - skew * cos / cos_delta)
        opening = opening - step
        if np.all(np.abs(step) <= _SETTLED * opening):
            return np.asarray(opening)
    raise ArithmeticError(
        f"The opening angle of the groove for {bounces} bounces and asymmetry {abs(skew):g} did not settle within "
        f"{_LARGEST_STEPS} Newton steps. Nothing was computed; please report these numbers."
    )
