"""Whether the markers that a rig describes are those of the plate that a scene puts before the camera."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from goniometer.rig_file import Rig
from goniometer.yaml_file import Fault, YamlFile
from sim_devices.scene import Scene

_SAME_SIZE = 0.05


def marker_faults(scene: Scene, file: YamlFile, rig: Rig, rig_path: Path) -> Iterator[Fault]:
    """Where the plate's markers are others than the rig's, at the scene's own lines.

    Places and size may be known wrongly, which is worth simulating; but a marker that is a whole marker away from its
    place, or another one, is a mistake in one of the files. Markers of a board are not compared.
    """
    if scene.plate is None or rig.holder is None or not rig.holder.markers:
        return
    markers, holder = scene.plate.markers, rig.holder
    if markers is None:
        yield file.fault(("plate",), f"has no markers; allowed: those of the holder in {rig_path}")
        return
    if (dictionary := f"DICT_{markers.dictionary.upper()}") != holder.dictionary:
        yield file.fault(
            ("plate", "markers", "dictionary"), f"is {dictionary}; allowed: {holder.dictionary}, as in {rig_path}"
        )
    side_mm = holder.marker_mm or 0.0
    if not math.isclose(markers.size_mm, side_mm, rel_tol=_SAME_SIZE):
        yield file.fault(
            ("plate", "markers", "size_mm"),
            f"got {markers.size_mm:g}; allowed: about {side_mm:g}, the marker_mm of the holder in {rig_path}",
        )
    for number, place_mm in holder.markers.items():
        there_mm = markers.at_mm.get(number)
        if there_mm is None:
            yield file.fault(
                ("plate", "markers", "at_mm"), f"does not hold marker {number}, which the holder in {rig_path} has"
            )
        elif math.dist(there_mm, place_mm) > side_mm:
            yield file.fault(
                ("plate", "markers", "at_mm", number),
                f"got {list(there_mm)}; allowed: about {list(place_mm)}, as in {rig_path}",
            )
