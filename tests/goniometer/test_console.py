"""What a scan shows: readable, parseable, and never the end of a scan."""

from __future__ import annotations

import io
import json
import math
import os
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from acquisition.events import (
    Event,
    FitRefused,
    FitUpdated,
    PointReduced,
    ReadingStored,
    ScanEnded,
    ScanStarted,
    StepStarted,
)
from acquisition.readings import Reading, StokesPoint
from goniometer.console import Mode, console_for
from goniometer.lasting_stream import LastingStream
from goniometer.live_console import LiveConsole
from goniometer.scan_so_far import ScanSoFar
from model.fit import Estimate, FitResult
from model.lobes import Diffuse
from model.surface import Surface

TRUTH = {"sigma": 0.3, "n": 2.95}
POINT = StokesPoint(
    point=0,
    incidence_deg=60.0,
    exit_deg=-5.0,
    azimuth_deg=0.0,
    stokes=np.array([0.5, 0.1, -0.01]),
    covariance=np.diag([4e-6, 9e-6, 16e-6]),
    dolp=0.2,
    dolp_debiased=0.19,
    dolp_stderr=0.021,
    aolp_deg=-3.0,
    aolp_stderr_deg=math.nan,
)
READING = Reading(0, "dark", 0, 1.5, 60.0, -5.0, 0.0, 6, None, 0.03, 1.25e-9)
FIT = FitResult(
    parameters={
        "sigma": Estimate(0.312, 0.011, False),
        "n": Estimate(2.95, 0.012, False),
        "rho_d": Estimate(0.0, None, True),
    },
    chi_square=8.5,
    degrees_of_freedom=8,
    p_value=0.39,
    names=("sigma", "n"),
    correlation=np.eye(2),
    stokes=np.array([[0.5, 0.1, 0.0]]),
    columns=("s0", "s1", "s2"),
    fitted=np.array([[0.5, 0.1, 0.0]]),
    surface=Surface([Diffuse(0.1, 0.3)]),
)
EVENTS: list[Event] = [
    ScanStarted("runs/iron", "iron at 60 degrees", 2, 10, 120.0, TRUTH),
    StepStarted(0, 60.0, -5.0, 0.0, 3, 0, 120.0),
    ReadingStored(READING),
    PointReduced(POINT),
    FitRefused(1, "3 values cannot determine 6 parameters"),
    FitUpdated(2, FIT),
    ScanEnded("finished", 1, 121.0, as_asked=True),
]


class Terminal(io.StringIO):
    """A stream in memory that says it is a terminal."""

    def isatty(self) -> bool:
        return True


class ClosedPipe(io.StringIO):
    """A stream whose reader has gone away."""

    def __init__(self, lines_before: int) -> None:
        super().__init__()
        self.left = lines_before

    def write(self, text: str) -> int:
        if self.left == 0:
            raise BrokenPipeError(32, "Broken pipe")
        self.left -= 1
        return super().write(text)


def _shown(mode: Mode, stream: io.StringIO, events: list[Event] = EVENTS) -> str:
    with console_for(mode, stream) as show:
        for event in events:
            show(event)
    return stream.getvalue()


def test_every_json_line_holds_its_event() -> None:
    lines = [json.loads(line) for line in _shown("json", io.StringIO()).splitlines()]
    assert [line["event"] for line in lines] == [type(event).__name__ for event in EVENTS]
    started, step, reading, point, refused, fit, ended = lines
    assert started["truth"] == TRUTH
    assert (step["exit_deg"], step["slot"], step["time_left_s"]) == (-5.0, 3, 120.0)
    assert reading["reading"] == {**vars(READING)}
    assert point["stokes_point"]["stokes"] == [0.5, 0.1, -0.01]
    assert point["stokes_point"]["covariance"][2][2] == 16e-6
    assert refused["reason"].startswith("3 values")
    assert fit["result"]["parameters"]["n"] == {"value": 2.95, "stderr": 0.012, "at_bound": False}
    assert fit["result"]["correlation"] == [[1.0, 0.0], [0.0, 1.0]]
    assert ended == {
        "event": "ScanEnded",
        "reason": "finished",
        "readings": 1,
        "bench_duration_s": 121.0,
        "as_asked": True,
    }


def test_json_never_says_nan() -> None:
    def refuse(constant: str) -> Any:
        raise AssertionError(f"{constant} is not JSON")

    infinite = StepStarted(0, 60.0, math.inf, 0.0, 3, 0, -math.inf)
    lines = [
        json.loads(line, parse_constant=refuse)
        for line in _shown("json", io.StringIO(), [*EVENTS, infinite]).splitlines()
    ]
    assert lines[3]["stokes_point"]["aolp_stderr_deg"] is None
    assert lines[-1]["exit_deg"] is None


def test_json_lines_are_readable_while_the_scan_runs() -> None:
    read, write = os.pipe()
    os.set_blocking(read, False)
    with os.fdopen(read, "rb") as reader, os.fdopen(write, "w") as stream, console_for("json", stream) as show:
        show(EVENTS[0])
        line = reader.readline()
    assert json.loads(line)["run"] == "runs/iron"


