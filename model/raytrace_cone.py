"""What a detector's cone receives from explicit V-grooves, with polarization, by Monte Carlo.

A Jones matrix goes with every ray of `raytrace`, from one wall's s-p frame to the next, with the textbook Fresnel
coefficients. Only rays that may reach the cone are thrown, weighted by how much more often than at random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.fresnel import require_index
from model.geometry import FloatArray
from model.mueller import UNPOLARIZED, ComplexArray, jones_to_mueller
from model.raytrace import Grooves, LitSurface, Rays, Sample, draw_grooves, reflections

# Classes of slopes, equally wide in t/(t + sigma), among which first passes find those that light the detector, in
# cones this much wider than its own. Slopes above 12 sigma, a share of exp(-72), are left out.
_CLASSES = 512
_STEEPEST = 12.0
_WIDER_RAD = (0.06, 0.015)
# Share of the rays that go to every class alike, whatever the first passes found.
_EVERYWHERE = 0.2


@dataclass(frozen=True)
class Cone:
    """A detector's circular cone of directions.

    Attributes
    ----------
    exit_rad, azimuth_rad : float
        Central direction; its s-direction is the detector's own x-axis.
    half_angle_rad : float
        Above 0; the cone lies above the horizon.

    Raises
    ------
    ValueError
        If the cone is empty or reaches the horizon.
    """

    exit_rad: float
    azimuth_rad: float
    half_angle_rad: float

    def __post_init__(self) -> None:
        if not (self.half_angle_rad > 0.0 and 0.0 <= self.exit_rad < np.pi / 2.0 - self.half_angle_rad):
            raise ValueError(
                f"half_angle_rad is {self.half_angle_rad:g} about an exit_rad of {self.exit_rad:g}; "
                f"it must be above 0, and the cone above the horizon at pi/2."
            )

    @property
    def centre(self) -> FloatArray:
        """Unit vector to the detector."""
        sin = np.sin(self.exit_rad)
        return np.array([sin * np.cos(self.azimuth_rad), sin * np.sin(self.azimuth_rad), np.cos(self.exit_rad)])

    @property
    def axis(self) -> FloatArray:
        """The detector's x-axis."""
        return np.array([-np.sin(self.azimuth_rad), np.cos(self.azimuth_rad), 0.0])

    @property
    def solid_angle_sr(self) -> float:
        """Solid angle of the cone."""
        return float(4.0 * np.pi * np.sin(self.half_angle_rad / 2.0) ** 2)

    def holds(self, directions: FloatArray, wider_rad: float) -> NDArray[np.bool_]:
        """Whether the cone, made this much wider, holds unit vectors (..., 3)."""
        chord = np.linalg.norm(directions - self.centre, axis=-1)
        inside: NDArray[np.bool_] = chord <= 2.0 * np.sin((self.half_angle_rad + wider_rad) / 2.0)
        return inside


def cone_mueller(
    lit: LitSurface, cone: Cone, *, index: complex, rays: int, seed: int, bounces: int | None = None
) -> Sample:
    """Polarimetric reflectance averaged over a cone, (1/Omega) ∫ F domega.

    Outgoing Stokes vectors refer to the detector's axis, projected perpendicular to each ray.

    Parameters
    ----------
    lit : LitSurface
        The surface and its illumination.
    cone : Cone
        The detector.
    index : complex
        Refractive index n + ik of the walls.
    rays : int
        How many are thrown for the result; as many again find where to throw them.
    seed : int
        Of the random numbers; the same seed gives the same result.
    bounces : int, optional
        Count only the light that meets walls exactly so many times.

    Returns
    -------
    Sample
        Mueller matrix (4, 4) in 1/sr. Near the mirror direction and for rare light take 10^5 rays or more: where none
        lands, the mean is 0 and so is its standard error.
    """
    weight, mueller = _landed(lit, cone, index, rays, seed, bounces)
    return _average(weight[:, None, None] * mueller, rays)


def cone_stokes(
    lit: LitSurface,
    cone: Cone,
    *,
    index: complex,
    rays: int,
    seed: int,
    bounces: int | None = None,
    incoming: ArrayLike = UNPOLARIZED,
) -> Sample:
    """The same for one incoming Stokes vector (4,): the outgoing one (4,), in 1/sr."""
    weight, mueller = _landed(lit, cone, index, rays, seed, bounces)
    return _average(weight[:, None] * (mueller @ np.asarray(incoming, np.float64)), rays)


