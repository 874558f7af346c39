"""Files that a rig names of its camera's sensor, kept with the run so that its maps can be made again."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.bad_pixels import masked_pixels
from acquisition.imaging.light.flat import Flat
from drivers.camera.installed import camera_package
from goniometer.errors import ConfigurationError, ReductionError
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, YamlFile

FLAT, BAD_PIXELS = "sensor_flat.tiff", "sensor_bad_pixels.png"
"""Their names in a run's folder."""


def sensor_file_faults(rig: Rig, file: YamlFile) -> Iterator[Fault]:
    """What keeps maps from using the files that a rig names of its camera, at the rig file's own lines."""
    for name, camera in rig.devices.items():
        if not isinstance(camera, CameraEntry):
            continue
        for key, named, read in (("flat", camera.flat, read_flat), ("bad_pixels", camera.bad_pixels, read_bad_pixels)):
            if named is not None and (fault := _fault(read, file.path.parent / named, camera)):
                yield file.fault(("devices", name, key), fault)


def _fault(read: Callable[[Path, CameraEntry], object], path: Path, camera: CameraEntry) -> str:
    camera_package("cv2")
    try:
        read(path, camera)
    except FileNotFoundError:
        return f"{path} is not there"
    except OSError as error:
        return f"{path} cannot be read: {error.strerror}"
    except ReductionError as error:
        return str(error)
    return ""


def read_flat(path: Path, camera: CameraEntry) -> Flat:
    """Read the sensitivity of a camera's pixels beside those of its region, with which power was calibrated.

    Raises
    ------
    ReductionError
        When the file is no flat, or one of another size, or knows nothing of the region.
    OSError
        When it cannot be read.
    """
    flat = Flat.load(path)
    _require_size(path, flat.sensitivity.shape, camera)
    return flat.beside(camera.region.region)


def read_bad_pixels(path: Path, camera: CameraEntry) -> NDArray[np.bool_]:
    """Read which of a camera's pixels are not to be used; raises as `read_flat`."""
    is_bad = masked_pixels(path)
    _require_size(path, is_bad.shape, camera)
    return is_bad


def keep_sensor_files(rig: Rig, rig_path: Path, folder: Path) -> None:
    """Copy the files that a rig names of its camera into a run's folder.

    Raises
    ------
    ConfigurationError
        When one cannot be copied.
    """
    camera = rig.detector
    if not isinstance(camera, CameraEntry):
        return
    for kept, named in ((FLAT, camera.flat), (BAD_PIXELS, camera.bad_pixels)):
        if named is not None:
            try:
                shutil.copyfile(rig_path.parent / named, folder / kept)
            except OSError as error:
                raise ConfigurationError(
                    [f"{named}, which {rig_path} names of its camera, cannot be copied: {error}. Nothing was moved."]
                ) from error


def _require_size(path: Path, shape: tuple[int, ...], camera: CameraEntry) -> None:
    height, width = shape
    if (width, height) != (camera.width_px, camera.height_px):
        raise ReductionError(
            f"{path} is of {width} x {height} pixels, and the camera's pictures have {camera.width_px} x "
            f"{camera.height_px} (width_px, height_px). It was not used. Make it of pictures of this size."
        )
