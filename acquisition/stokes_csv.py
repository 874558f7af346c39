"""Stokes points as a CSV file that a spreadsheet opens and that reads back to the last bit."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
# Columns with stderr are standard errors (1 sigma); cov columns are the covariance matrix of the Stokes parameters.
"""
_CONVENTIONS_OF_S3 = """\
# s3 > 0 turns clockwise for a receiver who looks at the source. docp is s3/s0, with its sign.
# dop is sqrt(s1^2 + s2^2 + s3^2)/s0, which noise makes larger.
"""
_ANGLES = ("incidence_deg", "exit_deg", "azimuth_deg")
_WAVELENGTH = "wavelength_nm"
_LINEAR = ("dolp", "dolp_debiased", "dolp_stderr", "aolp_deg", "aolp_stderr_deg")
_WITH_S3 = ("docp", "docp_stderr", "dop", "dop_stderr")


_OUT_OF_PLANE = "exit_azimuth_deg"
CONVENTIONS_OUT_OF_PLANE = """\
# exit_azimuth_deg is the turn of the plane of the exit angles out of the plane of incidence, right-handed about the
# surface normal. The s-direction is perpendicular to the plane of the exit angles.
"""


def columns(count: int, *, out_of_plane: bool = False, has_wavelength: bool = False) -> tuple[str, ...]:
    """Names of the columns for so many Stokes parameters, 3 or 4, and of directions that may lie out of the plane."""
    where = (*_ANGLES, *([_OUT_OF_PLANE] if out_of_plane else []), *([_WAVELENGTH] if has_wavelength else []))
    return ("point", *where, *_stokes(count), *_standard_errors(count), *_covariances(count), *_ratios(count))


def _stokes(count: int) -> list[str]:
    return [f"s{place}_per_sr" for place in range(count)]


def _standard_errors(count: int) -> list[str]:
    return [f"s{place}_stderr_per_sr" for place in range(count)]


def _covariances(count: int) -> list[str]:
    return [f"cov_s{one}_s{other}_per_sr2" for one in range(count) for other in range(count)]


def _ratios(count: int) -> tuple[str, ...]:
    return _LINEAR + _WITH_S3 if count == 4 else _LINEAR


def write_stokes_csv(path: Path, points: Sequence[StokesPoint]) -> None:
    """Write Stokes points, with their conventions as comment lines and the units in the column names.

    Parameters
    ----------
    path : Path
        The file; replaced as a whole if it exists.
    points : sequence of StokesPoint
        One row each, in this order; all with S3, or all without, and all with their wavelength, or none.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    with written_whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        count = len(points[0].stokes) if points else 3
        file.write(_CONVENTIONS)
        if count == 4:
            file.write(_CONVENTIONS_OF_S3)
        out_of_plane = any(point.exit_azimuth_deg is not None for point in points)
        if out_of_plane:
            file.write(CONVENTIONS_OUT_OF_PLANE)
        writer = csv.writer(file, lineterminator="\n")
        has_wavelength = any(point.wavelength_nm is not None for point in points)
        writer.writerow(columns(count, out_of_plane=out_of_plane, has_wavelength=has_wavelength))
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
    count = 4 if _stokes(4)[3] in header else 3
    names = columns(count, out_of_plane=_OUT_OF_PLANE in header, has_wavelength=_WAVELENGTH in header)
    if missing := [column for column in names if column not in header]:
        raise JournalError(f"{path} is not a table of Stokes points: it has no column {', '.join(missing)}.")
    return tuple(_point(path, number, header, row, names) for (number, _), row in zip(numbered[1:], rows, strict=True))


def _row(point: StokesPoint) -> list[str]:
    # repr of a float is the shortest text that reads back to the same bits
    numbers = [
        *(point.incidence_deg, point.exit_deg, point.azimuth_deg),
        *([] if point.exit_azimuth_deg is None else [point.exit_azimuth_deg]),
        *(() if point.wavelength_nm is None else (point.wavelength_nm,)),
        *point.stokes,
        *np.sqrt(np.diag(point.covariance)),
        *point.covariance.flat,
        *(getattr(point, name) for name in _ratios(len(point.stokes))),
    ]
    return [str(point.point), *(repr(float(number)) for number in numbers)]


def _point(path: Path, line: int, header: list[str], row: list[str], names: Sequence[str]) -> StokesPoint:
    count = 4 if _stokes(4)[3] in names else 3
    try:
        if len(row) != len(header):
            raise ValueError(f"it has {len(row)} values for {len(header)} columns")
        cell = dict(zip(header, row, strict=True))
        number = {column: float(cell[column]) for column in names[1:]}
        index = int(cell["point"])
    except ValueError as error:
        raise JournalError(f"{path}, line {line}, is damaged: {error}. Write it again from the journal.") from error
    scalars: dict[str, Any] = {name: number[name] for name in (*_ANGLES, *_ratios(count))}
    scalars[_OUT_OF_PLANE] = number.get(_OUT_OF_PLANE)
    return StokesPoint(
        point=index,
        wavelength_nm=number.get(_WAVELENGTH),
        **scalars,
        stokes=np.array([number[column] for column in _stokes(count)]),
        covariance=np.array([number[column] for column in _covariances(count)]).reshape(count, count),
    )
