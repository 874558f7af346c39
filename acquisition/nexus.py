"""A scan as a NeXus file (HDF5): raw readings beside the reduced points, the fit, and where it all came from.

The layout follows the NeXus base classes and the application definition NXoptical_spectroscopy, which the file declares
where it is known when the scan began. The analyzer is an NXoptical_polarizer, because NXpolarizer describes polarizers
of neutron spins.
"""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acquisition.fit_points import in_degrees
from acquisition.nexus_definition import declare_definition, write_beam
from acquisition.nexus_fields import EXIT_AZIMUTH
from acquisition.nexus_fields import field as _field
from acquisition.nexus_fields import group as _group
from acquisition.nexus_fields import where as _where
from acquisition.nexus_mueller import write_generator, write_mueller
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import NoiseModel
from acquisition.whole_file import written_whole

if TYPE_CHECKING:
    import h5py

    from model.fit import FitResult

_DIMENSIONLESS = ""
"""The units attribute of a ratio or a count, as the NeXus manual writes it (unit category NX_DIMENSIONLESS)."""
_STOKES_NAMES = (
    "S0 per unit irradiance",
    "S1 per unit irradiance: s-polarized less p-polarized light",
    "S2 per unit irradiance: polarized at +45 degrees from the s-direction less -45 degrees",
    "S3 per unit irradiance: circular, clockwise for a receiver who looks at the source, less counterclockwise",
)


