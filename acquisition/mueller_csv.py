"""Mueller matrices as a CSV file that a spreadsheet opens and `goniometer fit` reads."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition.measured_columns import EXIT_AZIMUTH, covariance_of, stderr_of
from acquisition.readings import MuellerPoint
from acquisition.stokes_csv import CONVENTIONS_OUT_OF_PLANE
from acquisition.whole_file import written_whole

_CONVENTIONS = """\
# Elements of the Mueller matrix in 1/sr, per unit irradiance on the sample, one direction a row: m12 says how much S1
# leaves for S2 that arrives. Elements that were not measured have no column.
# Angles are in degrees, from the surface normal. exit_deg is signed: positive on the mirror (forward) side,
# negative on the side of the source. azimuth_deg is the turn of the sample stage.
# Both frames look along their rays: S1 > 0 is s-polarized light, perpendicular to the plane of incidence; S2 > 0 is
# polarized at +45 degrees from s towards p; S3 > 0 turns clockwise for a receiver who looks at the source.
# Columns with stderr are standard errors (1 sigma); cov columns are the covariance matrix of the elements.
"""


def write_mueller_csv(path: Path, points: Sequence[MuellerPoint]) -> None:
    """Write Mueller matrices, with their conventions as comment lines.

    Parameters
    ----------
    path : Path
        The file; replaced as a whole if it exists.
    points : sequence of MuellerPoint
        One row each, in this order; at least one, and all of the same elements.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    rows, columns = points[0].mueller.shape
    names = [f"m{row}{column}" for row in range(rows) for column in range(columns)]
    covariances = [covariance_of(one, other) for one in names for other in names]
    with written_whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        file.write(_CONVENTIONS)
        out_of_plane = any(point.exit_azimuth_deg is not None for point in points)
        where_columns = ["incidence_deg", "exit_deg", "azimuth_deg"]
        if out_of_plane:
            file.write(CONVENTIONS_OUT_OF_PLANE)
            where_columns.append(EXIT_AZIMUTH)
        if any(point.wavelength_nm is not None for point in points):
            where_columns.append("wavelength_nm")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["point", *where_columns, *names, *map(stderr_of, names), *covariances])
        for point in points:
            elements, covariance = point.mueller.ravel(), point.mueller_covariance
            where = [point.point, *(getattr(point, name) for name in where_columns)]
            stderr = np.sqrt(np.diagonal(covariance))
            writer.writerow([*where, *elements.tolist(), *stderr.tolist(), *covariance.ravel().tolist()])
