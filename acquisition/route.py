"""In which order the bench comes by the directions: along lines, or a short way through all of a list.

Sweeps go forth and back along a route, so what counts is the mean of both ways; axes move at the same time, and the
slowest counts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from acquisition.steps import HOME
from acquisition.tour import improved, nearest_next
from acquisition.ways import Angles, Ways

Order = NDArray[np.intp]

MOST_SEARCHED = 300
"""Directions up to which a list that is no grid is searched for a short way."""

_MOST_THOROUGH = 20_000
"""Directions up to which lists that are no grid are parted into strips of several widths."""

_HOME_DEG = np.array(list(HOME.axes_deg.values()))
_EXIT = 1


def routes(angles_deg: Angles, ways: Ways) -> list[Order]:
    """Orders of directions worth comparing; the first is the one to take where all take as long.

    Parameters
    ----------
    angles_deg : ndarray
        Shape (N, 4): the directions as they are listed.
    ways : Ways
        How long it takes from one to another.
    """
    listed = np.arange(len(angles_deg))
    varying = [axis for axis in range(angles_deg.shape[1]) if np.ptp(angles_deg[:, axis]) > 0.0]
    if len(varying) < 2:
        along = angles_deg[:, varying[0] if varying else _EXIT]
        found = [_upwards_or_downwards(along)]
    else:
        ranks = np.stack([np.unique(angles_deg[:, axis], return_inverse=True)[1].ravel() for axis in varying], axis=1)
        is_grid = _is_grid(ranks)
        lines = min(_lines(ranks, is_grid=is_grid), key=lambda order: path_s(order, angles_deg, ways))
        found = [min(lines, lines[::-1], key=lambda order: path_s(order, angles_deg, ways))]
        if len(angles_deg) <= MOST_SEARCHED and not is_grid:
            found.insert(0, _searched(found[0], angles_deg, ways))
    found.append(listed)
    different = [order for place, order in enumerate(found) if not any(_same(order, known) for known in found[:place])]
    if len(listed) > MOST_SEARCHED:
        return [min(different, key=lambda order: path_s(order, angles_deg, ways))]
    return different


def path_s(order: Order, angles_deg: Angles, ways: Ways) -> float:
    """How long it takes from home through all directions, the mean of both ways between them."""
    places_deg = angles_deg[order]
    onward_s = (ways.along_s(places_deg).sum() + ways.along_s(places_deg[::-1]).sum()) / 2.0
    return float(ways.along_s(np.stack([_HOME_DEG, places_deg[0]]))[0] + onward_s)


def _upwards_or_downwards(along_deg: NDArray[np.float64]) -> Order:
    """By the angle, upwards or downwards as the list begins and ends."""
    order = np.argsort(along_deg, kind="stable")
    return order if along_deg[0] <= along_deg[-1] else order[::-1]


def _lines(ranks: Order, *, is_grid: bool) -> Iterator[Order]:
    """Lines of one axis, forth and back, with every order of the axes from the outermost to the innermost.

    `ranks` (N, K) say which of its axis' angles each direction has. Where the directions are no grid, hardly two are on
    a line: then they are also taken strip by strip.
    """
    count, axes = ranks.shape
    even = round(count ** (1.0 / axes))
    strips = [0]
    if not is_grid:
        strips += [even] if count > _MOST_THOROUGH else [max(even // 2, 1), even, 2 * even]
    for most in strips:
        for nesting in itertools.permutations(range(axes)):
            keys = ranks[:, nesting]
            if most:
                angles = keys[:, :-1].max(axis=0) + 1
                keys[:, :-1] = np.where(angles > most, keys[:, :-1] * most // angles, keys[:, :-1])
            yield _forth_and_back(keys)


def _forth_and_back(keys: NDArray[np.intp]) -> Order:
    """Sorted by the columns of keys (N, K), of which each but the first turns round from one line to the next."""
    line = np.unique(keys[:, 0], return_inverse=True)[1].ravel()
    for column in keys[:, 1:].T:
        turned = np.where(line % 2, column.max() - column, column)
        line = np.unique(line * (int(column.max()) + 1) + turned, return_inverse=True)[1].ravel()
    return np.argsort(line, kind="stable")


def _is_grid(ranks: Order) -> bool:
    """Whether every combination of the angles is there, each as often."""
    shape = tuple((ranks.max(axis=0) + 1).tolist())
    if math.prod(shape) > len(ranks):
        return False
    times = np.bincount(np.ravel_multi_index(tuple(ranks.T), shape), minlength=math.prod(shape))
    return bool((times == times[0]).all())


def _searched(lines: Order, angles_deg: Angles, ways: Ways) -> Order:
    """The best of what nearest neighbours and the lines are improved to, from home."""
    between_s = ways.between_s(np.concatenate([[_HOME_DEG], angles_deg]))
    both_s = (between_s + between_s.T) / 2.0
    both_s[0] = between_s[0]
    begun = nearest_next(both_s), np.concatenate([[0], lines + 1])
    orders = [improved(order, both_s)[1:] - 1 for order in begun]
    return min(orders, key=lambda order: path_s(order, angles_deg, ways))


def _same(one: Order, other: Order) -> bool:
    return bool(np.array_equal(one, other))