def write_nexus(
    path: Path,
    *,
    title: str,
    readings: Sequence[Reading],
    points: Sequence[StokesPoint],
    fit: FitResult | None,
    noise: NoiseModel,
    provenance: Mapping[str, str],
    more: Sequence[Callable[[h5py.Group], None]] = (),
) -> None:
    """Write a scan so that a NeXus viewer opens it on S0 against the exit angle, with DoLP and AoLP beside it.

    Parameters
    ----------
    path : Path
        The file; replaced as a whole, so that a writer that is killed leaves no broken file.
    title : str
        What was measured, in a person's words.
    readings : sequence of Reading
        The raw readings, in the order they were taken.
    points : sequence of StokesPoint
        What they reduce to.
    fit : FitResult or None
        The fit of these points; its fitted Stokes parameters must be as many as `points`.
    noise : NoiseModel
        The detector's, for the errors of the raw readings; those at another wavelength have the photons of theirs.
    provenance : mapping of str to str
        Texts to keep with the data: recipe, rig, scene, versions, seed. `started` is needed to declare the definition.
    more : sequence of callable
        Called with the entry, to write more into it.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    import h5py  # 0.1 s that a scan's start does not need

    with written_whole(path) as part, h5py.File(part, "w") as file:
        version = importlib.metadata.version("goniometer")
        file.attrs.update(
            NX_class="NXroot",
            default="entry",
            file_name=path.name,
            file_time=datetime.now(UTC).isoformat(timespec="seconds"),
            creator="goniometer",
            creator_version=version,
            HDF5_Version=h5py.version.hdf5_version,
            h5py_version=h5py.version.version,
        )
        entry = _group(file, "entry", "NXentry")
        entry.attrs["default"] = "stokes"
        entry["title"] = title
        entry["program_name"] = "goniometer"
        entry["program_name"].attrs["version"] = version
        if "started" in provenance:
            declare_definition(entry, provenance["started"])
        _write_instrument(entry, readings, noise)
        _group(entry, "sample", "NXsample")["name"] = title
        _write_points(entry, points)
        write_mueller(entry, points)
        if fit is not None:
            _write_fit(entry, fit)
        _write_provenance(entry, provenance)
        for write in more:
            write(entry)


def _write_instrument(entry: h5py.Group, readings: Sequence[Reading], noise: NoiseModel) -> None:
    instrument = _group(entry, "instrument", "NXinstrument")
    instrument["name"] = "polarimetric goniometer"
    instrument["angle_reference_frame"] = "sample-normal centered"
    _group(instrument, "source_lamp", "NXsource")["probe"] = "visible light"

    analyzer = _group(instrument, "analyzer", "NXoptical_polarizer")
    analyzer["type"] = "linear"
    analyzer["description"] = (
        "polarizer_angle is measured from the s-direction; NaN where the slot holds no polarizer. Where there is a "
        "retarder, light passes it before the polarizer"
    )

    detector = _group(instrument, "detector_power_meter", "NXdetector")
    detector["detector_channel_type"] = "single-channel"
    raw = _group(detector, "raw_data", "NXdata")
    raw.attrs.update(signal="raw", axes=["time"])

    def column(value: Callable[[Reading], float]) -> list[float]:
        return [value(reading) for reading in readings]

    power_w, exposure_s = (np.array(column(value)) for value in (lambda one: one.power_w, lambda one: one.exposure_s))
    _field(raw, "raw", power_w, "W", "optical power")
    wavelength_nm = np.array(column(lambda one: one.wavelength_nm or noise.wavelength_nm))
    errors_w, listed_nm = np.empty_like(power_w), np.unique(wavelength_nm)
    for one_nm in listed_nm.tolist():
        rows = wavelength_nm == one_nm
        errors_w[rows] = np.sqrt(replace(noise, wavelength_nm=one_nm).variance(power_w[rows], exposure_s[rows]))
    _field(raw, "raw_errors", errors_w, "W", "noise of the detector and of photons")
    if len(listed_nm) > 1:
        _field(raw, "wavelength", wavelength_nm, "nm")
    _field(raw, "time", column(lambda reading: reading.time_s), "s", "time on the bench's clock")
    _field(raw, "exposure", exposure_s, "s")
    _field(raw, "incidence_angle", column(lambda reading: reading.incidence_deg), "deg")
    _field(raw, "exit_angle", column(lambda reading: reading.exit_deg), "deg", "signed exit angle")
    _field(raw, "sample_azimuth", column(lambda reading: reading.azimuth_deg), "deg")
    if any(reading.exit_azimuth_deg is not None for reading in readings):
        _field(raw, "exit_azimuth", column(lambda reading: reading.exit_azimuth_deg or 0.0), "deg", EXIT_AZIMUTH)
    polarizer_deg = column(lambda reading: np.nan if reading.analyzer_deg is None else reading.analyzer_deg)
    analyzer["polarizer_angle"] = _field(raw, "polarizer_angle", polarizer_deg, "deg", "from the s-direction")
    if any(reading.retarder_deg is not None for reading in readings):
        retarder = _group(instrument, "retarder", "NXwaveplate")
        fast_deg = column(lambda reading: np.nan if reading.retarder_deg is None else reading.retarder_deg)
        retardance_deg = column(lambda reading: np.nan if reading.retardance_deg is None else reading.retardance_deg)
        retarder["fast_axis_angle"] = _field(raw, "fast_axis_angle", fast_deg, "deg", "from the s-direction")
        retarder["retardance"] = _field(
            raw, "retardance", retardance_deg, "deg", "of the slow axis behind the fast one"
        )
    for name, sweeps_deg in (
        ("polarizer_sweep", [reading.analyzer_sweep_deg for reading in readings]),
        ("fast_axis_sweep", [reading.retarder_sweep_deg for reading in readings]),
    ):
        if any(sweeps_deg):
            _field(raw, name, [sweep_deg or 0.0 for sweep_deg in sweeps_deg], "deg", "turned during the exposure")
    write_generator(instrument, raw, readings)
    _field(raw, "analyzer_slot", np.array([reading.slot for reading in readings], int), _DIMENSIONLESS)
    _field(raw, "point", np.array([reading.point for reading in readings], int), _DIMENSIONLESS)
    _field(raw, "repeat", np.array([reading.repeat for reading in readings], int), _DIMENSIONLESS)
    raw["kind"] = [str(reading.kind) for reading in readings]
    for name in raw:
        raw.attrs[f"{name}_indices"] = 0
    write_beam(instrument, listed_nm if len(listed_nm) > 1 else noise.wavelength_nm)


def _write_points(entry: h5py.Group, points: Sequence[StokesPoint]) -> None:
    count = len(points[0].stokes) if points else 3
    names = [f"S{index}" for index in range(count)]
    stokes = np.array([point.stokes for point in points]).reshape(-1, count)
    covariance = np.array([point.covariance for point in points]).reshape(-1, count, count)
    stderr = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    group = _plot(entry, "stokes", "S0", names[1:], points)
    for index in range(count):
        _field(group, f"S{index}", stokes[:, index], "1/sr", _STOKES_NAMES[index])
        _field(group, f"S{index}_errors", stderr[:, index], "1/sr")
    _field(group, "covariance", covariance, "1/sr^2", f"covariance matrix of ({', '.join(names)})")

    group = _plot(entry, "dolp", "DoLP", ["DoLP_debiased"], points)
    dolp_stderr = [point.dolp_stderr for point in points]
    _field(group, "DoLP", [point.dolp for point in points], _DIMENSIONLESS, "degree of linear polarization")
    _field(group, "DoLP_errors", dolp_stderr, _DIMENSIONLESS)
    _field(group, "DoLP_debiased", [point.dolp_debiased for point in points], _DIMENSIONLESS, "DoLP without noise bias")
    _field(group, "DoLP_debiased_errors", dolp_stderr, _DIMENSIONLESS)

    group = _plot(entry, "aolp", "AoLP", [], points)
    _field(group, "AoLP", [point.aolp_deg for point in points], "deg", "angle of polarization from the s-direction")
    _field(group, "AoLP_errors", [point.aolp_stderr_deg for point in points], "deg")
    if count == 4:
        _write_ratio(entry, "docp", "DoCP", points, "degree of circular polarization, S3/S0")
        _write_ratio(entry, "dop", "DoP", points, "degree of polarization, linear and circular")


def _write_ratio(entry: h5py.Group, name: str, signal: str, points: Sequence[StokesPoint], long_name: str) -> None:
    group = _plot(entry, name, signal, [], points)
    _field(group, signal, [getattr(point, name) for point in points], _DIMENSIONLESS, long_name)
    _field(group, f"{signal}_errors", [getattr(point, f"{name}_stderr") for point in points], _DIMENSIONLESS)


def _plot(
    entry: h5py.Group, name: str, signal: str, others: Sequence[str], points: Sequence[StokesPoint]
) -> h5py.Group:
    """An NXdata group over the exit angle; the signals themselves are left to the caller."""
    group = _group(entry, name, "NXdata")
    group.attrs.update(signal=signal, axes=["exit_angle"])
    if others:
        group.attrs["auxiliary_signals"] = list(others)
    _where(group, points)
    return group


def _write_fit(entry: h5py.Group, fit: FitResult) -> None:
    process = _group(entry, "fit", "NXprocess")
    process["program"] = "goniometer"
    process["version"] = importlib.metadata.version("goniometer")
    _write_note(process, "model", "what the fitted surface consists of", fit.description)
    _field(process, "chi_square", fit.chi_square, _DIMENSIONLESS)
    _field(process, "degrees_of_freedom", fit.degrees_of_freedom, _DIMENSIONLESS)
    shown = in_degrees(fit)
    parameters = _group(process, "parameters", "NXparameters")
    for name, estimate in shown.parameters.items():
        units = "deg" if name.endswith("_deg") else "1/sr" if name.endswith("_per_sr") else _DIMENSIONLESS
        _field(parameters, name, estimate.value, units).attrs["at_bound"] = estimate.at_bound
        stderr = np.nan if estimate.stderr is None else estimate.stderr
        _field(parameters, f"{name}_errors", stderr, units)
    process["correlation_names"] = list(shown.names)
    _field(process, "correlation", fit.correlation, _DIMENSIONLESS)

    stokes = entry["stokes"]
    for index in range(3):
        _field(stokes, f"S{index}_fit", fit.stokes[:, index], "1/sr", f"S{index} of the fitted model")
    measured = [name for name in stokes.attrs["auxiliary_signals"] if name not in ("S1", "S2")]
    stokes.attrs["auxiliary_signals"] = ["S0_fit", "S1", "S1_fit", "S2", "S2_fit", *measured]


def _write_provenance(entry: h5py.Group, provenance: Mapping[str, str]) -> None:
    process = _group(entry, "provenance", "NXprocess")
    process["program"] = "goniometer"
    process["version"] = importlib.metadata.version("goniometer")
    for key, text in provenance.items():
        _write_note(process, re.sub(r"\W", "_", key), key, text)


def _write_note(parent: h5py.Group, name: str, description: str, text: str) -> None:
    note = _group(parent, name, "NXnote")
    note["description"], note["type"] = description, "text/plain"
    note["data"] = np.bytes_(text.encode())  # NXnote asks for bytes; viewers show them as text
