"""Measured values out of a table of text: Stokes parameters, Mueller elements, DoLP, or psi and delta."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition.fit_points import directions, in_radians
from acquisition.measured_columns import (
    EXIT_AZIMUTH,
    KINDS,
    KNOWN,
    check_values,
    covariance_of,
    picked_values,
    stderr_of,
)
from acquisition.text_table import TextTable, read_table
from model.fit import Dataset
from model.fit.dataset import is_positive_definite
from model.fit.ellipsometric import Ellipsometric, wrapped
from model.fit.observable import MUELLER, STOKES, Dolp, Elements, Observable, Ratios
from model.geometry import FloatArray

_ROUNDING = 1e-6
"""Relative difference of what must be equal, in files that were written with few digits."""


def read_measured_csv(path: Path) -> Dataset:
    """Read a table of measured values; docs/fit.md describes its columns.

    Parameters
    ----------
    path : Path
        The table; a run's own stokes.csv, or anybody's.

    Returns
    -------
    Dataset
        Named by the file; without covariances if the table has no standard errors.

    Raises
    ------
    JournalError
        If the file cannot be read.
    FitError
        If anything in it cannot be used; lists what, with lines. Nothing is left out.
    """
    table = read_table(path, KNOWN)
    kind, picked = picked_values(table)
    check_values(table, kind, picked)
    covariance = _covariance(table, picked)
    if "wavelength_nm" in table.columns and np.ptp(table.columns["wavelength_nm"]) > 0.0:
        what = "column wavelength_nm holds several, and a surface has one refractive index in a fit; leave one"
        table.add(table.header_line, what)
    table.check()
    given = table.columns
    # Ellipsometry is done in the mirror direction where nobody says otherwise.
    where = directions(
        given["incidence_deg"],
        given.get("exit_deg", given["incidence_deg"]),
        given.get("phi_deg"),
        exit_azimuth_deg=given.get(EXIT_AZIMUTH, 0.0),
    )
    values = np.stack([in_radians(name, given[name]) for name in picked], axis=1)
    if "delta_deg" in picked:
        values[:, 1] = wrapped(values[:, 1])
    lines = np.array(table.lines)
    return Dataset(*where, values, covariance, _observable(kind, picked), name=path.name, lines=lines)


def _covariance(table: TextTable, picked: Sequence[str]) -> FloatArray | None:
    """Covariance (rows, M, M), from its own columns or from standard errors; None without both."""
    given, width = table.columns, len(picked)
    stderr = None
    if stderr_of(picked[0]) in given:
        stderr = np.stack([in_radians(stderr_of(name), given[stderr_of(name)]) for name in picked], axis=1)
    if covariance_of(picked[0], picked[0]) not in given:
        return None if stderr is None else stderr[:, :, None] ** 2 * np.eye(width)
    columns = [given[covariance_of(one, other)] for one in picked for other in picked]
    covariance = np.stack(columns, axis=1).reshape(-1, width, width)
    variances = np.diagonal(covariance, axis1=1, axis2=2)
    mirrored = np.isclose(covariance, covariance.swapaxes(1, 2), rtol=_ROUNDING, atol=0.0)
    faults = {
        "columns cov: the covariance of a pair is not that of the same pair the other way round": ~mirrored.all((1, 2)),
        "columns cov: these are no covariances, for a sum of the values would have no error": (
            ~is_positive_definite(covariance)
        ),
    }
    if stderr is not None:
        same = np.isclose(stderr**2, variances, rtol=_ROUNDING, atol=0.0)
        faults["the columns stderr are not the roots of the columns cov; take one of the two out"] = ~same.all(1)
    for what, is_bad in faults.items():
        for row in np.flatnonzero(is_bad):
            table.add(table.lines[row], what)
    return covariance


def _observable(kind: str, picked: Sequence[str]) -> Observable:
    if kind == "DoLP":
        return Dolp()
    if kind == "psi":
        return Ellipsometric(has_delta=len(picked) > 1)
    places, elements = tuple(map(KINDS[kind].index, picked)), STOKES if kind == "Stokes" else MUELLER
    return Elements(places, elements) if 0 in places else Ratios(places, elements)
