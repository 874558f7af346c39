"""Whether a rig can give a recipe the maps that it asks for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from acquisition.recipe import Recipe
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_devices.video_camera import VideoCameraEntry
from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, YamlFile


def imaging_faults(recipe: Recipe, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """What the rig lacks for maps, at the recipe's own lines."""
    if recipe.imaging is None:
        return
    camera = rig.detector
    if not isinstance(camera, CameraEntry):
        yield file.fault(
            ("imaging",),
            f"needs a camera, and the detector of {rig_path} is none. Leave imaging out, or name another rig",
        )
        return
    if recipe.imaging.area is not None:
        for lacks, what in ((rig.holder, "holder"), (camera.optics, "optics of the camera")):
            if lacks is None:
                yield file.fault(
                    ("imaging", "area"),
                    f"needs the {what}, of which {rig_path} says nothing. Describe it there, or leave area out for "
                    "maps in the camera's pixels",
                )
    if len(recipe.imaging.exposures) > 1 and isinstance(camera, VideoCameraEntry):
        yield file.fault(
            ("imaging", "exposures"),
            f"asks for several, and every picture of the video camera of {rig_path} is exposed for as long: a longer "
            "reading is the mean of more of them. Leave exposures out",
        )
    elif len(recipe.imaging.exposures) > 1 and camera.sensor.black_counts is None:
        yield file.fault(
            ("imaging", "exposures"),
            f"needs the sensor's black_counts, which {rig_path} does not state: a reading may come from another "
            "exposure than its dark reading. State it there, or leave exposures out",
        )
    if not recipe.dark and camera.sensor.black_counts is None:
        yield file.fault(
            ("dark",),
            f"is false, and {rig_path} does not state the sensor's black_counts: maps would take the black level for "
            "light. State it there, or write dark: true",
        )
    shortest_s = recipe.exposure_s * recipe.imaging.exposures[-1]
    if shortest_s < camera.sample_s:
        yield file.fault(
            ("imaging", "exposures"),
            f"has an exposure of {shortest_s:g} s; allowed: at least {camera.sample_s:g} s, the step of the camera of "
            f"{rig_path} (sample_s)",
        )
