"""Groups and fields of a NeXus file, as its manual wants them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from collections.abc import Sequence

    import h5py

    from acquisition.readings import StokesPoint


EXIT_AZIMUTH = "turn of the plane of the exit angles out of the plane of incidence, right-handed about the normal"
"""What the field exit_azimuth is called on a plot's axis."""


def group(parent: h5py.Group, name: str, nexus_class: str) -> h5py.Group:
    """Add a group of a NeXus class."""
    made = parent.create_group(name)
    made.attrs["NX_class"] = nexus_class
    return made


def field(parent: h5py.Group, name: str, values: ArrayLike, units: str, long_name: str | None = None) -> h5py.Dataset:
    """Add numbers with their units, and with a name for a plot's axis."""
    dataset = parent.create_dataset(name, data=values)
    dataset.attrs["units"] = units
    if long_name is not None:
        dataset.attrs["long_name"] = long_name
    return dataset


def where(group: h5py.Group, points: Sequence[StokesPoint]) -> None:
    """Add the directions of points to NXdata, and their wavelengths where these differ, each as an axis of its rows."""
    field(group, "exit_angle", [point.exit_deg for point in points], "deg", "signed exit angle")
    field(group, "incidence_angle", [point.incidence_deg for point in points], "deg")
    field(group, "sample_azimuth", [point.azimuth_deg for point in points], "deg")
    axes = ["exit_angle", "incidence_angle", "sample_azimuth"]
    if any(point.exit_azimuth_deg is not None for point in points):
        field(group, "exit_azimuth", [point.exit_azimuth_deg or 0.0 for point in points], "deg", EXIT_AZIMUTH)
        axes.append("exit_azimuth")
    wavelength_nm = np.array([point.wavelength_nm for point in points], float)  # NaN where nobody says so
    if len(np.unique(wavelength_nm)) > 1:
        field(group, "wavelength", wavelength_nm, "nm")
        axes.append("wavelength")
    for axis in axes:
        group.attrs[f"{axis}_indices"] = 0
