"""From which value to which the colours of a map go, and what lies beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TAILS_PERCENT = 0.5
_TAIL_MARGIN = 0.25
_LOGARITHMIC_FROM = 30.0


@dataclass(frozen=True)
class Limits:
    """The values at the ends of a colour map, and how many pixels lie beyond."""

    low: float
    high: float
    below: int = 0
    above: int = 0
    is_logarithmic: bool = False

    @property
    def remark(self) -> str:
        """What the colours do not tell; empty when they tell all."""
        beyond = ((self.below, "below"), (self.above, "above"))
        counts = ", ".join(f"{count} {where}" for count, where in beyond if count)
        return f"pixels beyond the colours: {counts}" if counts else ""

    @property
    def extend(self) -> str:
        """At which ends the colour bar goes on."""
        return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[self.below > 0, self.above > 0]


HALF_TURN = Limits(-90.0, 90.0)
"""Of angles of polarization."""


def limits(
    values: NDArray[np.floating], *, may_be_logarithmic: bool = False, tails_percent: float = TAILS_PERCENT
) -> Limits:
    """From the lowest to the highest value, but for a few far beyond all others, which would leave these one colour.

    The ends reach at most a quarter of the range of the middle 99 % (what lies between both tails) beyond it. Values
    over more than a factor of 30 are shown logarithmically where that may be; what is not positive is then below the
    colours.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return Limits(0.0, 1.0)
    positive = known[known > 0.0]
    low, high = (float(end) for end in np.percentile(known, (tails_percent, 100.0 - tails_percent)))
    logarithmic = may_be_logarithmic and positive.size > 0 and high > _LOGARITHMIC_FROM * max(low, 0.0)
    if logarithmic:
        low, high = (float(end) for end in np.percentile(positive, (tails_percent, 100.0 - tails_percent)))
        reach = (high / low) ** _TAIL_MARGIN
        low, high = max(low / reach, float(positive.min())), min(high * reach, float(known.max()))
    else:
        reach = _TAIL_MARGIN * (high - low)
        low, high = max(low - reach, float(known.min())), min(high + reach, float(known.max()))
    below, above = int(np.count_nonzero(known < low)), int(np.count_nonzero(known > high))
    if not high > low:
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    return Limits(low, high, below, above, logarithmic)
