"""A stored run as an `xarray.Dataset`: every value with its dimensions, coordinates, unit and meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.fit_points import in_degrees
from acquisition.readings import MuellerPoint, Reading, StokesPoint
from goniometer.directions import Directions, directions_of
from goniometer.errors import ConfigurationError
from goniometer.run_folder import StoredRun, stored_run

if TYPE_CHECKING:
    import xarray

Variable = tuple[Sequence[str], NDArray[Any], dict[str, str]]
"""Dimensions, values and attributes."""

_UNITS = {"_per_sr2": "sr-2", "_per_sr": "sr-1", "_deg": "degree", "_nm": "nm", "_s": "s", "_w": "W"}
"""By the end of a name; what ends otherwise is a ratio, a count or a word."""
_LONG_NAMES = {
    "stokes": "Stokes component of the light that leaves the sample",
    "stokes_2": "Stokes component, of the other one of a covariance",
    "incoming": "Stokes component of the light on the sample",
    "incoming_2": "Stokes component of the light on the sample, of the other one of a covariance",
    "mueller_per_sr": "Mueller matrix per unit irradiance: light that leaves the sample of light that arrives",
    "mueller_stderr_per_sr": "standard error of the Mueller matrix",
    "mueller_covariance_per_sr2": "covariance of the elements of the Mueller matrix",
    "incidence_deg": "angle of incidence from the surface normal",
    "exit_deg": "exit angle from the surface normal, above 0 on the mirror side",
    "azimuth_deg": "turn of the sample about its normal",
    "exit_azimuth_deg": "turn of the plane of the exit angle out of the plane of incidence, right-handed about the "
    "surface normal",
    "wavelength_nm": "wavelength of the light",
    "point": "number of the direction in the scan",
    "stokes_per_sr": "Stokes parameters per unit irradiance; above 0 S1 is s-polarized, S2 at +45 degrees from s, S3 "
    "turns clockwise for the receiver",
    "stokes_stderr_per_sr": "standard error of the Stokes parameters",
    "stokes_covariance_per_sr2": "covariance of the Stokes parameters",
    "stokes_fit_per_sr": "Stokes parameters of the fitted model; NaN for a component that it does not give",
    "dolp": "degree of linear polarization",
    "dolp_debiased": "degree of linear polarization without the bias of noise",
    "dolp_stderr": "standard error of the degree of linear polarization",
    "aolp_deg": "angle of linear polarization from the s-direction",
    "aolp_stderr_deg": "standard error of the angle of linear polarization",
    "docp": "degree of circular polarization, S3/S0: above 0 turns clockwise for the receiver",
    "docp_stderr": "standard error of the degree of circular polarization",
    "dop": "degree of polarization, linear and circular together",
    "dop_stderr": "standard error of the degree of polarization",
    "parameter": "parameter of the fitted model",
    "parameter_2": "parameter of the fitted model, the other one of a correlation",
    "fit_value": "fitted value, in the unit that the parameter's name ends in",
    "fit_stderr": "standard error of the fitted value; NaN at a bound",
    "fit_at_bound": "whether the parameter ended at a bound",
    "fit_correlation": "correlation of the fitted values; NaN at a bound",
    "chi_square": "sum of the squared residuals of the fit, in standard deviations",
    "degrees_of_freedom": "values fitted less free parameters",
    "reading_kind": "signal, dark or reference",
    "reading_analyzer_deg": "angle of the analyzer from the s-direction; NaN without a polarizer",
    "reading_retarder_deg": "angle of the fast axis of a retarder before the analyzer; NaN without one",
    "reading_retardance_deg": "retardance of a retarder before the analyzer; NaN without one",
    "reading_analyzer_sweep_deg": "how far the analyzer turned during the exposure",
    "reading_retarder_sweep_deg": "how far the retarder before the analyzer turned during the exposure",
    "reading_generator_slot": "slot of the generator",
    "reading_generator_deg": "angle of the generator's polarizer from the s-direction",
    "reading_generator_retarder_deg": "angle of the fast axis of the retarder behind the generator's polarizer",
    "reading_generator_retardance_deg": "retardance of the retarder behind the generator's polarizer",
    "reading_power_w": "optical power",
    "reading_time_s": "time on the bench's clock",
}

_OF_FIT = (
    *("stokes_fit_per_sr", "fit_value", "fit_stderr", "fit_at_bound", "fit_correlation", "chi_square"),
    *("degrees_of_freedom", "parameter", "parameter_2"),
)
"""What there is of a fit alone."""


def load(run: str | Path) -> xarray.Dataset:
    """Read a run back with labelled dimensions: Stokes points and their fit, and the raw readings beside them.

    Parameters
    ----------
    run : str or Path
        The run's folder, of a finished scan or of one that was cut short, or the journal in it.

    Returns
    -------
    xarray.Dataset
        Directions have the dimension `exit_deg`, and `incidence_deg`, `azimuth_deg` and `exit_azimuth_deg` where these
        take several values; when not every combination was measured exactly once, they have the one dimension `point`.
        Several wavelengths are the dimension `wavelength_nm`, outside of all others, also of the fits. Stokes
        parameters have the dimension `stokes` besides, raw readings `reading`, fitted parameters `parameter`. Every
        variable has the attribute `long_name`, and `units` unless it holds words; recipe, rig, scene and versions are
        attributes of the dataset. What was nowhere measured is no variable. When the points could not be fitted, the
        attribute `fit_refusal` says why.

    Raises
    ------
    ConfigurationError
        When xarray is not installed.
    JournalError
        When there is no readable journal.
    ReductionError
        When the readings cannot be reduced, or no direction was finished.
    """
    try:
        import xarray  # noqa: F401 (asked for before anything is read)
    except ImportError as error:
        raise ConfigurationError(
            [
                "goniometer.load returns an xarray.Dataset, and xarray is not installed. Nothing was read. "
                "Run: pip install 'goniometer[xarray]', or read the run's stokes.csv."
            ]
        ) from error
    stored = stored_run(run)
    if len(stored.spectrum) > 1:
        each = [_of_one(one) for one in stored.spectrum]
        together = _along_wavelengths(each, len(stored.recipe.directions_deg()))
        if together is not None:
            return together.assign(_readings(stored.readings)).assign_attrs(_attributes(stored))
    return _of_one(stored).assign(_readings(stored.readings)).assign_attrs(_attributes(stored))


def _along_wavelengths(of_each: Sequence[xarray.Dataset], directions: int) -> xarray.Dataset | None:
    """Datasets at one wavelength each, joined to one with a dimension more; None where their directions differ.

    Points are numbered through: the recipe has so many `directions` at each wavelength.
    """
    import xarray

    fits = {name for one in of_each for name in one.variables if name in _OF_FIT}
    if any(not fits <= set(one.variables) for one in of_each):
        of_each = [one.drop_vars([name for name in fits if name in one.variables]) for one in of_each]
    numbers = [one["point"].to_numpy() % directions for one in of_each]
    if any(not np.array_equal(other, numbers[0]) for other in numbers):
        return None
    return xarray.concat(
        of_each,
        dim="wavelength_nm",
        data_vars="all",
        coords=["point", "wavelength_nm"],
        join="override",
        compat="override",
        combine_attrs="override",
    )


def _of_one(stored: StoredRun) -> xarray.Dataset:
    """Points and fit of a run; at several wavelengths without a fit, and along single points."""
    import xarray

    tolerances_deg = {role: axis.tolerance_deg for role, axis in stored.rig.axes().items()}
    directions = directions_of(stored.points, tolerances_deg)
    wavelengths_nm = stored.recipe.wavelengths_nm()
    components = [f"S{place}" for place in range(stored.points[0].stokes.size)]
    coordinates: dict[str, Variable] = {
        **{name: _labelled(name, dims, values) for name, (dims, values) in directions.coordinates.items()},
        "stokes": _labelled("stokes", ["stokes"], components),
        "stokes_2": _labelled("stokes_2", ["stokes_2"], components),
        "wavelength_nm": _labelled("wavelength_nm", [], wavelengths_nm[0]),
    }
    if isinstance(stored.points[0], MuellerPoint):
        incoming = [f"S{place}" for place in range(stored.points[0].mueller.shape[1])]
        for name in ("incoming", "incoming_2"):
            coordinates[name] = _labelled(name, [name], incoming)
    if len(wavelengths_nm) > 1:
        at_nm = [point.wavelength_nm for point in stored.points]
        coordinates["wavelength_nm"] = _labelled("wavelength_nm", ["point"], np.array(at_nm, float))
    if stored.fit is not None:
        for name in ("parameter", "parameter_2"):
            coordinates[name] = _labelled(name, [name], list(in_degrees(stored.fit).parameters))
    return xarray.Dataset(_points(stored, directions) | _fit(stored), coordinates)


def _points(run: StoredRun, directions: Directions) -> dict[str, Variable]:
    stokes = np.array([point.stokes for point in run.points])
    covariance = np.array([point.covariance for point in run.points])
    vectors: dict[str, NDArray[Any]] = {
        "stokes_per_sr": stokes,
        "stokes_stderr_per_sr": np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        "stokes_covariance_per_sr2": covariance,
    }
    if run.fit is not None:
        fitted = vectors["stokes_fit_per_sr"] = np.full_like(stokes, np.nan)
        fitted[:, : run.fit.stokes.shape[1]] = run.fit.stokes[:, : stokes.shape[1]]
    is_placed = {"stokes", "covariance", "point", "wavelength_nm", *directions.angles}
    vectors |= {name: values for name, values in _columns(StokesPoint, run.points).items() if name not in is_placed}
    inner = ("stokes", "stokes_2")
    return {
        name: _labelled(name, [*directions.dimensions, *inner[: values.ndim - 1]], directions.arranged(values))
        for name, values in vectors.items()
    } | _mueller(run.points, directions)


def _mueller(points: Sequence[StokesPoint], directions: Directions) -> dict[str, Variable]:
    measured = [point for point in points if isinstance(point, MuellerPoint)]
    if not measured:
        return {}
    matrix = np.array([point.mueller for point in measured])
    rows, columns = matrix.shape[1:]
    covariance = np.array([point.mueller_covariance for point in measured]).reshape(-1, *(rows, columns) * 2)
    stderr = np.sqrt(np.einsum("nijij->nij", covariance))
    named = {"mueller_per_sr": matrix, "mueller_stderr_per_sr": stderr, "mueller_covariance_per_sr2": covariance}
    inner = ("stokes", "incoming", "stokes_2", "incoming_2")
    return {
        name: _labelled(name, [*directions.dimensions, *inner[: values.ndim - 1]], directions.arranged(values))
        for name, values in named.items()
    }


def _fit(run: StoredRun) -> dict[str, Variable]:
    if run.fit is None:
        return {}
    shown = in_degrees(run.fit)
    names, estimates = list(shown.parameters), list(shown.parameters.values())
    correlation = np.full((len(names), len(names)), np.nan)
    known = [names.index(name) for name in shown.names]
    correlation[np.ix_(known, known)] = shown.correlation
    values: dict[str, ArrayLike] = {
        "fit_value": [estimate.value for estimate in estimates],
        "fit_stderr": [np.nan if estimate.stderr is None else estimate.stderr for estimate in estimates],
        "fit_at_bound": [estimate.at_bound for estimate in estimates],
        "fit_correlation": correlation,
        "chi_square": shown.chi_square,
        "degrees_of_freedom": shown.degrees_of_freedom,
    }
    inner = ("parameter", "parameter_2")
    return {name: _labelled(name, inner[: np.ndim(value)], value) for name, value in values.items()}


def _readings(readings: Sequence[Reading]) -> dict[str, Variable]:
    names = {f"reading_{name}": values for name, values in _columns(Reading, readings).items()}
    return {name: _labelled(name, ["reading"], values) for name, values in names.items()}


def _columns(kind: type[Reading | StokesPoint], rows: Sequence[Reading | StokesPoint]) -> dict[str, NDArray[Any]]:
    """The fields of rows by name, NaN where one has no value; a field that no row has a value of is left out."""
    columns = {field.name: [getattr(row, field.name) for row in rows] for field in fields(kind)}
    return {
        name: np.array([np.nan if value is None else value for value in values])
        for name, values in columns.items()
        if any(value is not None for value in values)
    }


def _attributes(run: StoredRun) -> Mapping[str, str]:
    refusal = {"fit_refusal": run.refusal} if run.refusal else {}
    return {"title": run.recipe.recipe, "folder": str(run.folder), **refusal, **run.about}


def _labelled(name: str, dimensions: Sequence[str], values: ArrayLike) -> Variable:
    array = np.asarray(values)
    units = next((unit for end, unit in _UNITS.items() if name.endswith(end)), "1")
    is_word = array.dtype.kind in "UO"
    plain = name.removeprefix("reading_")
    long_name = _LONG_NAMES.get(name) or _LONG_NAMES.get(plain) or plain.replace("_", " ")
    return dimensions, array, {"long_name": long_name} if is_word else {"long_name": long_name, "units": units}
