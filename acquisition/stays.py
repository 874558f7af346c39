"""How to spend a stretch of time on a bench: where to stay, and for how many readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.design.design import Criterion, optimal_design
from model.design.information import standard_errors
from model.geometry import FloatArray

_NOTEWORTHY_SHARE = 0.01
_NEIGHBOURS = 2
_TOLERANCE = 1e-3
_HALVINGS = 7


@dataclass(frozen=True, eq=False)
class Prospect:
    """What readings would tell, and what they would cost, from where the bench stands.

    Attributes
    ----------
    known : ndarray
        Shape (P, P): information that there is.
    pieces : ndarray
        Shape (N, P, P): what one reading in every slot adds, in each of N directions, neighbours beside each other.
    visit_s : ndarray
        Shape (N,): how long it takes to get to each direction, and round the analyzer's slots.
    reading_s : float
        How long one reading in every slot takes.
    """

    known: FloatArray
    pieces: FloatArray
    visit_s: FloatArray
    reading_s: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Stays at some directions, given by their places, with so many readings in every slot each.

    `stderr`, shape (P,), are the standard errors that there will be afterwards; `volume` is that of their joint
    confidence region: the logarithm of its square, but for a constant.
    """

    places: tuple[int, ...]
    readings: FloatArray
    stderr: FloatArray
    volume: float


def plan(prospect: Prospect, parameter: int | None, time_s: float) -> Plan | None:
    """The stays after which a parameter, or all alike, will be known best; None if the time is too short for any.

    The optimal design for readings that cost time, and visits that cost none, says which directions count. Those that
    do not pay for their visits are then dropped, one after the other, or all but one at once.

    Parameters
    ----------
    prospect : Prospect
        What readings tell and cost.
    parameter : int or None
        Place of the parameter; None for all, by the volume of their joint confidence region.
    time_s : float
        The time to plan.

    Raises
    ------
    FitError
        If all directions together do not determine the parameters.
    """
    places = important = _peaks(_shares(prospect, range(len(prospect.pieces)), parameter, time_s))
    best = _shared(prospect, places, parameter, time_s)
    while len(places) > 1:
        fewer = [places[:drop] + places[drop + 1 :] for drop in range(len(places))]
        plans = [_shared(prospect, others, parameter, time_s) for others in fewer]
        # where none fits into the time, the least important, which is the last, goes
        drop = min(range(len(plans)), key=lambda number: (_uncertainty(plans[number], parameter), -number))
        if _uncertainty(plans[drop], parameter) > _uncertainty(best, parameter):
            break
        places, best = fewer[drop], plans[drop]
    single = (_shared(prospect, [place], parameter, time_s) for place in important)
    return min([best, *single], key=lambda stays: _uncertainty(stays, parameter))


def _shared(prospect: Prospect, places: list[int], parameter: int | None, time_s: float) -> Plan | None:
    """The time shared best among these places; None if it is too short, or does not determine all parameters."""
    left_s = time_s - float(prospect.visit_s[places].sum())
    if left_s <= 0.0:
        return None
    readings = _shares(prospect, places, parameter, left_s) * left_s / prospect.reading_s
    told = prospect.known + np.einsum("n,npq->pq", readings, prospect.pieces[places])
    stderr = standard_errors(told)
    if not np.isfinite(stderr).all():
        return None
    return Plan(tuple(places), readings, stderr, -float(np.linalg.slogdet(told)[1]))


def _uncertainty(stays: Plan | None, parameter: int | None) -> float:
    if stays is None:
        return np.inf
    return stays.volume if parameter is None else float(stays.stderr[parameter])


def time_needed_s(prospect: Prospect, parameter: int, wanted: float, most_s: float) -> float:
    """The time after whose best use a parameter's standard error is the one wanted; `most_s` if that is longer."""

    def is_enough(time_s: float) -> bool:
        stays = plan(prospect, parameter, time_s)
        return stays is not None and bool(stays.stderr[parameter] <= wanted)

    if not is_enough(most_s):
        return most_s
    low_s, high_s = min(float(prospect.visit_s.min()), most_s), most_s
    for _ in range(_HALVINGS):
        middle_s = float(np.sqrt(low_s * high_s))
        low_s, high_s = (low_s, middle_s) if is_enough(middle_s) else (middle_s, high_s)
    return high_s


def criterion(prospect: Prospect, parameter: int | None) -> Criterion:
    """How uncertain a parameter, or all alike, are."""
    return Criterion(None if parameter is None else np.eye(len(prospect.known))[parameter])


def _shares(prospect: Prospect, places: range | list[int], parameter: int | None, time_s: float) -> FloatArray:
    if len(places) == 1:
        return np.ones(1)
    pieces = prospect.pieces[list(places)] * (time_s / prospect.reading_s)
    aim = criterion(prospect, parameter)
    return optimal_design(pieces[None], aim, prospect.known, tolerance=_TOLERANCE).shares


def _peaks(shares: FloatArray) -> list[int]:
    """The places with noteworthy shares, of neighbours the one with the largest, in the order of their shares."""
    peaks: list[int] = []
    last = -np.inf
    for place in np.flatnonzero(shares > _NOTEWORTHY_SHARE).tolist():
        if place - last > _NEIGHBOURS:
            peaks.append(place)
        elif shares[place] > shares[peaks[-1]]:
            peaks[-1] = place
        last = place
    return sorted(peaks, key=lambda place: -float(shares[place]))
