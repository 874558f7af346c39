"""The columns of a table of measured values: their names, which go together, and what may stand in them.

docs/fit.md describes them. Units are in the names; Mueller elements alone have none, for m00 decides on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.fit_points import in_radians
from acquisition.text_table import TextTable

ANGLES = ("incidence_deg", "exit_deg", "phi_deg")
EXIT_AZIMUTH = "exit_azimuth_deg"
"""Of a run's own table: the turn of the plane of a signed exit angle, in place of phi_deg."""
STOKES = tuple(f"s{place}_per_sr" for place in range(4))
MUELLER = tuple(f"m{place // 4}{place % 4}" for place in range(16))
DOLP = ("dolp",)
ELLIPSOMETRIC = ("psi_deg", "delta_deg")
KINDS = {"Stokes": STOKES, "Mueller": MUELLER, "DoLP": DOLP, "psi": ELLIPSOMETRIC}

_NOT_FITTED = ("point", "azimuth_deg", "wavelength_nm")
"""Of a run's own table: the number of a direction, the turn of the sample, which isotropic surfaces do not show, and
the wavelength, of which there is one in a fit."""
_FROM_STOKES = (
    *("dolp", "dolp_debiased", "dolp_stderr", "aolp_deg", "aolp_stderr_deg"),
    *("docp", "docp_stderr", "dop", "dop_stderr"),
)
"""What follows from Stokes parameters, and says nothing more beside them."""
_LOWEST_INCIDENCE_DEG = -1.0
"""An arm at 0 reads back a little less; a source on the other side is another matter."""
_SURE = 5.0
"""Standard errors beyond which noise is not the reason."""
_OTHER_SIGN = 0.05
"""Sine of delta that noise about 0 or 180 degrees does not make."""


def stderr_of(column: str) -> str:
    """The column with a column's standard errors; the unit stays at the end."""
    for unit in ("_per_sr", "_deg"):
        if column.endswith(unit):
            return f"{column.removesuffix(unit)}_stderr{unit}"
    return f"{column}_stderr"


def covariance_of(one: str, other: str) -> str:
    """The column with the covariance of two Stokes parameters, or of two Mueller elements in 1/sr."""
    return f"cov_{one.removesuffix('_per_sr')}_{other.removesuffix('_per_sr')}_per_sr2"


_VALUES = tuple(column for columns in KINDS.values() for column in columns)
_COVARIANCES = tuple(
    covariance_of(one, other) for elements in (STOKES, MUELLER) for one in elements for other in elements
)
KNOWN = (*ANGLES, EXIT_AZIMUTH, *_NOT_FITTED, *_VALUES, *map(stderr_of, _VALUES), *_COVARIANCES, *_FROM_STOKES)


def picked_values(table: TextTable) -> tuple[str, tuple[str, ...]]:
    """Which kind of values a table has, and their columns in order.

    Raises
    ------
    FitError
        If there are none, or of several kinds, or columns are missing or have no place beside the others.
    """
    found = {kind: tuple(name for name in names if name in table.columns) for kind, names in KINDS.items()}
    found = {kind: names for kind, names in found.items() if names}
    if "Stokes" in found:
        found.pop("DoLP", None)
    if len(found) != 1:
        what = f"there are columns of {' and of '.join(found)} values" if found else "there is no column of values"
        if "dop" in table.columns:
            what += " (dop, with circular polarization in it, stands beside Stokes parameters only; did you mean dolp?)"
        which = "s0_per_sr, s1_per_sr, s2_per_sr; or m00 to m33; or dolp; or psi_deg, delta_deg"
        table.add(table.header_line, f"{what}; write those of one kind: {which}")
        table.check()
    kind, picked = next(iter(found.items()))
    _check_columns(table, kind, picked)
    table.check()
    return kind, picked


def _check_columns(table: TextTable, kind: str, picked: Sequence[str]) -> None:
    needed = ["incidence_deg"] if kind == "psi" else ["incidence_deg", "exit_deg"]
    needed += {"Stokes": ["s0_per_sr"], "psi": ["psi_deg"]}.get(kind, [])
    errors = [stderr_of(name) for name in picked]
    covariances = [covariance_of(one, other) for one in picked for other in picked]
    for group in (errors, covariances):
        if any(name in table.columns for name in group):
            needed += group
    useful = {*ANGLES, EXIT_AZIMUTH, *_NOT_FITTED, *picked, *errors}
    if kind in ("Stokes", "Mueller"):
        useful |= {*covariances}
    if kind == "Stokes":
        useful |= {*_FROM_STOKES}
    for name in needed:
        if name not in table.columns:
            table.add(table.header_line, f"there is no column {name}, which the others need; add it")
    for name in table.columns:
        if name not in useful:
            table.add(table.header_line, f"column {name} has no place beside {', '.join(picked)}; take it out")


