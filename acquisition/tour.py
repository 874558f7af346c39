"""A short way through all of a few places: the nearest next, then 2-opt and moves of short stretches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Seconds = NDArray[np.float64]
Order = NDArray[np.intp]

_LONGEST_STRETCH = 3
_NO_GAIN_S = 1e-9


def nearest_next(between_s: Seconds) -> Order:
    """From place 0 to whichever is nearest of those that are left, and so on; the order (N,) of all places.

    Parameters
    ----------
    between_s : ndarray
        Shape (N, N): duration of the way from each place to each.
    """
    left_s = between_s.copy()
    order = [0]
    for _ in range(len(between_s) - 1):
        left_s[:, order[-1]] = np.inf
        order.append(int(left_s[order[-1]].argmin()))
    return np.array(order)


def improved(order: Order, between_s: Seconds) -> Order:
    """An order with the same beginning and no longer a way, which neither reversing nor moving a stretch shortens.

    Every round takes the best of all reversals of a stretch (2-opt), or, when none gains, of all moves of up to three
    places to elsewhere (Or-opt); there are at most four rounds a place.

    Parameters
    ----------
    order : ndarray
        Shape (N,): where to begin; the first place stays the first.
    between_s : ndarray
        Shape (N, N), the same both ways but for those from the first place.
    """
    for _ in range(4 * len(order)):
        along_s = between_s[np.ix_(order, order)]
        better = _reversed_stretch(order, along_s)
        if better is None:
            better = _moved_stretch(order, along_s)
        if better is None:
            break
        order = better
    return order


def _reversed_stretch(order: Order, along_s: Seconds) -> Order | None:
    """The order with the stretch behind `first` up to `last` turned round; the way ends wherever it ends."""
    edges_s = np.append(np.diagonal(along_s, 1), 0.0)
    gains_s = edges_s[:-1, None] + edges_s[None, :] - along_s[:-1, :]
    gains_s[:, :-1] -= along_s[1:, 1:]
    gains_s[np.tri(len(gains_s), len(order), 1, dtype=bool)] = 0.0
    first, last = np.unravel_index(gains_s.argmax(), gains_s.shape)
    if not gains_s[first, last] > _NO_GAIN_S:
        return None
    return np.concatenate([order[: first + 1], order[first + 1 : last + 1][::-1], order[last + 1 :]])


def _moved_stretch(order: Order, along_s: Seconds) -> Order | None:
    """The order with a stretch taken out and put behind another place, as it was or turned round."""
    count = len(order)
    edges_s = np.append(np.diagonal(along_s, 1), 0.0)
    best_s, best = _NO_GAIN_S, None
    for length in range(1, min(_LONGEST_STRETCH, count - 2) + 1):
        firsts = np.arange(1, count - length + 1)
        lasts = firsts + length - 1
        closed_s = np.zeros(len(firsts))
        closed_s[:-1] = along_s[firsts[:-1] - 1, lasts[:-1] + 1]
        out_s = edges_s[firsts - 1] + edges_s[lasts] - closed_s
        for head, tail in ((firsts, lasts), (lasts, firsts)):
            in_s = along_s[:, head] - edges_s[:, None]  # behind each place
            in_s[:-1] += along_s[tail, 1:].T
            gains_s = out_s[None, :] - in_s
            behind = np.arange(count)[:, None]
            gains_s[(behind >= firsts - 1) & (behind <= lasts)] = 0.0
            place, number = np.unravel_index(gains_s.argmax(), gains_s.shape)
            if gains_s[place, number] > best_s:
                best_s = float(gains_s[place, number])
                best = int(place), int(firsts[number]), length, head is lasts
    if best is None:
        return None
    place, first, length, is_turned = best
    stretch, left = order[first : first + length], np.delete(order, slice(first, first + length))
    behind_place = place + 1 if place < first else place + 1 - length
    return np.insert(left, behind_place, stretch[::-1] if is_turned else stretch)
