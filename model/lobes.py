"""The three lobes of Hao et al. 2023, eqs. (5)-(10): each is one addend of the polarimetric reflectance, in 1/sr."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from model.facet import facet_mueller, facet_stokes
from model.fresnel import require_index
from model.geometry import Directions, FloatArray
from model.mueller import depolarizer
from model.slopes import require_sigma
from model.vgroove import masking, masking_over_cosines, single_bounce, single_bounce_fraction


class Lobe(Protocol):
    """One addend of a surface's polarimetric reflectance."""

    def mueller(self, directions: Directions) -> FloatArray:
        """Mueller matrices (..., 4, 4) in 1/sr."""
        ...

    def stokes(self, directions: Directions, incoming: FloatArray) -> FloatArray:
        """Stokes vectors (..., 4) in 1/sr made of incoming ones (4,) or (..., 4); builds no Mueller matrix."""
        ...

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        ...


@dataclass(frozen=True)
class Specular:
    """Mirror-like facets on the walls of V-grooves, one reflection; eq. (6).

    Parameters
    ----------
    weight : float
        rho_s >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    """

    weight: float
    sigma: float
    index: complex

    def __post_init__(self) -> None:
        _require_weight("rho_s", self.weight)
        require_sigma(self.sigma)
        require_index(self.index)

    def mueller(self, directions: Directions) -> FloatArray:
        """Mueller matrices (..., 4, 4) in 1/sr."""
        return self._reflectance(directions)[..., None, None] * facet_mueller(directions, self.index)

    def stokes(self, directions: Directions, incoming: FloatArray) -> FloatArray:
        """Stokes vectors (..., 4) in 1/sr made of incoming ones; builds no Mueller matrix."""
        return self._reflectance(directions)[..., None] * facet_stokes(directions, self.index, incoming)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        lost_normal, lost_60 = (1.0 - single_bounce_fraction(np.radians(angle), self.sigma) for angle in (0.0, 60.0))
        return (
            f"Specular lobe, eq. (6): rho_s = {self.weight:.6g}, sigma = {self.sigma:.6g} (rms slope per axis), index "
            f"{_format_index(self.index)}. One reflection in symmetric V-grooves (k = 1). Left out: light that meets a "
            f"groove's walls twice or more (on a perfect mirror of this roughness {lost_normal:.2%} of the light at 0° "
            f"incidence and {lost_60:.2%} at 60°), and with it the sharp ridge, or caustic, that straight grooves show "
            f"towards the mirror direction and a random rough surface does not."
        )

    def _reflectance(self, directions: Directions) -> FloatArray:
        return self.weight * single_bounce(directions, self.sigma)


@dataclass(frozen=True)
class Diffuse:
    """Depolarizing Lambertian facets on the same grooves; eq. (8), with its printed power laws.

    The bracket C1 + C2 tan ti tan tr cos phi goes negative towards grazing exit on the mirror side, which no
    reflectance can; it is clamped at zero. The tangents are divided into G, so that the lobe is finite to the horizon.

    Parameters
    ----------
    weight : float
        rho_d >= 0.
    sigma : float
        rms slope per axis, > 0.
    """

    weight: float
    sigma: float

    def __post_init__(self) -> None:
        _require_weight("rho_d", self.weight)
        require_sigma(self.sigma)

    def mueller(self, directions: Directions) -> FloatArray:
        """Mueller matrices (..., 4, 4) in 1/sr."""
        return self._reflectance(directions)[..., None, None] * depolarizer()

    def stokes(self, directions: Directions, incoming: FloatArray) -> FloatArray:
        """Stokes vectors (..., 4) in 1/sr made of incoming ones; builds no Mueller matrix."""
        s0 = self._reflectance(directions) * incoming[..., 0]
        stokes = np.zeros((*s0.shape, 4))
        stokes[..., 0] = s0
        return stokes

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        return (
            f"Diffuse lobe, eq. (8): rho_d = {self.weight:.6g}, sigma = {self.sigma:.6g}, unpolarized, with the "
            f"masking of single-bounce grooves and the printed power laws C1 = 0.8532 sigma^-0.095, "
            f"C2 = 0.3595 sigma^1.785. Set to zero where the printed expression is negative (grazing exit on the "
            f"mirror side)."
        )

    def _reflectance(self, directions: Directions) -> FloatArray:
        c1, c2 = 0.8532 * self.sigma**-0.095, 0.3595 * self.sigma**1.785
        bracket = c1 * masking(directions) + c2 * directions.horizontal_product * masking_over_cosines(directions)
        reflectance: FloatArray = self.weight / np.pi * np.maximum(bracket, 0.0)
        return reflectance


@dataclass(frozen=True)
class Directional:
    """Directional diffuse light near the normal, polarized like the half-vector facet; eq. (10) as printed.

    Its size depends on the exit angle alone, so that it is not reciprocal, and has a cusp at the normal with a 1/e
    half-width of atan(sigma²/2).

    Parameters
    ----------
    weight : float
        rho_dd >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    """

    weight: float
    sigma: float
    index: complex

    def __post_init__(self) -> None:
        _require_weight("rho_dd", self.weight)
        require_sigma(self.sigma)
        require_index(self.index)

    def mueller(self, directions: Directions) -> FloatArray:
        """Mueller matrices (..., 4, 4) in 1/sr."""
        return self._reflectance(directions)[..., None, None] * facet_mueller(directions, self.index)

    def stokes(self, directions: Directions, incoming: FloatArray) -> FloatArray:
        """Stokes vectors (..., 4) in 1/sr made of incoming ones; builds no Mueller matrix."""
        return self._reflectance(directions)[..., None] * facet_stokes(directions, self.index, incoming)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        half_width_deg = np.degrees(np.arctan(self.sigma**2 / 2.0))
        return (
            f"Directional diffuse lobe, eq. (10): rho_dd = {self.weight:.6g}, sigma = {self.sigma:.6g}, "
            f"index {_format_index(self.index)}, printed exponent tan(exit): a cusp at the normal that falls to 1/e "
            f"within {half_width_deg:.2g}°. Its size follows from the exit angle alone, so it is not reciprocal."
        )

    def _reflectance(self, directions: Directions) -> FloatArray:
        with np.errstate(under="ignore"):
            cusp = np.exp(-2.0 * np.tan(directions.exit_rad) / self.sigma**2)
        reflectance: FloatArray = self.weight * cusp / (np.sqrt(2.0 * np.pi) * self.sigma)
        return reflectance


def _require_weight(name: str, weight: float) -> None:
    if not 0.0 <= weight < np.inf:
        raise ValueError(f"{name} is {weight}; a lobe's weight must be a finite number of at least 0.")


def _format_index(index: complex) -> str:
    return f"{index.real:.6g} + {index.imag:.6g}i" if index.imag else f"{index.real:.6g}"
