"""Groups and fields of a NeXus file, as its manual wants them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import h5py


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
