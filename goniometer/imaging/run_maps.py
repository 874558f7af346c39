"""The maps of a stored run, one direction after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition import journal
from acquisition.analyzer_matrix import AnalyzerState
from acquisition.imaging.chain import Chain, OnSample, Taken, without_maps
from acquisition.imaging.choice import Imaging
from acquisition.imaging.frame_files import StoredFrame, load_frame
from acquisition.imaging.light.bad_pixels import hot_pixels
from acquisition.imaging.light.corrections import Corrections
from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.flat import Flat
from acquisition.imaging.light.linearity import Linearity
from acquisition.imaging.light.same_exposure import by_setting
from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.place.arms import Arms
from acquisition.imaging.stokes.stokes_inverse import inverse_of
from acquisition.journal import Journal
from acquisition.readings import Reading
from drivers.camera.frame import Frame
from goniometer.errors import JournalError, ReductionError
from goniometer.imaging.sensor_files import BAD_PIXELS, FLAT, read_bad_pixels, read_flat
from goniometer.planning import detection, reduction
from goniometer.rig_devices.camera import CameraEntry
from goniometer.run_folder import MeasuredRun

_T = TypeVar("_T")


@dataclass(frozen=True)
class Photographed:
    """A reading, and the pictures that were stored with it."""

    reading: Reading
    frames: tuple[StoredFrame, ...]


def run_maps(run: MeasuredRun) -> Iterator[DirectionMaps]:
    """Make the maps of all directions that have a Stokes point, in the order of their numbers.

    A direction whose pictures are damaged, or show too few markers, has empty maps with a note why.

    Parameters
    ----------
    run : MeasuredRun
        Of a recipe with `imaging`, on a rig with a camera.

    Raises
    ------
    JournalError
        When the journal cannot be read.
    ReductionError
        When the dark pictures or the sensor's files cannot be used: then no direction has maps.
    """
    imaging, camera = run.recipe.imaging, run.rig.detector
    assert imaging is not None, "asked only for a recipe that makes maps"
    assert isinstance(camera, CameraEntry), "such a recipe is accepted only with a camera"
    taken = photographed(run.folder)
    chain = Chain(
        corrections(run.folder, camera, taken, _kept(run.folder / FLAT, read_flat, camera)),
        inverse_of(*_analyzer(run)),
        imaging.registration,
        _on_sample(imaging, camera, run),
    )
    levels = reduction(run.recipe, run.rig, run.calibration).lamp_level(run.readings)
    for point in run.points:
        of_point = [one for one in taken if one.reading.point == point.point and one.reading.kind == "signal"]
        by_slot = {slot: [one for one in of_point if one.reading.slot == slot] for slot in _slots(of_point)}
        of_states = [levels.at([one.reading.time_s for one in of_slot])[0].mean() for of_slot in by_slot.values()]
        arriving_w = detection(run.recipe, run.rig).radiometry.arriving_w(point.incidence_deg, point.exit_deg)
        per_sr = camera.watts_per_count_per_s / arriving_w
        there = _taken(of_point, tuple(per_sr / float(level) for level in of_states))
        grid = None if imaging.area is None else imaging.area.grid
        try:
            states = tuple(frames_of(run.folder, of_slot) for of_slot in by_slot.values())
        except JournalError as error:
            yield without_maps(there, grid, str(error))
            continue
        yield chain.maps(Taken(there.point, there.arms, there.has_exit_azimuth, states, there.per_sr))


def photographed(folder: Path) -> list[Photographed]:
    """The readings of a run, each with its pictures; raises JournalError when its journal cannot be read."""
    with Journal.open(folder / journal.FILE_NAME) as stored:
        pairs = zip(stored.readings(), stored.frames(), strict=True)
        return [Photographed(reading, frames) for reading, frames in pairs]


def frames_of(folder: Path, taken: Sequence[Photographed]) -> tuple[Frame, ...]:
    """The pictures of some readings; raises JournalError when one is missing or damaged."""
    return tuple(load_frame(folder, frame) for one in taken for frame in one.frames)


def _slots(taken: Sequence[Photographed]) -> list[int]:
    return sorted({one.reading.slot for one in taken})


def _analyzer(run: MeasuredRun) -> tuple[list[AnalyzerState], list[NDArray[np.float64]] | None]:
    """What is in the analyzer's slots, in their order, and its calibrated rows if there are any."""
    held = {one.slot: one.analyzer for one in run.readings if one.kind == "signal"}
    slots = sorted(held)
    rows = None if run.calibration is None else run.calibration.rows()
    return [held[slot] for slot in slots], None if rows is None else [rows[slot] for slot in slots]


