"""Stokes points as a CSV file that a spreadsheet opens and that reads back to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition.readings import StokesPoint
from acquisition.whole_file import written_whole
from goniometer.errors import JournalError

_CONVENTIONS = """\
# Stokes parameters of the light that leaves the sample, per unit irradiance on it, one direction a row.
# Angles are in degrees, from the surface normal. exit_deg is signed: positive on the mirror (forward) side,
# negative on the side of the source. azimuth_deg is the turn of the sample stage.
# s1 > 0 is s-polarized light: perpendicular to the plane of incidence. s2 > 0 is polarized at +45 degrees from s.
# aolp_deg is in (-90, 90], from the s-direction.
# dolp is sqrt(s1^2 + s2^2)/s0; dolp_debiased is without the bias of noise.
# Columns with stderr are standard errors (1 sigma); cov columns are the covariance matrix of (s0, s1, s2).
"""
_ANGLES = ("incidence_deg", "exit_deg", "azimuth_deg")
_STOKES = ("s0_per_sr", "s1_per_sr", "s2_per_sr")
_STANDARD_ERRORS = ("s0_stderr_per_sr", "s1_stderr_per_sr", "s2_stderr_per_sr")
_COVARIANCES = tuple(f"cov_s{i}_s{j}_per_sr2" for i in range(3) for j in range(3))
_POLARIZATION = ("dolp", "dolp_debiased", "dolp_stderr", "aolp_deg", "aolp_stderr_deg")
COLUMNS = ("point", *_ANGLES, *_STOKES, *_STANDARD_ERRORS, *_COVARIANCES, *_POLARIZATION)


def write_stokes_csv(path: Path, points: Sequence[StokesPoint]) -> None:
    """Write Stokes points, with their conventions as comment lines and the units in the column names.

    Parameters
    ----------
    path : Path
        The file; replaced as a whole if it exists.
    points : sequence of StokesPoint
        One row each, in this order.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    with written_whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        file.write(_CONVENTIONS)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(_row(point) for point in points)


def read_stokes_csv(path: Path) -> tuple[StokesPoint, ...]:
    """Read what `write_stokes_csv` wrote; every number comes back exactly.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    tuple of StokesPoint
        The rows, in the file's order.

    Raises
    ------
    JournalError
        The file cannot be read, a column is missing or a row is damaged.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise JournalError(f"The table of Stokes points {path} cannot be read: {error}.") from error
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if not line.startswith("#")]
    rows = csv.reader(line for _, line in numbered)
    header = next(rows, [])
    if missing := [column for column in COLUMNS if column not in header]:
        raise JournalError(f"{path} is not a table of Stokes points: it has no column {', '.join(missing)}.")
    return tuple(_point(path, number, header, row) for (number, _), row in zip(numbered[1:], rows, strict=True))


def _row(point: StokesPoint) -> list[str]:
    # repr of a float is the shortest text that reads back to the same bits
    numbers = [
        *(point.incidence_deg, point.exit_deg, point.azimuth_deg),
        *point.stokes,
        *np.sqrt(np.diag(point.covariance)),
        *point.covariance.flat,
        *(point.dolp, point.dolp_debiased, point.dolp_stderr, point.aolp_deg, point.aolp_stderr_deg),
    ]
    return [str(point.point), *(repr(float(number)) for number in numbers)]


def _point(path: Path, line: int, header: list[str], row: list[str]) -> StokesPoint:
    try:
        if len(row) != len(header):
            raise ValueError(f"it has {len(row)} values for {len(header)} columns")
        cell = dict(zip(header, row, strict=True))
        number = {column: float(cell[column]) for column in COLUMNS[1:]}
        index = int(cell["point"])
    except ValueError as error:
        raise JournalError(f"{path}, line {line}, is damaged: {error}. Write it again from the journal.") from error
    return StokesPoint(
        point=index,
        **{name: number[name] for name in (*_ANGLES, *_POLARIZATION)},
        stokes=np.array([number[column] for column in _STOKES]),
        covariance=np.array([number[column] for column in _COVARIANCES]).reshape(3, 3),
    )
