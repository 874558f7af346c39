"""Whether a camera's readings are those of the scan without faults, by every pixel of every picture that is stored.

Some faults change what there is to be seen: a shutter that is stuck, light of the room, cloths over markers. Pictures
that show it are true; what else may be in them follows from the scan without faults, pixel by pixel.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from benches import BLACK_COUNTS, ShortScan
from numpy.typing import NDArray
from scanned import Outcome, scanned, without_faults

from acquisition.readings import Reading
from drivers.camera.frame import Frame
from goniometer.rig_devices.camera import CameraEntry

Counts = NDArray[np.uint16]
Fault = dict[str, Any]

DARK = "lamp_off", "frame_dark"
"""Faults through which a camera sees nothing, and says so truly."""

_MARKERS = "markers_hidden", "marker_misprinted"
_TOLERANCE_S, _SAME_EXPOSURE = 0.005, 1.001e-3
"""Of the camera's own times, and of exposures that it names, which round them."""


def wrong_pictures(scan: ShortScan, faults: Sequence[Fault], outcome: Outcome) -> Iterator[str]:
    """What must not be stored: another picture, an old one, one of another time, or one that is no reading's.

    Parameters
    ----------
    scan : ShortScan
        The bench.
    faults : sequence of dict
        What struck there.
    outcome : Outcome
        Of the scan through these faults.
    """
    if outcome.stray_files:
        yield f"pictures of no reading: {outcome.stray_files}"
    last = 0
    ends_s = [*(reading.time_s for reading in outcome.rows[1:]), outcome.duration_s]
    stored = zip(outcome.rows, outcome.frames, without_faults(scan.name).frames, ends_s, strict=False)
    for place, (reading, frames, right, end_s) in enumerate(stored):
        begun = [fault for fault in faults if fault["at_s"] <= end_s]
        if not _are_taken_alike(frames, right):
            yield f"pictures {frames} in place of {right}: {reading}"
            continue
        for exposure, frame in enumerate(frames):
            if not any(np.array_equal(frame.counts, seen) for seen in _to_be_seen(scan.name, begun, place, exposure)):
                yield f"wrong picture {exposure} of reading {reading}"
            if frame.number is None or frame.number <= last:
                yield f"picture {exposure} has the number {frame.number} behind {last}: {reading}"
            last = frame.number or last
            if not reading.time_s - _TOLERANCE_S <= frame.time_s <= end_s - frame.exposure_s + _TOLERANCE_S:
                yield f"picture {exposure} is of {frame.time_s} s, which is not in the reading's time: {reading}"


def is_of_pictures(scan: ShortScan, reading: Reading, frames: Sequence[Frame]) -> bool:
    """Whether a reading is the mean over the region of its longest exposure that is not saturated there."""
    camera = scan.rig.detector
    assert isinstance(camera, CameraEntry)
    region = camera.region
    for frame in frames:
        counts = frame.counts[region.top : region.top + region.height, region.left : region.left + region.width]
        if counts.max() < camera.saturated_from:
            power_w = (counts.mean() - BLACK_COUNTS) / frame.exposure_s * camera.watts_per_count_per_s
            return bool(reading.exposure_s == frame.exposure_s and np.isclose(reading.power_w, power_w, rtol=1e-9))
    return False


def are_same(pictures: Sequence[Sequence[Frame]], right: Sequence[Sequence[Frame]]) -> bool:
    """Whether pictures are bit by bit those of the scan without faults, as far as they go."""
    return all(
        _are_taken_alike(frames, wanted)
        and all(np.array_equal(frame.counts, one.counts) for frame, one in zip(frames, wanted, strict=True))
        for frames, wanted in zip(pictures, right, strict=False)
    )


def _are_taken_alike(frames: Sequence[Frame], right: Sequence[Frame]) -> bool:
    """Whether pictures are as many, and how they were taken is the same; exposures to what a driver lets pass."""
    return len(frames) == len(right) and all(
        (frame.bits, frame.gain_db, frame.averaged) == (one.bits, one.gain_db, one.averaged)
        and math.isclose(frame.exposure_s, one.exposure_s, rel_tol=_SAME_EXPOSURE)
        for frame, one in zip(frames, right, strict=True)
    )


def _to_be_seen(bench: str, faults: Sequence[Fault], place: int, exposure: int) -> Iterator[Counts]:
    """Every picture that can be a true one."""
    right = without_faults(bench).frames[place][exposure].counts
    bare = [right, *(frames[place][exposure].counts for frames in _covered(bench, faults))]
    if any(fault["fault"] in DARK for fault in faults):
        bare.append(np.full_like(right, BLACK_COUNTS))
    shares = {fault["share"] for fault in faults if fault["fault"] == "frame_saturated"}
    for counts in bare:
        yield counts
        for share in shares:
            lit = counts.copy()
            lit[:, : round(share * counts.shape[1])] = np.iinfo(np.uint16).max
            yield lit


def _covered(bench: str, faults: Sequence[Fault]) -> Iterator[tuple[tuple[Frame, ...], ...]]:
    """The pictures of scans in which some of the faults of markers last from the beginning to the end."""
    of_markers = sorted((fault for fault in faults if fault["fault"] in _MARKERS), key=lambda fault: fault["at_s"])
    lasting = [fault | {"at_s": 0.0, "for_s": 1e9} for fault in of_markers]
    for count in range(1, len(lasting) + 1):
        for some in combinations(lasting, count):
            yield _pictures_under(bench, json.dumps(some))


@functools.cache
def _pictures_under(bench: str, faults: str) -> tuple[tuple[Frame, ...], ...]:
    outcome = scanned(bench, json.loads(faults), 1)
    if outcome.error is not None:
        raise outcome.error
    return outcome.frames