def _taken(of_point: Sequence[Photographed], per_sr: tuple[float, ...]) -> Taken:
    """Where a direction's pictures were taken; the pictures themselves are still to be read."""
    readings = [one.reading for one in of_point]

    def mean(angles_deg: Sequence[float]) -> float:
        return float(np.mean(angles_deg))

    arms = Arms(
        mean([one.incidence_deg for one in readings]),
        mean([one.exit_deg for one in readings]),
        mean([one.azimuth_deg for one in readings]),
        mean([one.exit_azimuth_deg or 0.0 for one in readings]),
    )
    has_exit_azimuth = readings[0].exit_azimuth_deg is not None
    return Taken(readings[0].point, arms, has_exit_azimuth, (), per_sr)


def _kept(path: Path, read: Callable[[Path, CameraEntry], _T], camera: CameraEntry) -> _T | None:
    """What a run has kept of a file that its rig names of the sensor; None where it names none."""
    if not path.exists():
        return None
    try:
        return read(path, camera)
    except (OSError, ReductionError) as error:
        raise ReductionError(
            f"{error} It is the run's own copy of what its rig file names: put a good one in its place, and make the "
            f"maps again with: goniometer fit {path.parent}"
        ) from error


def corrections(
    folder: Path, camera: CameraEntry, taken: Sequence[Photographed], flat: Flat | None = None
) -> Corrections:
    """What a run's pictures go through: dark ones are subtracted, the sensor's curve, flat and bad pixels taken out.

    Raises
    ------
    ReductionError
        When the dark pictures or the sensor's files cannot be used.
    """
    table, black_counts = camera.sensor.linearity, camera.sensor.black_counts or 0.0
    linearity = None if table is None else Linearity(table)
    sensor = Sensor(
        camera.sensor.noise, camera.saturated_from, camera.bits, linearity=linearity, black_counts=black_counts
    )
    darks = [frame for one in taken if one.reading.kind == "dark" for frame in one.frames]
    dark = Dark(sensor, _readable(folder, darks)) if darks else None
    bad: NDArray[np.bool_] | None = None if dark is None else hot_pixels(dark)
    if (masked := _kept(folder / BAD_PIXELS, read_bad_pixels, camera)) is not None:
        bad = masked if bad is None else masked | bad
    return Corrections(sensor, dark, flat, bad)


def _readable(folder: Path, darks: Sequence[StoredFrame]) -> Iterator[Frame]:
    """Dark pictures; those whose files are damaged are passed over.

    Raises
    ------
    ReductionError
        When all of an exposure are damaged.
    """
    for of_setting in by_setting(darks).values():
        damaged, damage = 0, ""
        for stored in of_setting:
            try:
                frame = load_frame(folder, stored)
            except JournalError as error:
                damaged, damage = damaged + 1, str(error)
            else:
                yield frame
        if damaged == len(of_setting):
            raise ReductionError(f"All dark pictures of {of_setting[0].exposure_s:g} s are damaged. {damage}")


def _on_sample(imaging: Imaging, camera: CameraEntry, run: MeasuredRun) -> OnSample | None:
    if imaging.area is None:
        return None
    assert run.rig.holder is not None, "a recipe with an area is accepted only with a holder"
    assert camera.optics is not None, "and with what is known of the lens"
    return OnSample(run.rig.holder.holder(), camera.optics.optics, imaging.area.grid)
