"""A surface: the sum of exactly the lobes it is made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.geometry import Directions, FloatArray, directions
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.mueller import UNPOLARIZED

_HORIZON_RAD = np.pi / 2.0


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
        at = _checked_directions(incidence_rad, exit_rad, azimuth_rad)
        total = sum((lobe.mueller(at) for lobe in self.lobes), np.zeros(()))
        return np.where(_above_horizon(at)[..., None, None], total, 0.0)

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
        at = _checked_directions(incidence_rad, exit_rad, azimuth_rad)
        total = sum((lobe.stokes(at, state) for lobe in self.lobes), np.zeros(()))
        return np.where(_above_horizon(at)[..., None], total, 0.0)

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


def _checked_directions(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> Directions:
    for name, angle in (("incidence_rad", incidence_rad), ("exit_rad", exit_rad)):
        _require_range(name, angle, 0.0, _HORIZON_RAD, "0 to pi/2")
    _require_range("azimuth_rad", azimuth_rad, -np.inf, np.inf, "any finite angle")
    return directions(incidence_rad, exit_rad, azimuth_rad)


def _require_range(name: str, angle: ArrayLike, low: float, high: float, meaning: str) -> None:
    values = np.asarray(angle, dtype=np.float64)
    inside = np.isfinite(values) & (values >= low) & (values <= high)
    if not inside.all():
        first = values[~inside].flat[0]
        raise ValueError(f"{name} holds {first:.9g} rad; allowed is {meaning}. Nothing was computed.")


def _above_horizon(at: Directions) -> NDArray[np.bool_]:
    above: NDArray[np.bool_] = (at.incidence_rad < _HORIZON_RAD) & (at.exit_rad < _HORIZON_RAD)
    return above
