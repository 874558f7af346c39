"""What looks wrong in a table of measured values, though it can be fitted: a person decides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from model.fit import Dataset
from model.fit.observable import Elements

_RADIANS = 1.6
"""No angle from the normal is larger, counted in radians."""
_WHOLE = 1e-6


def doubts(data: Dataset) -> tuple[str, ...]:
    """Say what looks wrong, a sentence or two each; nothing if nothing does."""
    return tuple(f"{data.name}: {doubt}" for doubt in (*_radians(data), *_twice(data), *_negative(data)))


def _radians(data: Dataset) -> Iterator[str]:
    degrees = np.degrees([data.incidence_rad, data.exit_rad])
    if degrees.max() < _RADIANS and (np.abs(degrees - np.round(degrees)) > _WHOLE).any():
        yield f"no angle is above {degrees.max():.3g}°. If these are radians, write them in degrees."


def _twice(data: Dataset) -> Iterator[str]:
    rows = np.column_stack([*data.directions, data.values])
    _, first, group, count = np.unique(rows, axis=0, return_index=True, return_inverse=True, return_counts=True)
    again = np.flatnonzero(count > 1)
    if len(again):
        chosen = again[np.argmin(first[again])]
        places = [data.place(int(row)) for row in np.flatnonzero(group.ravel() == chosen)]
        surplus = int((count[again] - 1).sum())
        yield (
            f"{' and '.join(places[:2])} are the same to the last digit, and so {surplus} of {len(data)} rows repeat "
            "another: do they count twice? Then errors are too small; take the copies out."
        )


def _negative(data: Dataset) -> Iterator[str]:
    if not (isinstance(data.observable, Elements) and data.observable.picked[0] == 0):
        return
    negative = np.flatnonzero(data.values[:, 0] < 0.0)
    if len(negative):
        yield (
            f"{data.observable.columns[0]} is below 0 in {len(negative)} of {len(data)} rows, the first of them "
            f"{data.place(int(negative[0]))}: light is not, though noise about 0 may be. Look whether too much dark "
            "signal was taken away."
        )
