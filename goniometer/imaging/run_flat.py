"""How sensitive each pixel of a camera is, from a run on something evenly bright."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.imaging.light.flat import Flat
from acquisition.imaging.light.signal_image import SignalImage
from goniometer.errors import ReductionError
from goniometer.imaging.run_maps import corrections, frames_of, photographed
from goniometer.rig_devices.camera import CameraEntry
from goniometer.run_folder import as_far_as_measured


def flat_of_run(folder: Path) -> Flat:
    """Make a flat of all pictures of a run, which has one direction.

    Parameters
    ----------
    folder : Path
        The run's. Behind each analyzer position its pictures are averaged, and then over the positions, so that a
        target that polarizes evenly is even.

    Raises
    ------
    ReductionError
        When it has no camera, several directions, or no light.
    JournalError
        When its journal or a picture cannot be read.
    """
    run = as_far_as_measured(folder)
    camera = run.rig.detector
    if not isinstance(camera, CameraEntry):
        raise ReductionError(f"{run.folder} has no pictures: the detector of its rig is no camera. No flat was made.")
    taken = photographed(run.folder)
    lit = [one for one in taken if one.reading.kind == "signal"]
    if len(points := {one.reading.point for one in lit}) != 1:
        raise ReductionError(
            f"{run.folder} has {len(points)} directions, whose light differs. No flat was made. Measure one, with many "
            "readings: exit_deg: [0]"
        )
    corrected = corrections(run.folder, camera, taken)
    slots = sorted({one.reading.slot for one in lit})
    images = [
        corrected.signal(frames_of(run.folder, [one for one in lit if one.reading.slot == slot])) for slot in slots
    ]
    signal = np.mean([image.signal for image in images], axis=0)
    variance = np.mean([image.variance for image in images], axis=0) / np.float32(len(images))
    return Flat.of(SignalImage(signal, variance))
