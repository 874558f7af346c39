"""Fits of map pixels in a NeXus file."""

from __future__ import annotations

import importlib.metadata
from typing import TYPE_CHECKING

import numpy as np

from acquisition.imaging.maps.nexus_map_fields import DIMENSIONLESS, write_pixels
from acquisition.imaging.maps.pixel_fits import MaterialMaps
from acquisition.nexus_fields import field, group
from model.many_fits.result import Status

if TYPE_CHECKING:
    import h5py


def write_materials(entry: h5py.Group, found: MaterialMaps) -> None:
    """Write the NXprocess `material_maps`: for each parameter NXdata with its errors, and how well fits fit.

    Parameters
    ----------
    entry : h5py.Group
        The file's NXentry.
    found : MaterialMaps
        Fits of map pixels; NaN where there is none, with a number in `status` that its attribute explains.
    """
    process = group(entry, "material_maps", "NXprocess")
    process["program"] = "goniometer"
    process["version"] = importlib.metadata.version("goniometer")
    process["notes"] = " ".join(found.notes)
    field(process, "block", found.bin_px, "pixel")
    for name, values in found.parameters.items():
        units = "deg" if name.endswith("_deg") else "1/sr" if name.endswith("_per_sr") else DIMENSIONLESS
        data = _plane_group(process, name, found)
        field(data, name, values, units)
        field(data, f"{name}_errors", found.stderr[name], units)
        field(data, "at_bound", found.at_bound[name].astype(np.uint8), DIMENSIONLESS)
    for name, counts in (("degrees_of_freedom", found.degrees_of_freedom), ("directions", found.directions)):
        data = _plane_group(process, name, found)
        field(data, name, counts, DIMENSIONLESS)
    field(_plane_group(process, "chi_square", found), "chi_square", found.chi_square, DIMENSIONLESS)
    status = field(_plane_group(process, "status", found), "status", found.status, DIMENSIONLESS)
    status.attrs["meaning"] = [f"{one.value}: {one.name.lower()}" for one in Status]
    process.attrs["default"] = next(iter(found.parameters), "chi_square")


def _plane_group(process: h5py.Group, name: str, found: MaterialMaps) -> h5py.Group:
    data = group(process, name, "NXdata")
    data.attrs.update(signal=name, axes=["y", "x"], y_indices=0, x_indices=1)
    write_pixels(data, found.grid, found.status.shape)
    return data
