"""From where every pixel of a map is lit and seen, and to which axes its Stokes parameters refer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.place.map_grid import MapGrid
from acquisition.imaging.place.pose import Pose
from model.geometry import Rotation

Map = NDArray[np.float64]

_UPRIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class ExitDirections:
    """All as `model.geometry` has it; arrays are (height, width).

    Parameters
    ----------
    incidence_rad : float
        The same everywhere: the light is collimated.
    exit_rad : ndarray
        From the normal, 0 to pi/2.
    azimuth_rad : ndarray
        From the source, right-handed about the normal, 0 to 2 pi: pi is the mirror side.
    to_exit_frame : Rotation
        From the axes of the analyzer, which are the picture's right and up, to the pixel's own s- and p-direction.
    """

    incidence_rad: float
    exit_rad: Map
    azimuth_rad: Map
    to_exit_frame: Rotation[Map]


def exit_directions(pose: Pose, grid: MapGrid, source: NDArray[np.float64]) -> ExitDirections:
    """Look from every pixel of a map into the camera.

    The analyzer's axes belong to the optical axis; for a ray beside it, the picture's right is projected onto the plane
    across the ray, as `model.acceptance` does with the rays of a cone.

    Parameters
    ----------
    pose : Pose
        How the plate stands before the camera.
    grid : MapGrid
        Of the map.
    source : ndarray
        (3,) unit vector to the source in plate coordinates, such as `Arms.source`.
    """
    x, y = np.meshgrid(grid.x_mm(), grid.y_mm())
    camera = pose.camera_mm
    ray = np.stack((camera[0] - x, camera[1] - y, np.full_like(x, camera[2])), axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    level = np.hypot(ray[..., 0], ray[..., 1])
    of_source = math.atan2(source[1], source[0])
    # A ray along the normal has no azimuth of its own; it counts as one on the mirror side, as in model.geometry.
    turn = np.where(level > _UPRIGHT, np.arctan2(ray[..., 1], ray[..., 0]), of_source + np.pi)
    own = np.stack((-np.sin(turn), np.cos(turn), np.zeros_like(turn)), axis=-1)
    right = pose.rotation[0]
    along = right - (ray @ right)[..., None] * ray
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    cosine, sine = (own * along).sum(axis=-1), (own * np.cross(ray, along)).sum(axis=-1)
    return ExitDirections(
        incidence_rad=math.acos(min(1.0, float(source[2]))),
        exit_rad=np.arctan2(level, ray[..., 2]),
        azimuth_rad=(turn - of_source) % (2.0 * np.pi),
        to_exit_frame=Rotation(cos2=(cosine - sine) * (cosine + sine), sin2=2.0 * sine * cosine),
    )


def turned(
    maps: Mapping[str, NDArray[np.floating]], rotation: Rotation[Map], covariance12: NDArray[np.floating] | float = 0.0
) -> dict[str, NDArray[np.float32]]:
    """Stokes maps referred to other axes: S1, S2 and, where they are there, their variances; others stay as they are.

    Parameters
    ----------
    maps : mapping
        (height, width) each: S1, S2, perhaps S1_variance and S2_variance, and any others.
    rotation : Rotation
        Onto the new axes, counted about the ray.
    covariance12 : ndarray or float
        Of S1 and S2 as measured. It is 0 behind four polarizers 45° apart in about the same light.
    """
    cosine, sine = rotation.cos2, rotation.sin2
    s1, s2 = (np.asarray(maps[name], np.float64) for name in ("S1", "S2"))
    new = {"S1": cosine * s1 + sine * s2, "S2": cosine * s2 - sine * s1}
    if "S1_variance" in maps and "S2_variance" in maps:
        v1, v2 = (np.asarray(maps[name], np.float64) for name in ("S1_variance", "S2_variance"))
        crossed = 2.0 * cosine * sine * covariance12
        new["S1_variance"] = cosine**2 * v1 + sine**2 * v2 + crossed
        new["S2_variance"] = cosine**2 * v2 + sine**2 * v1 - crossed
    return {name: np.asarray(new.get(name, values), np.float32) for name, values in maps.items()}
