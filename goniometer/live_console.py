"""The live view of a scan in a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import IO, Self, cast

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from acquisition.events import Control, Event, LinkRestored, ScanStarted
from goniometer.durations import clock_text
from goniometer.fitting.remarks import remarks
from goniometer.fitting.summary import model_name, parameter_rows, quality, table_lines
from goniometer.lasting_stream import LastingStream
from goniometer.plus_minus import plus_minus
from goniometer.scan_so_far import ScanSoFar
from goniometer.spectrum import spectrum_text
from model.fit import FitResult

_REFRESHES_PER_S = 6
_WIDEST = 96
_ECHO_WIDTH = len("^C")
"""Columns left free at the right: there the terminal writes Ctrl-C, which must not push the view to a new line."""
_SPEED_WORTH_TELLING = 1.2
_LABEL = "dim"


class LiveConsole:
    """Progress, angles, the last point and the live fit, redrawn a few times a second; a summary at the end.

    An event only updates what is known; a thread of its own draws, so that the cost does not grow with a scan's speed.

    Parameters
    ----------
    stream : LastingStream
        The terminal.
    now_s : callable
        Real time in seconds.
    keys : str
        What a person is told of the keys that control the scan.
    """

    def __init__(self, stream: LastingStream, now_s: Callable[[], float] = time.monotonic, keys: str = "") -> None:
        self._keys = keys
        self._scan = ScanSoFar(now_s)
        self._console = Console(file=cast(IO[str], stream), highlight=False, emoji=False, markup=False)
        self._live = Live(self, console=self._console, refresh_per_second=_REFRESHES_PER_S, transient=True)

    def __call__(self, event: Event) -> None:
        """Take an event in; it shows with the next refresh."""
        self._scan(event)
        if isinstance(event, ScanStarted):
            for note in event.notes:
                self._console.print(Text(f"note: {note}", style="yellow"))
        elif isinstance(event, LinkRestored | Control):
            self._console.print(Text(f"note: {event}", style="yellow"))

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()
        started = self._scan.started
        if started is None:
            return
        self._console.print(Text(self._scan.ending(), style="bold"))
        if self._scan.spectrum is not None:
            self._console.print(Group(Text(), Text(spectrum_text(self._scan.spectrum)), Text()))
        elif self._scan.fit is not None:
            fit = self._scan.fit.result
            said = "\n".join([quality(fit), *remarks(fit), model_name(fit)])
            self._console.print(Group(Text(), _parameters(fit, started), Text(), said, Text()))

    def __rich__(self) -> RenderableType:
        """The view as things stand."""
        scan = self._scan
        if scan.started is None:
            return Text("Preparing the bench …", style=_LABEL)
        return Panel(
            Group(
                *self._progress(scan.started), Text(), self._bench(), Text(), *self._fit(scan.started), *self._below()
            ),
            title=Text(scan.started.recipe, style="bold"),
            subtitle=Text(scan.started.run, style=_LABEL),
            title_align="left",
            subtitle_align="right",
            border_style="blue",
            padding=(1, 2),
            width=min(self._console.width - _ECHO_WIDTH, _WIDEST),
        )

    def _progress(self, started: ScanStarted) -> list[RenderableType]:
        scan, left_s = self._scan, self._scan.real_left_s()
        line = Table.grid(expand=True, padding=(0, 0, 0, 2))
        line.add_column(ratio=1)
        line.add_column()
        line.add_column(justify="right", style="bold")
        if started.points is not None and started.readings is None:
            total, done = float(started.points), float(scan.points)
            readings, left = f"{scan.readings} readings, {scan.points} of {started.points} points", "left"
        elif started.readings is None:
            total, done = started.expected_duration_s, scan.bench_elapsed_s()
            readings, left = f"{scan.readings} readings", "left at most"
        else:
            total, done = float(started.readings), float(scan.readings)
            readings, left = f"{scan.readings:>{len(str(started.readings))}} of {started.readings} readings", "left"
        line.add_row(
            ProgressBar(total=total, completed=done, complete_style="blue", finished_style="green"),
            readings,
            f"{clock_text(left_s) if left_s is not None else '-:--':>7} {left}",
        )
        bench = f"planned time {clock_text(scan.bench_elapsed_s())} of {clock_text(started.expected_duration_s)}"
        speed = scan.bench_speed()
        if speed is not None and speed > _SPEED_WORTH_TELLING:
            bench += f", {speed:.3g} times real time"
        return [line, Text(bench, style=_LABEL)]

    def _below(self) -> list[RenderableType]:
        return [Text(), Text(self._keys, style=_LABEL)] if self._keys else []

    def _bench(self) -> Text:
        step, point, chosen = self._scan.step, self._scan.point, self._scan.chosen
        text = Text()
        if self._scan.paused is not None:
            text.append(f"PAUSED      {self._scan.paused.why}\n", "bold yellow")
        if step is not None:
            text.append("now         ", _LABEL)
            _say(text, "incidence", f"{step.incidence_deg:z.2f}°")
            _say(text, "exit", f"{step.exit_deg:z.2f}°")
            _say(text, "azimuth", f"{step.azimuth_deg:z.2f}°")
            if step.exit_azimuth_deg is not None:
                _say(text, "exit azimuth", f"{step.exit_azimuth_deg:z.2f}°")
            _say(text, "slot", f"{step.slot}")
            if self._scan.wavelength_nm is not None:
                _say(text, "wavelength", f"{self._scan.wavelength_nm:g} nm")
        if point is not None:
            text.append("\nlast point  ", _LABEL)
            if self._scan.started is not None and self._scan.started.has_planes:
                _say(text, "incidence", f"{point.incidence_deg:z.2f}°")
                if point.exit_azimuth_deg is not None:
                    _say(text, "exit azimuth", f"{point.exit_azimuth_deg:z.2f}°")
            _say(text, "exit", f"{point.exit_deg:z.2f}°")
            _say(text, "DoLP", plus_minus(point.dolp, point.dolp_stderr))
            _say(text, "AoLP", f"{plus_minus(point.aolp_deg, point.aolp_stderr_deg)}°")
        if chosen is not None and chosen.why:
            text.append("\nwhy here    ", _LABEL).append(chosen.why)
        if chosen is not None and chosen.standing:
            text.append("\nwanted      ", _LABEL).append(chosen.standing)
        return text

    def _fit(self, started: ScanStarted) -> list[RenderableType]:
        fit, refusal = self._scan.fit, self._scan.refusal
        if refusal is not None:
            return [Text(f"No fit to the first {refusal.points} points: {refusal.reason}", style="yellow")]
        if fit is None:
            return [Text("No fit yet.", style=_LABEL)]
        of_all = "" if started.points is None else f" of {started.points}"
        at = "" if self._scan.wavelength_nm is None else f" at {self._scan.wavelength_nm:g} nm"
        title = Text.assemble((f"live fit{at}", "bold"), (f"  first {fit.points}{of_all} points", _LABEL))
        return [title, Text(), _parameters(fit.result, started), Text(), Text(quality(fit.result), style=_LABEL)]


def _say(text: Text, label: str, value: str) -> None:
    text.append(f"{label} ", _LABEL).append(f"{value}   ")


def _parameters(fit: FitResult, started: ScanStarted) -> Text:
    rows = parameter_rows(fit, started.truth)
    header, *lines = table_lines(rows)
    text = Text(header, style=_LABEL, no_wrap=True, overflow="ellipsis")
    for row, line in zip(rows, lines, strict=True):
        text.append("\n").append(line, style="not dim yellow" if row.note else "not dim")
    return text
