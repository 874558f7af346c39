"""The way that a scan has gone, from its readings alone: which steps they are of, and what was to come next."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

from acquisition.course import Course
from acquisition.decisions import Decisions
from acquisition.readings import Reading
from acquisition.signal_to_noise import Enough
from acquisition.steps import Step
from goniometer.errors import JournalError


@dataclass(frozen=True)
class Retraced:
    """The way of a scan that was cut short.

    `steps` have as many readings as were taken, none where a direction was skipped; but the last one, which may be
    there in part, as many as it should have. `ahead` are those behind it that are to be taken, as far as they are
    decided. `is_whole` says that nothing is missing.
    """

    steps: tuple[Step, ...]
    ahead: tuple[Step, ...]
    is_whole: bool


class _NotDecidedError(JournalError):
    """The journal holds no decision on how the scan went on."""


def recorded(about: dict[str, str]) -> Decisions:
    """The decisions of a scan that can only be retraced: a new one is refused."""
    return Decisions(lambda: about, lambda key, text: _refuse())


def retrace(way: Course, readings: Sequence[Reading], skipped: Collection[int], enough: Enough) -> Retraced:
    """Find the steps that readings are of.

    Parameters
    ----------
    way : Course
        That of the scan from its beginning, with decisions as they are `recorded`.
    readings : sequence of Reading
        Those of the plan, in the order they were taken.
    skipped : collection of int
        The directions that a person had skipped.
    enough : callable
        Says when a step has its readings.

    Returns
    -------
    Retraced
        The way.

    Raises
    ------
    JournalError
        When these are not the readings that the scan begins with, without a gap, or nobody knows what it had decided.
    """
    left, has_references = deque(readings), any(reading.kind == "reference" for reading in readings)
    steps = _steps(way, skipped)
    left_out: dict[int, int] = {}
    found: list[Step] = []

    def is_left_out(step: Step) -> bool:
        is_needed = step.kind == "reference" or (step.kind == "dark" and has_references)
        return step.point in skipped and not is_needed

    is_done = True
    while left:
        before = len(readings) - len(left)
        if (step := next(steps, None)) is None:
            raise _gap(readings, before)
        there = tuple(_taken(step, left))
        if there and step.point in left_out and is_left_out(step):
            raise _gap(readings, left_out[step.point])
        is_done = bool(there) and enough(
            replace(step, exposure_s=there[-1].exposure_s), [reading.power_w for reading in there]
        )
        if there and not left:
            found.append(replace(step, readings=len(there)) if is_left_out(step) else step)
            is_done = is_done or is_left_out(step)
            break
        if not is_done:
            left_out.setdefault(step.point, before + len(there))
            if not is_left_out(step):
                raise _gap(readings, before + len(there))
        found.append(replace(step, readings=len(there)))
    ahead: list[Step] = []
    try:
        ahead.extend(step for step in steps if not is_left_out(step))
    except _NotDecidedError:
        is_done = False
    return Retraced(tuple(found), tuple(ahead), is_whole=is_done and not ahead)


def _steps(way: Course, skipped: Collection[int]) -> Iterator[Step]:
    """The steps of the scan, one after the other; a direction is skipped in its first stretch or never."""
    while stretch := way.next(()):
        yield from stretch
        if stretch[-1].point not in skipped:
            way.has_measured(_refuse)


def _taken(step: Step, left: deque[Reading]) -> Iterator[Reading]:
    """Those of a step among the readings that are left, which they leave."""
    for number in range(step.readings):
        wanted = step.point, step.kind, step.target.slot, step.target.generator, step.first_repeat + number
        if not left or _place(left[0]) != wanted:
            return
        yield left.popleft()


def _place(reading: Reading) -> tuple[int, str, int, int | None, int]:
    return reading.point, reading.kind, reading.slot, reading.generator_slot, reading.repeat


def _gap(readings: Sequence[Reading], before: int) -> JournalError:
    found = readings[before]
    return JournalError(
        f"Reading {before + 1} of the plan is missing in the journal, or this version of goniometer "
        f"would take another one than the {found.kind} at point {found.point} in slot {found.slot} that stands in "
        "its place. Nothing was moved. Resume the run with the version that it was begun with, which its "
        "journal names, or run the recipe anew."
    )


def _refuse() -> NoReturn:
    raise _NotDecidedError(
        "The journal does not say how the scan had decided to go on, and has readings of it: an earlier version of "
        "goniometer has begun the run, or the journal was changed. Nothing was moved. Fit what there is (goniometer "
        "fit), or run the recipe anew."
    )
