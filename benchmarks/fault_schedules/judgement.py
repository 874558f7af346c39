"""What must not have happened in a scan through faults."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from benches import KINDS, ShortScan, short_scan
from pictures import DARK, are_same, is_of_pictures, wrong_pictures
from scanned import Hang, Outcome, make_impatient, scanned, time_limit, without_faults
from schedules import schedule
from struck import Struck

from acquisition.readings import Reading
from drivers.axis import HOMING_S
from goniometer.errors import DeviceError, ReductionError

LONGEST_EXTRA_S = 120.0
"""How much longer than without faults a scan may take on the bench's clock: some of the drivers' deadlines in a row.

Axes that are homed have the deadline of that besides.
"""


@dataclass(frozen=True)
class Verdict:
    """How the scan of one seed ended; `wrong` says what must not have happened, and then under which schedule."""

    seed: int
    bench: str
    faults: tuple[str, ...]
    struck: Struck
    ending: str
    wrong: tuple[str, ...]
    real_s: float
    bench_s: float


def judged(seed: int) -> Verdict:
    """Scan through the faults of this seed."""
    drawn = schedule(seed, lambda bench: without_faults(bench).duration_s)
    start_s = time.monotonic()
    with time_limit():
        outcome = scanned(drawn.bench, drawn.faults, seed)
    wrong = list(violations(drawn.bench, drawn.faults, outcome))
    if wrong:
        wrong += [f"{drawn}", f"{outcome.error!r}"]
    return Verdict(
        seed,
        drawn.bench,
        tuple(fault["fault"] for fault in drawn.faults),
        outcome.struck,
        "violation" if wrong else _ending(drawn.bench, drawn.faults, outcome),
        tuple(wrong),
        time.monotonic() - start_s,
        outcome.duration_s,
    )


def prepare() -> None:
    """Take the time of each scan without faults with patient drivers, then make them impatient."""
    for bench in KINDS:
        without_faults(bench)
    make_impatient()


def violations(bench: str, faults: Sequence[dict[str, Any]], outcome: Outcome) -> Iterator[str]:
    """What must not have happened."""
    expected, scan = without_faults(bench), short_scan(bench)
    homing_s = HOMING_S * any(axis.home_at_start for axis in scan.rig.axes().values())
    if isinstance(outcome.error, Hang) or outcome.duration_s > expected.duration_s + LONGEST_EXTRA_S + homing_s:
        yield f"hang: {outcome.duration_s:.1f} s of the bench's time"
    if list(outcome.rows) != outcome.shown:
        yield f"{len(outcome.shown)} readings were shown and {len(outcome.rows)} are stored"
    if len(outcome.rows) > len(expected.rows):
        yield f"{len(outcome.rows)} readings are stored, and {len(expected.rows)} were to be taken"
    ends_s = [*(reading.time_s for reading in outcome.rows[1:]), outcome.duration_s]
    for reading, frames, right, end_s in zip(outcome.rows, outcome.frames, expected.rows, ends_s, strict=False):
        if frames:
            is_right = _is_there(scan, reading, right) and is_of_pictures(scan, reading, frames)
        else:
            is_right = _is_same(scan, reading, right) or _is_dark(scan, reading, right, end_s, faults)
        if not is_right:
            yield f"wrong reading {reading}"
    yield from wrong_pictures(scan, faults, outcome)
    if outcome.error is None and len(outcome.rows) != len(expected.rows):
        yield f"{len(outcome.rows)} readings of {len(expected.rows)}, and no error"
    failures = _errors_in(outcome.error)
    for failure in failures:
        if not (_names_device(scan, failure) or _names_lamp(failure, faults)):
            yield f"an error that names no device: {failure!r}"
    if outcome.moving and not any("may still be moving" in str(failure) for failure in failures):
        yield f"{' and '.join(outcome.moving)} moves on, and nothing says so"
    if outcome.doubts and not _is_dark_at_times(faults):
        yield f"the light is doubted, and it was never dark: {outcome.doubts}"


def _ending(bench: str, faults: Sequence[dict[str, Any]], outcome: Outcome) -> str:
    if outcome.moving:
        return "not stopped, and said so"
    if outcome.error is not None:
        return type(_errors_in(outcome.error)[0]).__name__
    scan, expected = short_scan(bench), without_faults(bench)
    if any(outcome.frames):  # readings are those of their pictures
        is_same = are_same(outcome.frames, expected.frames)
    else:
        is_same = all(_is_same(scan, *pair) for pair in zip(outcome.rows, expected.rows, strict=False))
    if is_same:
        return "same data"
    if not any(fault["fault"] == "lamp_off" for fault in faults):
        return "true pictures of a fault"
    return "lamp out, and said so" if outcome.doubts else "lamp out between references"


def _is_there(scan: ShortScan, reading: Reading, right: Reading) -> bool:
    """Whether a reading is of the same place; angles to within the axes' tolerance."""
    axes = scan.rig.axes()
    angles = (
        ("source_arm", reading.incidence_deg - right.incidence_deg),
        ("detector_arm", reading.exit_deg - right.exit_deg),
        ("sample_azimuth", reading.azimuth_deg - right.azimuth_deg),
    )
    return _place(reading) == _place(right) and all(abs(off) <= axes[role].tolerance_deg for role, off in angles)


def _is_same(scan: ShortScan, reading: Reading, right: Reading) -> bool:
    """Whether all is the same but the time."""
    off_w = scan.share * max(row.power_w for row in without_faults(scan.name).rows)
    is_as_long = reading.exposure_s == right.exposure_s
    return _is_there(scan, reading, right) and is_as_long and abs(reading.power_w - right.power_w) <= off_w


def _place(reading: Reading) -> tuple[Any, ...]:
    return reading.point, reading.kind, reading.repeat, reading.slot


def _is_dark(scan: ShortScan, reading: Reading, right: Reading, end_s: float, faults: Sequence[dict[str, Any]]) -> bool:
    """Whether a reading is of the dark because the lamp was out: it is true, and only a reference tells.

    One of a lock-in, which takes long, may be of light in part.
    """
    is_out = any(fault["fault"] == "lamp_off" and fault["at_s"] <= end_s for fault in faults)
    most_w = right.power_w if scan.share else 0.0
    is_there = _place(reading) == _place(right) and reading.exposure_s == right.exposure_s
    return is_out and is_there and 0.0 <= reading.power_w <= most_w


def _is_dark_at_times(faults: Sequence[dict[str, Any]]) -> bool:
    return any(fault["fault"] in DARK for fault in faults)


def _names_device(scan: ShortScan, failure: BaseException) -> bool:
    names = (*scan.rig.axes(), *scan.rig.devices)
    return isinstance(failure, DeviceError) and failure.device in names and bool(failure.happened and failure.to_do)


def _names_lamp(failure: BaseException, faults: Sequence[dict[str, Any]]) -> bool:
    is_said = isinstance(failure, ReductionError) and "the lamp level cannot be followed" in str(failure)
    return is_said and _is_dark_at_times(faults)


def _errors_in(error: BaseException | None) -> list[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        return [one for each in error.exceptions for one in _errors_in(each)]
    return [] if error is None else [error]