def check_values(table: TextTable, kind: str, picked: Sequence[str]) -> None:
    """Note angles, values and errors that cannot be what their columns say; `TextTable.check` then refuses the file."""
    _check_angles(table)
    for name in map(stderr_of, picked):
        if name in table.columns:
            is_bad = table.columns[name] <= 0.0
            table.refuse(name, is_bad, "allowed: above 0; take all columns of errors out if nobody knows them")
    if picked[0] in (STOKES[0], MUELLER[0]):
        _check_brightness(table, picked[0])
    if kind == "Mueller":
        _check_mueller(table, picked)
    elif kind == "DoLP":
        is_bad = (table.columns["dolp"] < 0.0) | _is_above_1(table, "dolp")
        table.refuse("dolp", is_bad, "allowed: from 0 to 1, not in percent")
    elif kind == "psi":
        _check_ellipsometric(table)


def _check_angles(table: TextTable) -> None:
    incidence, exit_, phi = (table.columns.get(name) for name in ANGLES)
    assert incidence is not None, "a table without it was refused"
    lowest = _LOWEST_INCIDENCE_DEG if phi is None else 0.0
    table.refuse("incidence_deg", (incidence < lowest) | (incidence >= 90.0), "allowed: from 0 to below 90")
    if exit_ is not None and phi is None:
        table.refuse("exit_deg", np.abs(exit_) >= 90.0, "allowed: above -90 to below 90")
    if exit_ is not None and phi is not None:
        is_bad = (exit_ < 0.0) | (exit_ >= 90.0)
        table.refuse("exit_deg", is_bad, "allowed: from 0 to below 90, for phi_deg says on which side")
    if phi is not None:
        table.refuse("phi_deg", np.abs(phi) > 360.0, "allowed: from -360 to 360")
    if EXIT_AZIMUTH in table.columns:
        table.refuse(EXIT_AZIMUTH, np.abs(table.columns[EXIT_AZIMUTH]) > 360.0, "allowed: from -360 to 360")
        if phi is not None or exit_ is None:
            what = "goes with a signed exit_deg and without phi_deg, which would say the same; take one of the two out"
            table.add(table.header_line, f"column {EXIT_AZIMUTH} {what}")


def _check_brightness(table: TextTable, name: str) -> None:
    """Light is never negative; a measurement of darkness is, within its noise."""
    brightness, columns = table.columns[name], table.columns
    if (brightness <= 0.0).all() and brightness.any():
        table.add(table.header_line, f"column {name} is nowhere above 0, but light is; look at its sign")
        return
    variance = columns.get(covariance_of(name, name), columns.get(stderr_of(name), np.inf * np.ones(1)) ** 2)
    is_bad = brightness < -_SURE * np.sqrt(np.maximum(variance, 0.0))
    table.refuse(name, is_bad, "light is never below 0 by more than its noise; look at the dark signal")


def _check_mueller(table: TextTable, picked: Sequence[str]) -> None:
    if "m00" not in picked:
        what = "allowed: -1 to 1, for without m00 elements are those divided by it; add m00 if they are in 1/sr"
        for name in picked:
            table.refuse(name, _is_above_1(table, name), what)
    elif len(picked) > 1 and (table.columns["m00"] == 1.0).all():
        what = "is 1 throughout, as if the others had been divided by it; take it out if they have, for it is in 1/sr"
        table.add(table.header_line, f"column m00 {what}")


def _check_ellipsometric(table: TextTable) -> None:
    psi, delta = table.columns["psi_deg"], table.columns.get("delta_deg")
    table.refuse("psi_deg", (psi < 0.0) | (psi > 90.0), "allowed: from 0 to 90")
    if delta is not None:
        table.refuse("delta_deg", np.abs(delta) > 360.0, "allowed: from -360 to 360")
        if (np.sin(in_radians("delta_deg", delta)) < -_OTHER_SIGN).all():
            what = (
                "is that of no bare surface, which lies from 0 to 180; if it is counted for n + ik, write 360 less it"
            )
            table.add(table.header_line, f"column delta_deg {what}")


def _is_above_1(table: TextTable, name: str) -> NDArray[np.bool_]:
    """Where a value is larger than 1 in size, and its error is not the reason."""
    doubt = _SURE * table.columns[stderr_of(name)] if stderr_of(name) in table.columns else 0.0
    return np.asarray(np.abs(table.columns[name]) - doubt > 1.0)
