"""The planes of a scan: directions that differ in nothing but their exit angle, which a curve may connect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import StokesPoint
from goniometer.directions import levels
from goniometer.rig_devices.entry import Role


@dataclass(frozen=True, eq=False)
class Plane:
    """Rows of a scan's points in one plane, its incidence, sample azimuth and exit azimuth in degrees, as read back."""

    rows: NDArray[np.intp]
    incidence_deg: float
    azimuth_deg: float
    exit_azimuth_deg: float = 0.0


def scan_planes(points: Sequence[StokesPoint], tolerances_deg: Mapping[Role, float]) -> tuple[Plane, ...]:
    """The planes of points, by incidence, by azimuth and then by exit azimuth; every point is in one.

    Parameters
    ----------
    points : sequence of StokesPoint
        The directions as they were read back.
    tolerances_deg : mapping of Role to float
        How far from its target an axis may stop: positions no farther apart than twice that are the same angle.
    """
    incidence_deg = np.array([point.incidence_deg for point in points])
    azimuth_deg = np.array([point.azimuth_deg for point in points])
    of_incidence = levels(incidence_deg, 2.0 * tolerances_deg["source_arm"])
    of_azimuth = levels(azimuth_deg, 2.0 * tolerances_deg["sample_azimuth"])
    number = of_incidence * (int(of_azimuth.max()) + 1) + of_azimuth
    exit_azimuth_deg = np.array([point.exit_azimuth_deg or 0.0 for point in points])
    if "detector_azimuth" in tolerances_deg:
        of_exit_azimuth = levels(exit_azimuth_deg, 2.0 * tolerances_deg["detector_azimuth"])
        number = number * (int(of_exit_azimuth.max()) + 1) + of_exit_azimuth
    angles_deg = incidence_deg, azimuth_deg, exit_azimuth_deg
    return tuple(
        Plane(rows, *(float(angle_deg[rows].mean()) for angle_deg in angles_deg))
        for rows in (np.flatnonzero(number == one) for one in np.unique(number))
    )
