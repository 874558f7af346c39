"""What a scan shows in a terminal, in a log file or to another program."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Literal, Self, TextIO

from acquisition.events import (
    Control,
    DirectionChosen,
    Event,
    FitRefused,
    FitUpdated,
    LinkRestored,
    NotReached,
    PointReduced,
    ScanStarted,
    Subscriber,
    WavelengthChanged,
)
from acquisition.readings import StokesPoint
from goniometer.durations import clock_text
from goniometer.fitting.summary import fit_summary, parameter_rows
from goniometer.lasting_stream import LastingStream
from goniometer.live_console import LiveConsole
from goniometer.plain_json import plain
from goniometer.plus_minus import plus_minus
from goniometer.scan_so_far import ScanSoFar, in_plane
from goniometer.spectrum import spectrum_text

Mode = Literal["auto", "plain", "quiet", "json"]

_FIT_LINES, _USUAL_POINTS = 10, 50
"""About how many lines a whole scan's live fit gets among the lines of its points, of which there may be about so many.
"""


@contextmanager
def console_for(mode: Mode, stream: TextIO | None, keys: str = "") -> Iterator[Subscriber]:
    """Show a scan on a stream while the block runs.

    The subscriber never raises because of the stream: whoever stops reading misses the rest, the scan goes on.

    Parameters
    ----------
    mode : "auto", "plain", "quiet" or "json"
        auto: a live view in a terminal, plain lines elsewhere; plain: one line a point; quiet: nothing; json: one event
        a line.
    stream : text stream
        Where to show it, usually the standard output.
    keys : str
        What a person is told of the keys that control the scan.

    Yields
    ------
    callable
        The subscriber to give to the scan.
    """
    lasting = LastingStream(stream)
    if mode == "quiet":
        yield _ignore
    elif mode == "json":
        yield JsonConsole(lasting)
    elif mode == "auto" and lasting.isatty() and os.environ.get("TERM") != "dumb":
        with LiveConsole(lasting, keys=keys) as live:
            yield live
    else:
        with PlainConsole(lasting) as plain:
            yield plain


def _ignore(event: Event) -> None:
    """Show nothing."""


class PlainConsole:
    """A line a point, a line of the live fit now and then, and a summary at the end; no escape codes.

    Parameters
    ----------
    stream : LastingStream
        Where the lines go.
    """

    def __init__(self, stream: LastingStream) -> None:
        self._stream = stream
        self._scan = ScanSoFar(time.monotonic)
        self._points_at_fit_line = 0

    def __call__(self, event: Event) -> None:
        """Take an event in and say what is worth a line."""
        self._scan(event)
        match event:
            case ScanStarted():
                about = (
                    f"{event.points} points, {event.readings} readings, about {clock_text(event.expected_duration_s)}"
                )
                self._say(f"{event.recipe}: {event.aim or about} on the bench's clock, into {event.run}")
                for note in event.notes:
                    self._say(f"  note: {note}")
            case LinkRestored() | Control():
                self._say(f"  note: {event}")
            case PointReduced():
                self._say(self._point(event.stokes_point))
            case WavelengthChanged():
                self._say(f"  at {event.wavelength_nm:g} nm:")
                self._points_at_fit_line = 0
            case NotReached():
                self._say(f"  note: not reached: {event.what}")
            case FitUpdated() if self._is_fit_line_due(event.points):
                self._points_at_fit_line = event.points
                rows = parameter_rows(event.result, {})
                values = (f"{row.name} {row.value} {f'± {row.error}' if row.error else row.note}" for row in rows)
                self._say(f"  fit to {event.points} points: {', '.join(values)}")
            case FitRefused() if self._is_fit_line_due(event.points):
                self._points_at_fit_line = event.points
                self._say(f"  no fit to {event.points} points: {event.reason}")
            case DirectionChosen() if event.why:
                standing = f" ({event.standing})" if event.standing else ""
                self._say(
                    f"  next exit {event.exit_deg:z.2f}°, {event.readings} readings a slot: {event.why}{standing}"
                )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        started, fit = self._scan.started, self._scan.fit
        if started is None:
            return
        self._say(f"\n{self._scan.ending()}")
        if self._scan.spectrum is not None:
            self._say(f"\n{spectrum_text(self._scan.spectrum)}\n")
        elif fit is not None:
            self._say(f"\n{fit_summary(fit.result, started.truth)}\n")

    def _is_fit_line_due(self, points: int) -> bool:
        total = (self._scan.started and self._scan.started.points) or _USUAL_POINTS
        return points >= self._points_at_fit_line + max(total // _FIT_LINES, 1)

    def _point(self, point: StokesPoint) -> str:
        total = self._scan.started and self._scan.started.points
        width, of_all = len(str(total or _USUAL_POINTS)), f" of {total}" if total else ""
        started = self._scan.started
        place = f"{in_plane(point)}  " if started is not None and started.has_planes else ""
        return (
            f"{self._scan.points:>{width}}{of_all}  {place}exit {point.exit_deg:z7.2f}°  "
            f"S0 {plus_minus(point.stokes[0], math.sqrt(point.covariance[0, 0])):<19} /sr  "
            f"DoLP {plus_minus(point.dolp, point.dolp_stderr):<17}  "
            f"AoLP {plus_minus(point.aolp_deg, point.aolp_stderr_deg)}°"
        )

    def _say(self, line: str) -> None:
        self._stream.write(f"{line}\n")


class JsonConsole:
    """One JSON object a line: ``event``, the event's name, then all its fields.

    Numbers that JSON cannot hold (NaN, infinite) are null; arrays are lists; a reading, a point or a fit is an object.

    Parameters
    ----------
    stream : LastingStream
        Where the lines go, each at once.
    """

    def __init__(self, stream: LastingStream) -> None:
        self._stream = stream

    def __call__(self, event: Event) -> None:
        """Write an event's line."""
        line = json.dumps({"event": type(event).__name__, **plain(event)}, ensure_ascii=False, allow_nan=False)
        self._stream.write(f"{line}\n")