def test_plain_lines_carry_numbers_with_errors_and_no_escape_codes() -> None:
    shown = _shown("auto", io.StringIO())
    assert "\x1b" not in shown
    assert "iron at 60 degrees: 2 points, 10 readings, about 2:00" in shown
    assert "exit   -5.00°  S0 0.5000 ± 0.0020" in shown
    assert "DoLP 0.200 ± 0.021" in shown
    assert "no fit to 1 points: 3 values" in shown


def test_the_summary_gives_value_error_truth_and_chi_square_in_words() -> None:
    *_, summary = _shown("plain", io.StringIO()).partition("finished")
    rows = {line.split()[0]: line.split() for line in summary.splitlines() if line}
    assert rows["sigma"] == ["sigma", "0.312", "±", "0.011", "0.3", "+1.1"]
    assert rows["n"] == ["n", "2.950", "±", "0.012", "2.95", "+0.0"]
    assert rows["rho_d"] == ["rho_d", "0", "at", "its", "bound"]
    assert "Chi-square 8.5 for 8 degrees of freedom" in summary
    assert "Model: diffuse." in summary


def test_a_scan_that_ends_early_says_why_and_keeps_its_last_fit() -> None:
    shown = _shown("plain", io.StringIO(), [*EVENTS[:-1], ScanEnded("Ctrl-C", 1, 60.0, as_asked=False)])
    assert "ended early after 1 of 10 readings, 1 points, 1:00 on the bench's clock. Reason: Ctrl-C" in shown
    assert "0.312 ± 0.011" in shown


def _fail_while_shown(stream: io.StringIO) -> None:
    with console_for("plain", stream) as show:
        show(EVENTS[0])
        raise ValueError("of the scan")


def test_an_error_passes_through_the_console_unchanged() -> None:
    stream = io.StringIO()
    with pytest.raises(ValueError, match="of the scan"):
        _fail_while_shown(stream)
    assert "cut short after 0 of 10 readings" in stream.getvalue()


def test_quiet_says_nothing() -> None:
    assert _shown("quiet", io.StringIO()) == ""


@pytest.mark.parametrize("mode", ["plain", "json"])
@pytest.mark.parametrize("lines_before", [0, 2])
def test_a_closed_pipe_does_not_reach_the_scan(
    mode: Mode, lines_before: int, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = _shown(mode, ClosedPipe(lines_before))
    assert len(shown.splitlines()) == lines_before
    assert capsys.readouterr().err.count("Nothing more is shown (Broken pipe); the scan goes on") == 1


def test_a_real_pipe_whose_reader_left_stays_harmless_to_the_very_end() -> None:
    read, write = os.pipe()
    stream = os.fdopen(write, "w")
    os.close(read)
    with console_for("json", stream) as show:
        for event in EVENTS:
            show(event)
    stream.close()  # the interpreter's last flush


def test_a_poor_encoding_costs_characters_not_the_scan() -> None:
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    with console_for("plain", stream) as show:
        for event in EVENTS:
            show(event)
    assert b"0.312 ? 0.011" in raw.getvalue()


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "24")
    return Terminal()


@pytest.mark.parametrize("width", [80, 120])
def test_the_live_view_shows_place_polarization_fit_and_truth(width: int) -> None:
    live = LiveConsole(LastingStream(Terminal()), now_s=lambda: 0.0)
    for event in EVENTS:
        live(event)
    page = Console(file=io.StringIO(), width=width, color_system=None)
    page.print(live)
    shown = page.file.getvalue()
    assert "iron at 60 degrees" in shown
    assert "1 of 10 readings" in shown
    assert "incidence 60.00°   exit -5.00°   azimuth 0.00°   slot 3" in shown
    assert "DoLP 0.200 ± 0.021" in shown
    assert "n           2.950 ± 0.012    2.95        +0.0" in shown
    assert max(map(len, shown.splitlines())) <= width
    assert len(shown.splitlines()) < 24


def test_a_terminal_gets_the_live_view_and_then_the_summary(terminal: Terminal) -> None:
    shown = _shown("auto", terminal)
    assert "\x1b[?25l" in shown
    assert shown.rindex("\x1b[?25h") < shown.index("finished, 1 of 10 readings")


def test_a_dumb_terminal_gets_plain_lines(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    assert "\x1b" not in _shown("auto", terminal)


def test_time_left_is_real_time_also_when_the_bench_runs_faster() -> None:
    now_s = iter([0.0, 0.0, 3.0, 3.0, 4.0])
    scan = ScanSoFar(lambda: next(now_s))
    scan(ScanStarted("runs/iron", "iron", 2, 10, 120.0, {}))
    scan(StepStarted(0, 60.0, 0.0, 0.0, 2, 0, 120.0))
    assert scan.real_left_s() is None
    scan(StepStarted(1, 60.0, 1.0, 0.0, 2, 5, 90.0, 30.0))
    assert scan.bench_speed() == pytest.approx(10.0)
    assert scan.real_left_s() == pytest.approx(9.0)
    assert scan.real_left_s() == pytest.approx(8.0)
