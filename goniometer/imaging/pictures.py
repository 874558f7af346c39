"""What a recipe takes in pictures, said before it is run."""

from __future__ import annotations

from acquisition.recipe import Recipe
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_file import Rig

_BYTES_PER_PIXEL = 2
_PLANES = 13
"""S0 to S2, their errors and covariances, DoLP and AoLP with theirs."""

_OWN_PLANES = 3
"""Each pixel's own direction, of maps in the sample's coordinates."""


def picture_lines(recipe: Recipe, rig: Rig, readings: int, directions: int) -> list[str]:
    """Pictures and maps of so many readings in so many directions, and how large they get; none without a camera."""
    camera = rig.detector
    if not isinstance(camera, CameraEntry):
        return []
    ratios = recipe.imaging.exposures if recipe.imaging else (1.0,)
    exposures = " and ".join(f"{recipe.exposure_s * ratio:g} s" for ratio in ratios)
    pixels = camera.width_px * camera.height_px
    one = "a picture" if len(ratios) == 1 else f"{len(ratios)} pictures"
    lines = [
        f"pictures: each reading is {one} of {exposures}; {readings * len(ratios)} of {camera.width_px} x "
        f"{camera.height_px} pixels, at most {_size(readings * len(ratios) * pixels * _BYTES_PER_PIXEL)}"
    ]
    if recipe.imaging is not None:
        width, height, planes = camera.width_px, camera.height_px, _PLANES
        if recipe.imaging.area is not None:
            grid = recipe.imaging.area.grid
            width, height, planes = grid.width, grid.height, _PLANES + _OWN_PLANES
        lines.append(
            f"maps: {directions} directions of {width} x {height} pixels, at most "
            f"{_size(directions * width * height * planes * 4)}"
        )
    return lines


def _size(size_bytes: int) -> str:
    return f"{size_bytes / 1e6:.3g} MB" if size_bytes < 1e9 else f"{size_bytes / 1e9:.3g} GB"
