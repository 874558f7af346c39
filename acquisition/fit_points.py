"""From the Stokes points of a scan to the fit's arrays: the one place where degrees become radians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.readings import StokesPoint
from acquisition.recipe import FitChoice
from model.acceptance import half_angle_rad
from model.fit import Dataset, SurfaceFamily, lobe_family
from model.geometry import in_plane


def dataset(points: Sequence[StokesPoint]) -> Dataset:
    """Stack points into arrays; a signed exit angle becomes an exit angle and an azimuth.

    An incidence that was read back a little below zero is one from the other side, seen mirrored.
    """
    incidence_rad = np.radians([point.incidence_deg for point in points])
    exit_rad = np.radians([point.exit_deg for point in points])
    exit_rad, azimuth_rad = in_plane(np.where(incidence_rad < 0.0, -exit_rad, exit_rad))
    return Dataset(
        incidence_rad=np.abs(incidence_rad),
        exit_rad=exit_rad,
        azimuth_rad=azimuth_rad,
        values=np.array([point.stokes for point in points]),
        covariance=np.array([point.covariance for point in points]),
    )


def surface_family(choice: FitChoice, acceptance_sr: float) -> SurfaceFamily:
    """The surfaces that a recipe's fit section allows, seen with a detector of this acceptance where that matters.

    After one bounce reflectance hardly changes within a detector's cone. After two it has a pole in the mirror
    direction, and only its average over the cone means anything.
    """
    return lobe_family(
        choice.lobes,
        free={name: (low, high) for name, (low, high) in choice.free.items()},
        fixed={name: value for name, value in choice.fixed.items()},  # noqa: C416 (widens the keys to str)
        bounces=choice.bounces,
        detector_half_angle_rad=half_angle_rad(acceptance_sr) if choice.bounces > 1 else 0.0,
    )
