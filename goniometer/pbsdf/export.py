"""A run's fitted surface as a ``.pbsdf`` file, which Mitsuba 3 renders with its plugin ``measured_polarized``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.recipe import Recipe
from goniometer.errors import FitError
from goniometer.pbsdf.half_angles import Reflectance
from goniometer.pbsdf.table import Table, tabulated
from goniometer.pbsdf.tensor_file import write_tensor_file
from goniometer.run_folder import stored_run
from model.acceptance import Acceptance

WAVELENGTHS_NM = (450, 500, 550, 600, 650)
"""The plugin reads exactly five. A fit holds for one wavelength, so all five get the same matrices."""

_CONE_NODES = 3
_MOST_NAMED = 7


def export_pbsdf(run: str | Path, path: str | Path) -> Table:
    """Fit a stored run as its recipe says, and write the surface as a table of Mueller matrices.

    Parameters
    ----------
    run : str or Path
        The run's folder.
    path : str or Path
        The file to write, which is replaced as a whole.

    Returns
    -------
    Table
        What was written, with its interpolation error.

    Raises
    ------
    JournalError, ReductionError
        If the run cannot be read or reduced, or the file cannot be written.
    FitError
        If the points could not be fitted.
    """
    stored = stored_run(run)
    if stored.fit is None:
        raise FitError(f"{stored.folder} has no fit, so there is no surface to export: {stored.refusal}")
    table = tabulated(_for_many_directions(stored.fit.surface))
    description = (
        f"{stored.recipe.recipe}: model fitted at {stored.recipe.one_wavelength_nm:g} nm and "
        f"{_incidences(stored.recipe)} degrees of incidence; all wavelengths of this table have the same matrices. "
        f"{stored.fit.description}"
    )
    write_pbsdf(Path(path), table, description)
    return table


def _incidences(recipe: Recipe) -> str:
    """The angles of incidence at which a recipe measures; of more than a few, the ends."""
    angles_deg = np.unique(recipe.directions_deg()[:, 0])
    if len(angles_deg) > _MOST_NAMED:
        return f"{angles_deg[0]:g} to {angles_deg[-1]:g}"
    return ", ".join(f"{angle:g}" for angle in angles_deg)


def _for_many_directions(surface: Reflectance) -> Reflectance:
    """The surface itself; where a cone is averaged over, with a coarser quadrature, which takes a tenth of the time.

    Near the mirror direction that errs by some per cent, no more than the interpolation does.
    """
    if isinstance(surface, Acceptance):
        return Acceptance(surface.surface, surface.detector_half_angle_rad, surface.source_half_angle_rad, _CONE_NODES)
    return surface


def write_pbsdf(path: Path, table: Table, description: str) -> None:
    """Write a table in Mitsuba's layout: M over (phi_d, theta_d, theta_h, wavelength, row, column), angles in rad.

    Matrices are in 1/sr, without the cosine that a renderer multiplies by. Mitsuba's Stokes vectors agree with ours:
    +S1 perpendicular to the plane of the rays, y = ray × x, S3 > 0 clockwise for the receiver.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    axes, shape = table.axes, table.matrices.shape
    matrices = np.broadcast_to(table.matrices[:, :, :, None], (*shape[:3], len(WAVELENGTHS_NM), 4, 4))
    write_tensor_file(
        path,
        {
            "description": np.frombuffer(description.encode(), np.uint8),
            "phi_d": axes.phi_d_rad[None].astype(np.float32),
            "theta_d": axes.theta_d_rad[None].astype(np.float32),
            "theta_h": axes.theta_h_rad[None].astype(np.float32),
            "wvls": np.array(WAVELENGTHS_NM, np.uint16),
            "M": matrices,
        },
    )
