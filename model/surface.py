"""A surface: the sum of exactly the lobes it is made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from model.domain import above_horizon, require_directions
from model.geometry import FloatArray, directions
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.mueller import UNPOLARIZED


class Surface:
    """Polarimetric reflectance of a flat, isotropically rough surface, eq. (5) of Hao et al. 2023.

    Parameters
    ----------
    lobes : sequence of Lobe
        What reflects; a lobe that is not named costs nothing.

    Raises
    ------
    ValueError
        If there is no lobe.
    """

    def __init__(self, lobes: Sequence[Lobe]) -> None:
        if not lobes:
            raise ValueError("A surface needs at least one lobe; none was given.")
        self.lobes = tuple(lobes)

    def mueller(self, incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> FloatArray:
        """Mueller matrices F in 1/sr: outgoing radiance = F · Stokes irradiance of the beam · cos(incidence).

        Parameters
        ----------
        incidence_rad, exit_rad : array_like
            Angles from the normal, 0 to pi/2; at the horizon itself the result is 0.
        azimuth_rad : array_like
            phi_r - phi_i; pi is the mirror side. All three broadcast.

        Returns
        -------
        ndarray
            Shape (..., 4, 4), from the s-frame of the incoming to the s-frame of the outgoing ray.

        Raises
        ------
        ValueError
            If an angle is outside its range.
        """
        require_directions(incidence_rad, exit_rad, azimuth_rad)
        at = directions(incidence_rad, exit_rad, azimuth_rad)
        total = sum((lobe.mueller(at) for lobe in self.lobes), np.zeros(()))
        return np.where(above_horizon(incidence_rad, exit_rad)[..., None, None], total, 0.0)

    def stokes(
        self,
        incidence_rad: ArrayLike,
        exit_rad: ArrayLike,
        azimuth_rad: ArrayLike,
        incoming: ArrayLike = UNPOLARIZED,
    ) -> FloatArray:
        """Stokes vectors in 1/sr, F times the incoming Stokes vector, without building F.

        Parameters
        ----------
        incidence_rad, exit_rad, azimuth_rad : array_like
            As for `mueller`.
        incoming : array_like
            Stokes vector (4,) or (..., 4) in the s-frame of the incoming ray; unpolarized light by default.

        Returns
        -------
        ndarray
            Shape (..., 4).

        Raises
        ------
        ValueError
            If an angle is outside its range, or the Stokes vector has not four elements.
        """
        state = np.asarray(incoming, dtype=np.float64)
        if state.shape[-1:] != (4,):
            raise ValueError(f"incoming has shape {state.shape}; a Stokes vector has four elements on its last axis.")
        require_directions(incidence_rad, exit_rad, azimuth_rad)
        at = directions(incidence_rad, exit_rad, azimuth_rad)
        total = sum((lobe.stokes(at, state) for lobe in self.lobes), np.zeros(()))
        return np.where(above_horizon(incidence_rad, exit_rad)[..., None], total, 0.0)

    def describe(self) -> str:
        """What the surface consists of, what was left out and why, one paragraph a lobe."""
        paragraphs = [lobe.describe() for lobe in self.lobes]
        absent = [
            name
            for kind, name in ((Specular, "specular"), (Diffuse, "diffuse"), (Directional, "directional diffuse"))
            if not any(isinstance(lobe, kind) for lobe in self.lobes)
        ]
        if absent:
            paragraphs.append(f"Left out because not asked for: {', '.join(absent)} lobe.")
        return "\n".join(paragraphs)
