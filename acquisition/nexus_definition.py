"""What the NeXus application definition NXoptical_spectroscopy demands of a file beside the data themselves.

docs/data.md lists what of the definition is filled, and what is not and why.
"""

from __future__ import annotations

import importlib.metadata
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition.nexus_fields import field, group

if TYPE_CHECKING:
    import h5py

_DEFINITION = "NXoptical_spectroscopy"
_VERSION = "v2026.01"
_URL = f"https://fairmat-nfdi.github.io/nexus_definitions/classes/applications/{_DEFINITION}.html"
_ANGLES = {
    "angle_of_incidence": "incidence_angle",
    "angle_of_detection": "exit_angle",
    "angle_of_in_plane_sample_rotation": "sample_azimuth",
}


def declare_definition(entry: h5py.Group, started: str) -> None:
    """Declare the definition that the file keeps to, with what was measured and when.

    Parameters
    ----------
    entry : h5py.Group
        The file's one NXentry.
    started : str
        ISO 8601, with a time zone. Without it no file keeps to the definition.
    """
    entry["definition"] = _DEFINITION
    entry["definition"].attrs.update(version=_VERSION, URL=_URL)
    entry["start_time"] = started
    entry["experiment_type"] = "angle-resolved polarimetric scattering"
    entry["experiment_type"].attrs["custom"] = True  # it is none of those that the definition lists


def write_beam(instrument: h5py.Group, wavelength_nm: float | NDArray[np.float64]) -> None:
    """Write the beam that falls on the sample and the program that took the readings; name the angles of the raw data.

    Parameters
    ----------
    instrument : h5py.Group
        With its lamp and its detector's raw data.
    wavelength_nm : float or ndarray
        As the recipe states it; several in ascending order.
    """
    beam = group(instrument, "beam_lamp", "NXbeam")
    beam["parameter_reliability"] = "nominal"
    beam["beam_polarization_type"] = "unpolarized"
    beam["associated_source"] = "/entry/instrument/source_lamp"
    field(beam, "incident_wavelength", wavelength_nm, "nm")
    instrument["source_lamp/associated_beam"] = "/entry/instrument/beam_lamp"
    software = group(instrument, "software_goniometer", "NXprogram")
    software["program"] = "goniometer"
    software["program"].attrs["version"] = importlib.metadata.version("goniometer")
    for name, raw in _ANGLES.items():
        instrument[name] = instrument[f"detector_power_meter/raw_data/{raw}"]
