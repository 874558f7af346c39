"""Psi and delta of ellipsometry as values of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.fit.observable import MUELLER, RatioObservable
from model.geometry import FloatArray

_M01, _M22, _M32 = 1, 10, 14


@dataclass(frozen=True)
class Ellipsometric(RatioObservable):
    """Psi and delta, in rad, of light that is reflected in the plane of incidence: r_p/r_s = tan(psi) exp(i delta).

    Psi is from 0 to pi/2. Delta is counted as ellipsometers do, for N = n - ik: of a bare surface it is from 0 to pi
    (Azzam and Bashara 1977). In the project's own convention the phase of r_p/r_s has the other sign. Of depolarized
    light they are those of the polarized part: with N = m01, C = m22 and S = m32, psi is atan2(√(C² + S²), N)/2 and
    delta is atan2(S, C).

    Parameters
    ----------
    has_delta : bool
        Whether delta was measured, too.
    """

    has_delta: bool = True
    elements: int = MUELLER

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the values."""
        return ("psi", "delta") if self.has_delta else ("psi",)

    def of(self, light: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and derivatives; see `Observable.of`."""
        n, c, s = (light[..., place, :] for place in (_M01, _M22, _M32))
        dn, dc, ds = (slopes[..., place, :] for place in (_M01, _M22, _M32))
        across = np.hypot(c, s)
        # Light that is all s or all p has no delta, and psi rises whichever way it changes; where there is no light, as
        # beside a smooth surface's mirror direction, nothing does.
        toward = 1.0 / np.where(across > 0.0, across, np.inf)
        c1, s1 = (c * toward)[..., None, :], (s * toward)[..., None, :]
        psi = 0.5 * np.arctan2(across, n)
        squared = n * n + across * across
        squared = np.where(squared > 0.0, squared, np.inf)[..., None, :]
        psi_slope = 0.5 * (n[..., None, :] * (c1 * dc + s1 * ds) - across[..., None, :] * dn) / squared
        if not self.has_delta:
            return psi[..., None, :], psi_slope[..., None, :]
        delta_slope = (c1 * ds - s1 * dc) * toward[..., None, :]
        values = np.stack([psi, wrapped(np.arctan2(s, c))], axis=-2)
        return values, np.stack([psi_slope, delta_slope], axis=-2)

    def condition(self, light: FloatArray, measured: FloatArray) -> FloatArray:
        """What light with these psi and delta obeys; see `RatioObservable.condition`."""
        n, c, s = light[:, _M01], light[:, _M22], light[:, _M32]
        across = np.hypot(c, s)
        twice = 2.0 * np.hypot(n, across)
        condition = np.zeros((len(light), len(self.columns), *light.shape[1:]))
        cosine, sine = np.cos(2.0 * measured[:, 0]), np.sin(2.0 * measured[:, 0])
        condition[:, 0, _M01] = -sine / twice
        condition[:, 0, _M22], condition[:, 0, _M32] = cosine * c / (across * twice), cosine * s / (across * twice)
        if self.has_delta:
            condition[:, 1, _M22] = -np.sin(measured[:, 1]) / across
            condition[:, 1, _M32] = np.cos(measured[:, 1]) / across
        return condition


def wrapped(delta_rad: FloatArray) -> FloatArray:
    """Delta in [-pi/2, 3 pi/2): no bare surface comes near the ends, so that differences never jump by a turn."""
    turned: FloatArray = (delta_rad + np.pi / 2.0) % (2.0 * np.pi) - np.pi / 2.0
    return turned
