"""What a NeXus file says of a scan behind a polarization state generator: its settings, and the Mueller matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.mueller_point import lowest_eigenvalue
from acquisition.nexus_fields import field, where
from acquisition.nexus_fields import group as add_group
from acquisition.readings import MuellerPoint, Reading, StokesPoint

if TYPE_CHECKING:
    import h5py

_DIMENSIONLESS = ""
_FROM_S = "of the light on the sample, from the s-direction"


def write_generator(instrument: h5py.Group, raw: h5py.Group, readings: Sequence[Reading]) -> None:
    """Write what the light had passed before the sample, as columns of the readings; nothing without a generator."""
    if all(reading.generator_deg is None for reading in readings):
        return

    def column(name: str) -> list[float]:
        values = (getattr(reading, name) for reading in readings)
        return [np.nan if value is None else value for value in values]

    generator = add_group(instrument, "generator", "NXoptical_polarizer")
    generator["type"] = "linear"
    generator["description"] = "in the source arm; where there is a retarder, light passes it behind the polarizer"
    generator["polarizer_angle"] = field(
        raw, "generator_polarizer_angle", column("generator_deg"), "deg", f"polarizer {_FROM_S}"
    )
    slots = [-1 if reading.generator_slot is None else reading.generator_slot for reading in readings]
    field(raw, "generator_slot", np.array(slots, int), _DIMENSIONLESS, "-1 where any will do")
    if any(reading.generator_retarder_deg is not None for reading in readings):
        retarder = add_group(instrument, "generator_retarder", "NXwaveplate")
        retarder["fast_axis_angle"] = field(
            raw, "generator_fast_axis_angle", column("generator_retarder_deg"), "deg", f"fast axis {_FROM_S}"
        )
        retarder["retardance"] = field(raw, "generator_retardance", column("generator_retardance_deg"), "deg")


def write_mueller(entry: h5py.Group, points: Sequence[StokesPoint]) -> None:
    """Write the matrices over the exit angle; nothing where only Stokes parameters were measured."""
    measured = [point for point in points if isinstance(point, MuellerPoint)]
    if not measured:
        return
    group = add_group(entry, "mueller", "NXdata")
    group.attrs.update(signal="M", axes=["exit_angle", "row", "column"])
    rows, columns = measured[0].mueller.shape
    covariance = np.array([point.mueller_covariance for point in measured])
    stderr = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)).reshape(-1, rows, columns)
    field(group, "M", [point.mueller for point in measured], "1/sr", "Mueller matrix per unit irradiance")
    field(group, "M_errors", stderr, "1/sr")
    field(group, "covariance", covariance, "1/sr^2", "covariance matrix of the elements, row by row")
    where(group, measured)
    field(group, "row", np.arange(rows), _DIMENSIONLESS, "Stokes parameter of the light that leaves the sample")
    field(group, "column", np.arange(columns), _DIMENSIONLESS, "Stokes parameter of the light on the sample")
    if (rows, columns) == (4, 4):
        lowest = np.array([lowest_eigenvalue(point) for point in measured])
        what = "smallest eigenvalue of the coherency matrix, not below 0 but by noise"
        field(group, "lowest_eigenvalue", lowest[:, 0], "1/sr", what)
        field(group, "lowest_eigenvalue_errors", lowest[:, 1], "1/sr")
    group.attrs["row_indices"], group.attrs["column_indices"] = 1, 2
