"""Fits while the scan runs, in its own thread, and never holds the scan up: the newest state wins."""

from __future__ import annotations

import operator
import threading
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from acquisition.events import FitRefused, FitUpdated
from acquisition.fit_points import FitArguments, dataset, named_in_degrees
from acquisition.readings import StokesPoint
from goniometer.errors import FitError
from model.fit import Dataset, FitResult, SurfaceFamily, fit, follow

_POOR_FIT = 3.0
"""Chi-square per degree of freedom above which a warm start is not trusted and the search begins anew."""


class LiveFit:
    """Refits after every point from the last optimum; states that come while a fit runs replace each other.

    Parameters
    ----------
    family : SurfaceFamily
        What is fitted.
    how : FitArguments
        How it is fitted; a search is made when there is no last optimum, or it fits poorly.
    """

    def __init__(self, family: SurfaceFamily, how: FitArguments) -> None:
        self._family, self._how = family, how
        self._condition = threading.Condition()
        self._submitted: Sequence[StokesPoint] | None = None
        self._news: FitUpdated | FitRefused | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._work, name="live fit", daemon=True)

    def submit(self, points: Sequence[StokesPoint]) -> None:
        """Hand over all points so far; returns at once. A state not yet begun is dropped.

        Points may be added to the same list afterwards, but none be taken out.
        """
        with self._condition:
            self._submitted = points
            self._condition.notify()

    def news(self) -> FitUpdated | FitRefused | None:
        """What the thread has found since it was last asked."""
        with self._condition:
            news, self._news = self._news, None
            return news

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._condition:
            self._ended, self._news = True, None
            self._condition.notify()
        self._thread.join()

    def _work(self) -> None:
        last: FitResult | None = None
        collected = _Collected()
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._ended or self._submitted is not None)
                if self._ended:
                    return
                submitted, self._submitted = self._submitted, None
            assert submitted is not None, "the wait ends only with points or with the end"
            points = tuple(submitted)  # a scan adds to its own while this thread works
            try:
                last = self._fit(collected.data(points), last)
                news: FitUpdated | FitRefused = FitUpdated(len(points), last)
            except FitError as error:
                news = FitRefused(len(points), str(error))
            except Exception as error:  # noqa: BLE001 (a fault of the fit must not cost the scan its readings)
                news = FitRefused(len(points), f"the live fit has stopped: {type(error).__name__}: {error}")
            with self._condition:
                self._news = None if self._ended else news

    def _fit(self, data: Dataset, last: FitResult | None) -> FitResult:
        if last is not None:
            how = self._how
            result = follow(data, self._family, last, objective=how["objective"], robust=how["robust"])
            if result.chi_square <= _POOR_FIT * max(result.degrees_of_freedom, 1):
                return result
        with named_in_degrees():
            return fit(data, self._family, **self._how)


class _Collected:
    """The points so far as data; of points that were there before nothing is done again."""

    def __init__(self) -> None:
        self._points: Sequence[StokesPoint] = ()
        self._data: Dataset | None = None

    def data(self, points: Sequence[StokesPoint]) -> Dataset:
        known = len(self._points)
        grown = len(points) >= known and all(map(operator.is_, self._points, points))
        if self._data is None or not grown:
            self._data = dataset(points)
        elif len(points) > known:
            self._data = self._data.joined(dataset(points[known:]))
        self._points = points
        return self._data
