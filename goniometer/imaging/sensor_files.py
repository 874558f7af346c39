"""Files that a rig names of its camera's sensor, kept with the run so that its maps can be made again."""

from __future__ import annotations

import shutil
from pathlib import Path

from goniometer.errors import ConfigurationError
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_file import Rig

FLAT, BAD_PIXELS = "sensor_flat.tiff", "sensor_bad_pixels.png"


def sensor_files(rig: Rig, rig_path: Path) -> dict[str, Path]:
    """The files that a rig names, by the names under which a run keeps them.

    Raises
    ------
    ConfigurationError
        When one of them is not there.
    """
    camera = rig.detector
    if not isinstance(camera, CameraEntry):
        return {}
    named = {FLAT: camera.flat, BAD_PIXELS: camera.bad_pixels}
    files = {kept: rig_path.parent / name for kept, name in named.items() if name is not None}
    missing = [path for path in files.values() if not path.is_file()]
    if missing:
        raise ConfigurationError([f"{path}, which {rig_path} names of its camera, is not there." for path in missing])
    return files


def keep_sensor_files(rig: Rig, rig_path: Path, folder: Path) -> None:
    """Copy the files that a rig names of its camera into a run's folder; raises as `sensor_files` does."""
    for kept, path in sensor_files(rig, rig_path).items():
        shutil.copyfile(path, folder / kept)
