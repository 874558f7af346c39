"""Maps of the sample, as seen from one direction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.place.map_grid import MapGrid
from model.geometry import FloatArray, Rotation

Map = NDArray[np.float32]
STOKES = ("S0", "S1", "S2", "S3")


@dataclass(frozen=True, eq=False)
class PixelDirections:
    """Where the camera stands, as seen from every pixel, all (height, width) and in degrees.

    Parameters
    ----------
    polar_deg : ndarray
        Angle from the surface normal, 0 to below 90.
    phi_deg : ndarray
        Azimuth from the source, right-handed about the normal: 180 on the mirror side (docs/conventions.md).
    s_turn_deg : ndarray
        Where the pixel's own s-direction, the normal × the way to the camera, stands in the frame in which the maps'
        Stokes parameters are given, counterclockwise in the picture; 0 where they are given in the pixel's own.
    """

    polar_deg: Map
    phi_deg: Map
    s_turn_deg: Map

    @classmethod
    def from_radians(
        cls, exit_rad: FloatArray, azimuth_rad: FloatArray, to_exit_frame: Rotation[FloatArray]
    ) -> PixelDirections:
        """From what the model counts with, and the rotation onto each pixel's own frame from that of the maps."""
        turn_rad = 0.5 * np.arctan2(to_exit_frame.sin2, to_exit_frame.cos2)
        return cls(*(np.degrees(angle).astype(np.float32) for angle in (exit_rad, azimuth_rad, turn_rad)))


@dataclass(frozen=True, eq=False)
class DirectionMaps:
    """What is known of every pixel in one direction; NaN where nothing is.

    Parameters
    ----------
    point : int
        Which of the scan's directions.
    incidence_deg, exit_deg, azimuth_deg : float
        Incidence, signed exit angle of the optical axis, and the sample's azimuth, as read back.
    exit_azimuth_deg : float or None
        The detector arm's turn out of the plane of incidence; None on a bench that cannot turn it.
    grid : MapGrid or None
        The pixels in the sample's coordinates; None where they are the camera's own.
    maps : mapping of str to ndarray
        (height, width) of float32 by name: `S0` to `S3`, their `_variance`s, `S0_S1_covariance` and the like, with the
        lower number first; `DoLP`, `DoLP_variance`, `AoLP_rad`, `AoLP_rad_variance`. AoLP, S1 and S2 count from the
        picture's right, the s-direction of the optical axis. Empty where there is no map of this direction.
    is_calibrated : bool
        Whether Stokes parameters are in 1/sr; otherwise they are relative, alike for all directions.
    pixel_directions : PixelDirections, optional
        The pixels' own, where perspective makes them differ from that of the optical axis.
    noise_area_px : float
        Over how many pixels noise is alike: sum of the correlation coefficients of one pixel's noise with that of all,
        1 for a camera's own pixels, more where maps are interpolated. The mean of N >> this has its variance
        multiplied by it.
    notes : tuple of str
        What a person should know of these maps, such as why there are none.
    """

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    exit_azimuth_deg: float | None
    grid: MapGrid | None
    maps: Mapping[str, Map] = field(default_factory=dict)
    is_calibrated: bool = True
    pixel_directions: PixelDirections | None = None
    noise_area_px: float = 1.0
    notes: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int] | None:
        """Height and width in pixels; None where there is neither a map nor a grid."""
        for one in self.maps.values():
            height, width = one.shape
            return height, width
        return None if self.grid is None else (self.grid.height, self.grid.width)

    @property
    def stokes_names(self) -> tuple[str, ...]:
        """The Stokes parameters that there are maps of."""
        return tuple(name for name in STOKES if name in self.maps)