def _landed(
    lit: LitSurface, cone: Cone, index: complex, rays: int, seed: int, bounces: int | None
) -> tuple[FloatArray, FloatArray]:
    """Weights in 1/sr and Mueller matrices of the rays that land in the cone."""
    require_index(index)
    random = np.random.default_rng(seed)
    share = even = np.full(_CLASSES, 1.0 / _CLASSES)
    for wider_rad in _WIDER_RAD:
        weight, drawn, _ = _throw(lit, cone, rays // 2, share, wider_rad, bounces, random)
        # The variance is least with rays in proportion to the root mean square of what a class sends.
        found = np.sqrt(share * np.bincount(drawn, weight**2, minlength=_CLASSES))
        if found.any():
            found = np.convolve(found, np.ones(3), mode="same")
            share = _EVERYWHERE * even + (1.0 - _EVERYWHERE) * found / found.sum()
    weight, _, grooves = _throw(lit, cone, rays, share, 0.0, bounces, random)
    return weight / cone.solid_angle_sr, jones_to_mueller(_jones(grooves, lit.travel, index, cone.axis))


def _throw(
    lit: LitSurface,
    cone: Cone,
    rays: int,
    share: FloatArray,
    wider_rad: float,
    bounces: int | None,
    random: np.random.Generator,
) -> tuple[FloatArray, Rays, Grooves]:
    """Weights (1/cosine of exit included), classes of slope and grooves of the rays that land in the widened cone."""
    drawn = random.choice(_CLASSES, size=rays, p=share)
    place = (drawn + random.random(rays)) / _CLASSES * _STEEPEST / (1.0 + _STEEPEST)
    slope = place / (1.0 - place)
    density = slope * np.exp(-(slope**2) / 2.0) * (1.0 + slope) ** 2 * _STEEPEST / (1.0 + _STEEPEST)

    # Walls conserve the part of a ray along the groove, so that s is parallel to the horizontal part of i + r, which
    # moves within the cone by no more than the cone's chord.
    along = (cone.centre - lit.travel)[:2]
    chord = 2.0 * np.sin(cone.half_angle_rad / 2.0)
    spread = np.arcsin(chord / np.hypot(*along)) if chord < np.hypot(*along) else np.pi / 2.0
    azimuth_rad = np.arctan2(along[1], along[0]) + spread * (2.0 * random.random(rays) - 1.0)
    weight = density / (_CLASSES * share[drawn]) * spread / (np.pi / 2.0)

    grooves = draw_grooves(lit.sigma * slope, azimuth_rad, lit.asymmetry, random)
    met, leaving = np.zeros(rays, dtype=np.intp), np.tile(lit.travel, (rays, 1))
    for bouncing, _, _, after in reflections(grooves, lit.travel):
        met[bouncing] += 1
        leaving[bouncing] = after
    wanted = met == bounces if bounces is not None else met > 0
    landed = np.flatnonzero(wanted & cone.holds(leaving, wider_rad))
    return weight[landed] / leaving[landed, 2], drawn[landed], grooves.select(landed)


def _jones(grooves: Grooves, travel: FloatArray, index: complex, detector_axis: FloatArray) -> ComplexArray:
    """Jones matrices (rays, 2, 2) from the macro frame of the incoming rays to the detector's frame."""
    rays = len(grooves.entry)
    jones = np.tile(np.eye(2, dtype=np.complex128), (rays, 1, 1))
    x, q = np.tile([0.0, -1.0, 0.0], (rays, 1)), np.tile(travel, (rays, 1))
    for bouncing, normals, before, after in reflections(grooves, travel):
        s, c = _unit(np.cross(before, normals)), -_dot(before, normals)
        w = np.sqrt(index**2 - 1.0 + c**2 + 0.0j)
        amplitudes = np.stack([(c - w) / (c + w), (index**2 * c - w) / (index**2 * c + w)], axis=-1)
        jones[bouncing] = amplitudes[..., None] * (_turn(x[bouncing], s, before) @ jones[bouncing])
        x[bouncing], q[bouncing] = s, after
    detector_x = _unit(detector_axis - _dot(q, detector_axis)[:, None] * q)
    return _turn(x, detector_x, q) @ jones


def _turn(x: FloatArray, new_x: FloatArray, travel: FloatArray) -> FloatArray:
    """Matrices (..., 2, 2) that refer fields in the frame (x, q × x) to the frame (new x, q × new x)."""
    cos, sin = _dot(x, new_x), _dot(np.cross(travel, x), new_x)
    return np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=-2)


def _average(weighted: FloatArray, rays: int) -> Sample:
    mean = weighted.sum(axis=0) / rays
    variance = (weighted**2).sum(axis=0) / rays - mean**2
    return Sample(mean, np.sqrt(np.maximum(variance, 0.0) / rays))


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("...i,...i->...", a, b)
    return product
