"""How maps are stored in a NeXus file: in which group, under which name and in which unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acquisition.imaging.maps.direction_maps import DirectionMaps, Map
from acquisition.imaging.place.map_grid import MapGrid
from acquisition.nexus_fields import field

if TYPE_CHECKING:
    import h5py

DIMENSIONLESS = ""
"""The units attribute of a ratio or a count, as the NeXus manual writes it."""


class Kind(NamedTuple):
    """How a map is stored: in which NXdata, under which name and unit; as a root, if it is a variance; from rad."""

    group: str
    field: str
    units: str
    long_name: str | None = None
    is_variance: bool = False
    is_in_rad: bool = False

    @property
    def is_signal(self) -> bool:
        """Whether viewers plot it, and do not only draw its errors."""
        return self.field in ("S0", "S1", "S2", "S3", "DoLP", "AoLP")

    def stored(self, values: Map) -> Map:
        """Values as the file has them."""
        values = np.sqrt(values) if self.is_variance else values
        return np.degrees(values) if self.is_in_rad else values


def kinds(maps: DirectionMaps) -> dict[str, Kind]:
    """How each map is stored, by its name, whether it is there or not."""
    unit, squared = ("1/sr", "1/sr^2") if maps.is_calibrated else (DIMENSIONLESS, DIMENSIONLESS)
    stored = {}
    for name, long_name in _STOKES.items():
        stored[name] = Kind("maps", name, unit, long_name)
        stored[f"{name}_variance"] = Kind("maps", f"{name}_errors", unit, is_variance=True)
    for name in maps.maps:
        if name.endswith("_covariance"):
            stored[name] = Kind("maps", name, squared)
    return stored | _RATIOS


_STOKES = {
    "S0": "S0 per unit irradiance",
    "S1": "S1 per unit irradiance: s-polarized less p-polarized light",
    "S2": "S2 per unit irradiance: polarized at +45 degrees from the s-direction less -45 degrees",
    "S3": "S3 per unit irradiance: circular, clockwise for a receiver who looks at the source, less counterclockwise",
}
_RATIOS = {
    "DoLP": Kind("maps_dolp", "DoLP", DIMENSIONLESS, "degree of linear polarization"),
    "DoLP_variance": Kind("maps_dolp", "DoLP_errors", DIMENSIONLESS, is_variance=True),
    "AoLP_rad": Kind("maps_aolp", "AoLP", "deg", "angle of polarization from the s-direction", is_in_rad=True),
    "AoLP_rad_variance": Kind("maps_aolp", "AoLP_errors", "deg", is_variance=True, is_in_rad=True),
}
OWN_DIRECTIONS = {
    "polar_deg": Kind("maps", "pixel_exit_angle", "deg", "of the pixel's own exit direction, from the normal"),
    "phi_deg": Kind("maps", "pixel_azimuth", "deg", "of the pixel's own exit direction, from the source"),
    "s_turn_deg": Kind("maps", "pixel_s_direction", "deg", "of the pixel's own exit direction, from the optical axis'"),
}
"""How the pixels' exit directions are stored, by the names of `PixelDirections`."""


def write_pixels(group: h5py.Group, grid: MapGrid | None, shape: tuple[int, ...]) -> None:
    """Add the axes y and x of maps to NXdata: centres of pixels in mm, or numbers of a camera's rows and columns."""
    if grid is None:
        field(group, "y", np.arange(shape[0], dtype=np.float64), "pixel", "row")
        field(group, "x", np.arange(shape[1], dtype=np.float64), "pixel", "column")
        return
    field(group, "y", grid.y_mm(), "mm", "towards the source at azimuth 0 (mm)")
    field(group, "x", grid.x_mm(), "mm", "along the s-direction at azimuth 0 (mm)")
